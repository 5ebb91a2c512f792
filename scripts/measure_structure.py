#!/usr/bin/env python3
"""How often Gaussians that a mesh's file tells apart belong to different parts: the priors of src/consensus/structure.rs.

    pip install mujoco networkx numpy pillow scipy trimesh
    scripts/measure_structure.py [MESH | MODEL.xml]... [--labels MESH POINTS.ply]...

Two kinds of files have a truth. In a mesh with materials, or an MJCF, each body of which counts as gprop takes it, the material is the true
part, and the shapes and connected surfaces are judged by it. A cloud of labelled points (--labels; `segmentation` of each, in metres, for a
mesh in millimetres) says which part each surface of each colour is: the one that most of its points name; colours count as
materials.

As gprop does, 60,000 points are spread over the surface by area; those that none of 26 directions sees are left out; pairs are a
point's 6 nearest neighbours and those of rank 16, 24, 32, 40 and 48. A pair counts for the strongest that tells it apart: look, else
shape if the surfaces differ too, else surface. For each, the table has the share of pairs that belong to different parts, file by
file; and over all files the mean m, and what the variance v between files makes of it as a beta distribution: worth m (1 - m) / v - 1
observations. "apart" are look and shape together.
"""

import argparse
import itertools
import pathlib

import mujoco
import numpy
import trimesh
from scipy.spatial import cKDTree

POINTS = 60_000
NEAR, FAR = 6, [16, 24, 32, 40, 48]
CUES = ["same", "surface", "shape", "look"]
# An object with fewer such pairs says nothing of them.
LEAST_PAIRS = 200


def bodies(path):
    """The visual shapes of each body of an MJCF, with their materials."""
    model = mujoco.MjModel.from_xml_path(path)
    for body in range(1, model.nbody):
        scene = trimesh.Scene()
        for geom in numpy.flatnonzero((model.geom_bodyid == body) & (model.geom_group <= 2)):
            kind, size = model.geom_type[geom], model.geom_size[geom]
            if kind == mujoco.mjtGeom.mjGEOM_MESH:
                mesh = model.geom_dataid[geom]
                vertices, faces = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
                shape = trimesh.Trimesh(
                    model.mesh_vert[vertices : vertices + model.mesh_vertnum[mesh]],
                    model.mesh_face[faces : faces + model.mesh_facenum[mesh]],
                    process=False,
                )
            elif kind == mujoco.mjtGeom.mjGEOM_BOX:
                shape = trimesh.creation.box(2 * size)
            elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
                shape = trimesh.creation.icosphere(radius=size[0])
            elif kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
                shape = trimesh.creation.cylinder(size[0], 2 * size[1])
            elif kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
                shape = trimesh.creation.capsule(2 * size[1], size[0])
                shape.apply_translation(-shape.bounds.mean(axis=0))
            else:
                continue
            # Two shapes of one material look alike; without one, the colour is the look.
            material = model.geom_matid[geom]
            color = [material % 251, material // 251, 7, 255] if material >= 0 else (255 * model.geom_rgba[geom]).astype(int)
            shape.visual.face_colors = numpy.tile(color, (len(shape.faces), 1)).astype(numpy.uint8)
            placed = trimesh.transformations.quaternion_matrix(model.geom_quat[geom])
            placed[:3, 3] = model.geom_pos[geom]
            scene.add_geometry(shape, geom_name=f"{geom:05}", transform=placed)
        if scene.geometry:
            yield scene


def scenes(path):
    if path.endswith(".xml"):
        yield from bodies(path)
    else:
        loaded = trimesh.load(path, process=False)
        yield loaded if isinstance(loaded, trimesh.Scene) else trimesh.Scene(loaded)


def taken_apart(scene):
    """Triangles, and for each its look, shape and surface."""
    triangles, looks, shapes, known = [], [], [], {}
    for number, node in enumerate(sorted(scene.graph.nodes_geometry)):
        transform, name = scene.graph[node]
        mesh = scene.geometry[name]
        corners = trimesh.transform_points(mesh.vertices, transform)[mesh.faces]
        triangles.append(corners)
        shapes += [number] * len(corners)
        if mesh.visual.kind == "texture":
            material = mesh.visual.material
            picture = getattr(material, "baseColorTexture", None)
            keys = [(str(material.main_color.tolist()), picture.tobytes() if picture else b"")] * len(corners)
        else:
            keys = [(str(color), b"") for color in mesh.visual.face_colors.tolist()]
        looks += [known.setdefault(key, len(known)) for key in keys]
    triangles = numpy.concatenate(triangles)
    _, places = numpy.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)
    places = places.reshape(-1, 3)
    edges = numpy.concatenate([places[:, [0, 1]], places[:, [1, 2]]])
    surfaces = trimesh.graph.connected_component_labels(edges, node_count=places.max() + 1)[places[:, 0]]
    return triangles, numpy.array(looks), numpy.array(shapes), surfaces


def spread(triangles):
    """Points over the surface, and the triangle of each."""
    random = numpy.random.default_rng(0)
    areas = numpy.linalg.norm(numpy.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]), axis=1) / 2
    steps = (numpy.arange(POINTS) + random.random(POINTS)) / POINTS
    chosen = numpy.minimum(numpy.searchsorted(numpy.cumsum(areas) / areas.sum(), steps), len(areas) - 1)
    root, along = numpy.sqrt(random.random(POINTS)), random.random(POINTS)
    shares = numpy.stack([1 - root, root * (1 - along), root * along], axis=1)
    return (triangles[chosen] * shares[:, :, None]).sum(axis=1), chosen, numpy.sqrt(areas.sum() / POINTS)


def seen(points, spacing):
    """Which points some direction sees: none lies before them in a cell that is twice the spacing wide."""
    visible = numpy.zeros(len(points), bool)
    for direction in itertools.product([-1, 0, 1], repeat=3):
        if not any(direction):
            continue
        forward = numpy.array(direction) / numpy.linalg.norm(direction)
        right = numpy.cross(forward, [0.3, 0.5, 0.81])
        right /= numpy.linalg.norm(right)
        cells = numpy.floor(points @ numpy.stack([right, numpy.cross(forward, right)], axis=1) / (2 * spacing))
        _, cell = numpy.unique(cells, axis=0, return_inverse=True)
        depth = points @ forward
        first = numpy.full(cell.max() + 1, numpy.inf)
        numpy.minimum.at(first, cell.ravel(), depth)
        visible |= depth <= first[cell.ravel()] + 2 * spacing
    return visible


def pairs_of(points):
    _, nearest = cKDTree(points).query(points, k=FAR[-1] + 1)
    ranks = list(range(1, NEAR + 1)) + FAR
    pairs = numpy.concatenate([numpy.stack([nearest[:, 0], nearest[:, rank]], axis=1) for rank in ranks])
    return numpy.unique(numpy.sort(pairs, axis=1), axis=0)


def measure(path, labels):
    """By cue, whether each pair belongs to different parts; and what the file has."""
    found, counts = {cue: [] for cue in CUES}, numpy.zeros(4, int)
    for scene in scenes(path):
        triangles, looks, shapes, surfaces = taken_apart(scene)
        if max(len(set(shapes)), len(set(surfaces))) == 1:
            continue
        points, chosen, spacing = spread(triangles)
        kept = seen(points, spacing)
        points, chosen = points[kept], chosen[kept]
        look, shape, surface = looks[chosen], shapes[chosen], surfaces[chosen]
        part, cues = (most_named(points, look, surface, labels), [surface, shape, look]) if labels else (look, [surface, shape])
        a, b = pairs_of(points).T
        strongest = numpy.zeros(len(a), int)
        for number, cue in enumerate(cues, start=1):
            strongest[(cue[a] != cue[b]) & ((surface[a] != surface[b]) | (cue is look))] = number
        for number, cue in enumerate(CUES):
            found[cue].append((part[a] != part[b])[strongest == number])
        counts += [len(set(of)) for of in (part, look, shape, surface)]
    return {cue: numpy.concatenate(of) for cue, of in found.items() if of}, counts


def most_named(points, look, surface, labels):
    """For each point, the label that most points of its surface and look have."""
    at, label = read_labels(labels)
    nearest = label[cKDTree(at).query(points / 1000)[1]]
    _, region = numpy.unique(numpy.stack([look, surface]), axis=1, return_inverse=True)
    region = region.ravel()
    most = numpy.array([numpy.bincount(nearest[region == number]).argmax() for number in range(region.max() + 1)])
    print(f"{labels}: {100 * (most[region] == nearest).mean():.1f} % of the points have the label of their region")
    return most[region]


def read_labels(path):
    rows = pathlib.Path(path).read_text().split("end_header\n")[1].split("\n")
    rows = numpy.array([[float(value) for value in row.split()] for row in rows if row.strip()])
    return rows[:, :3], rows[:, 6].astype(int)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("meshes", nargs="*")
    parser.add_argument("--labels", nargs=2, action="append", default=[], metavar=("MESH", "POINTS"))
    asked = parser.parse_args()
    shares = {cue: [] for cue in CUES}
    print("| file | parts, looks, shapes, surfaces | " + " | ".join(CUES) + " |\n|" + " --- |" * (len(CUES) + 2))
    for path, labels in [(mesh, None) for mesh in asked.meshes] + asked.labels:
        found, counts = measure(path, labels)
        cells = []
        for cue in CUES:
            differ = found.get(cue, numpy.zeros(0))
            cells.append(f"{100 * differ.mean():.1f} % of {len(differ)}" if len(differ) else "")
            if len(differ) >= LEAST_PAIRS:
                shares[cue].append(differ.mean())
        print(f"| {pathlib.Path(path).stem} | {', '.join(map(str, counts))} | " + " | ".join(cells) + " |", flush=True)
    shares["apart"] = shares["shape"] + shares["look"]
    for cue, of_files in shares.items():
        if len(of_files) > 1:
            mean, variance = numpy.mean(of_files), numpy.var(of_files, ddof=1)
            worth = mean * (1 - mean) / variance - 1 if variance > 0 else float("inf")
            print(f"{cue}: {len(of_files)} files, mean {mean:.3f}, worth {worth:.2f} observations")


main()
