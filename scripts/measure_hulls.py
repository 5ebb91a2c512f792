#!/usr/bin/env python3
"""Compares the convex pieces of an export with the true surface of the object, and with CoACD's pieces of the same mesh.

    pip install numpy scipy trimesh rtree manifold3d pillow coacd
    scripts/measure_hulls.py fixtures/hammer [fixtures/mug ...] [--coacd] [--depths DIR]

Work folders must be finished (`gprop run SCENE`). Pieces are compared with as much ground truth as a scene has:

- silhouettes: `ground_truth/part_maps` of all views. "Hole" is background within a silhouette; the table says how much of it the
  pieces leave open, and how wide a ball fits through the widest hole, in truth and between the pieces.
- depth maps of held-out views, `ground_truth/eval/depth` (of the fixtures, only the hammer's are in the repository; `--depths DIR`
  reads DIR/SCENE/ground_truth). "Distance" is the mean of two means, in % of the diagonal: from true points to the surface of the
  union of the pieces, and from this surface, where a held-out view would see it, to true points. Undersides are not seen.
- volume: of the union of the pieces, and of what the parts in `ground_truth/parts.json` are made of; the two can be compared if
  the object has no hollow inside.
"""

import argparse
import glob
import json
import os
import resource
import subprocess
import sys
import tempfile
import time

try:
    import numpy as np
    import trimesh
    from PIL import Image, ImageDraw
    from scipy import ndimage
    from scipy.spatial import ConvexHull, cKDTree
except ImportError as error:
    sys.exit(f"{error.name} is missing: pip install numpy scipy trimesh rtree manifold3d pillow")

# Points on the surface of the union of the pieces.
SAMPLES = 20_000
# True points that are compared, of all views together.
TRUE_POINTS = 20_000
# Holes of fewer pixels are noise along edges.
HOLE_PIXELS = 50
# The surface is seen if it faces the camera by at least this cosine.
FACING = 0.2
BACKGROUND = 255


def cameras(path):
    """World-to-camera matrices (x right, y down, z forward), intrinsics and file names of a transforms.json."""
    with open(path) as file:
        transforms = json.load(file)
    lens = [transforms[key] for key in ("fl_x", "fl_y", "cx", "cy")]
    for frame in transforms["frames"]:
        world = np.array(frame["transform_matrix"]) @ np.diag([1.0, -1.0, -1.0, 1.0])
        yield np.linalg.inv(world), lens, os.path.splitext(os.path.basename(frame["file_path"]))[0]


def project(matrix, lens, points):
    seen = points @ matrix[:3, :3].T + matrix[:3, 3]
    return seen[:, :2] / seen[:, 2:] * lens[:2] + lens[2:], seen[:, 2]


def silhouettes(folder, pieces):
    """IoU of the silhouettes; holes of the true ones: pixels, pixels left open, and the widest in mm with what is left of it."""
    shared = either = hole = left = 0
    widest = (0.0, 0.0, "")
    for matrix, lens, name in cameras(os.path.join(folder, "transforms.json")):
        true = np.array(Image.open(os.path.join(folder, "ground_truth", "part_maps", f"{name}.png"))) != BACKGROUND
        picture = Image.new("1", (true.shape[1], true.shape[0]))
        draw = ImageDraw.Draw(picture)
        depths = []
        for piece in pieces:
            pixels, depth = project(matrix, lens, piece.vertices)
            depths.append(depth.mean())
            corners = pixels[ConvexHull(pixels).vertices]
            # A pixel is covered if its centre is.
            draw.polygon([tuple(corner - 0.5) for corner in corners], fill=1)
        drawn = np.array(picture)
        shared, either = shared + (true & drawn).sum(), either + (true | drawn).sum()
        labels, count = ndimage.label(~true)
        border = np.unique(np.concatenate([labels[0], labels[-1], labels[:, 0], labels[:, -1]]))
        sizes = np.bincount(labels.ravel())
        unit = 1e3 * float(np.mean(depths)) / lens[0]
        for number in range(1, count + 1):
            if number in border or sizes[number] < HOLE_PIXELS:
                continue
            own = labels == number
            hole, left = hole + own.sum(), left + (own & ~drawn).sum()
            wide = 2 * unit * ndimage.distance_transform_edt(own).max()
            if wide > widest[0]:
                widest = (wide, 2 * unit * ndimage.distance_transform_edt(own & ~drawn).max(), name)
    return {"silhouette_iou": shared / either, "hole_left_open": left / hole if hole else None, "widest_hole_mm": widest[:2],
            "view": widest[2]}


def true_points(depths):
    """World points on the true surface, of all held-out views, and per view its camera and depth map (0 for background)."""
    points, views = [], []
    path = os.path.join(depths, "transforms_eval.json")
    with open(path) as file:
        unit = json.load(file)["depth_unit_m"]
    for matrix, lens, name in cameras(path):
        depth = np.array(Image.open(os.path.join(depths, "eval", "depth", f"{name}.png"))).astype(float) * unit
        shown = np.array(Image.open(os.path.join(depths, "eval", "part_maps", f"{name}.png"))) != BACKGROUND
        # Depths at the silhouette's edge are a mean of object and background.
        shown &= (depth > 0) & (depth < depth[shown].max() + unit)
        core = ndimage.binary_erosion(shown)
        rows, columns = np.nonzero(core)
        z = depth[core]
        seen = np.stack([(columns + 0.5 - lens[2]) / lens[0] * z, (rows + 0.5 - lens[3]) / lens[1] * z, z], axis=1)
        points.append((seen - matrix[:3, 3]) @ matrix[:3, :3])
        views.append((matrix, lens, np.where(shown, depth, 0.0)))
    return np.concatenate(points), views


def distances(union, points, views, diagonal):
    """Mean distances in % of the diagonal: from true points to the union's surface, and back."""
    random = np.random.default_rng(1)
    some = points[random.choice(len(points), min(TRUE_POINTS, len(points)), replace=False)]
    there = np.abs(trimesh.proximity.ProximityQuery(union).on_surface(some)[1])
    samples, faces = trimesh.sample.sample_surface(union, SAMPLES, seed=1)
    normals = union.face_normals[faces]
    visible = np.zeros(len(samples), bool)
    for matrix, lens, depth in views:
        pixels, z = project(matrix, lens, samples)
        eye = -matrix[:3, :3].T @ matrix[:3, 3]
        towards = (eye - samples) / np.linalg.norm(eye - samples, axis=1, keepdims=True)
        columns, rows = np.floor(pixels).astype(int).T
        inside = (columns >= 0) & (rows >= 0) & (columns < depth.shape[1]) & (rows < depth.shape[0])
        at = np.where(inside, depth[np.clip(rows, 0, depth.shape[0] - 1), np.clip(columns, 0, depth.shape[1] - 1)], 0.0)
        # Hidden behind the true surface, or by the union itself: its own depth there is less.
        hidden = (at > 0) & (z > at + 0.02 * diagonal)
        visible |= inside & ~hidden & ((towards * normals).sum(axis=1) > FACING)
    rays = samples[visible]
    back = cKDTree(points).query(rays)[0]
    return 100 * there.mean() / diagonal, 100 * back.mean() / diagonal, 100 * np.quantile(there, 0.99) / diagonal


def measure(folder, truth, depths, pieces):
    union = trimesh.boolean.union(pieces, engine="manifold") if len(pieces) > 1 else pieces[0]
    found = {"pieces": len(pieces), "vertices": sum(len(piece.vertices) for piece in pieces),
             "volume_cm3": 1e6 * union.volume, **silhouettes(folder, pieces)}
    low, high = np.array(truth["bounding_box_m"])
    diagonal = float(np.linalg.norm(high - low))
    if os.path.exists(os.path.join(depths, "eval", "depth")):
        points, views = true_points(depths)
        found |= dict(zip(("to_pieces", "to_truth", "worst"), distances(union, points, views, diagonal)))
        found["distance"] = (found["to_pieces"] + found["to_truth"]) / 2
    return found


def row(name, kind, found, truth, seconds):
    volume = f"{found['volume_cm3']:.0f} of {1e6 * truth['total_volume_m3']:.0f}"
    percent = lambda key: f"{found[key]:.2f}" if key in found else ""
    wide = "{:.0f} of {:.0f}".format(*found["widest_hole_mm"][::-1]) if found["widest_hole_mm"][0] else "none"
    left = "" if found["hole_left_open"] is None else f"{100 * found['hole_left_open']:.0f}"
    return (f"| {name} | {kind} | {found['pieces']} | {seconds:.1f} | {percent('distance')} | {percent('to_pieces')} | "
            f"{percent('to_truth')} | {volume} | {100 * found['silhouette_iou']:.1f} | {left} | {wide} |")


def child_seconds():
    return resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scenes", nargs="+", metavar="SCENE[=WORK]", help="scene, and its work folder if it is not SCENE/gprop")
    parser.add_argument("--depths", metavar="DIR", help="folder with SCENE/ground_truth that has depth maps")
    parser.add_argument("--coacd", action="store_true", help="measure CoACD's pieces too")
    parser.add_argument("--gprop", metavar="PROGRAM", default="gprop")
    options = parser.parse_args()
    print("| object | by | pieces | CPU s | distance, % | to pieces | to truth | volume, cm3 | silhouette IoU, % | "
          "holes left open, % | widest hole, mm |")
    print("| --- " * 11 + "|")
    for scene in options.scenes:
        folder, _, work = scene.partition("=")
        name = os.path.basename(os.path.normpath(folder))
        with open(os.path.join(folder, "ground_truth", "parts.json")) as file:
            truth = json.load(file)
        depths = os.path.join(options.depths, name, "ground_truth") if options.depths else os.path.join(folder, "ground_truth")
        with tempfile.TemporaryDirectory() as out:
            before = child_seconds()
            done = subprocess.run([options.gprop, "export", folder, "--work", work or os.path.join(folder, "gprop"), "--format",
                                   "mjcf", "--out", out], capture_output=True, text=True)
            if done.returncode != 0:
                sys.exit(done.stderr.strip())
            seconds = child_seconds() - before
            pieces = [trimesh.load(path, force="mesh") for path in sorted(glob.glob(os.path.join(out, "meshes", "*__*_[0-9]*.obj")))]
            [skin] = glob.glob(os.path.join(out, "meshes", "*_skin.obj"))
            skin = trimesh.load(skin, force="mesh", process=False)
        pieces = [piece.convex_hull for piece in pieces]
        print(row(name, "gprop", measure(folder, truth, depths, pieces), truth, seconds), flush=True)
        if options.coacd:
            import coacd

            coacd.set_log_level("error")
            skin = trimesh.Trimesh(skin.vertices, skin.faces)
            skin.merge_vertices()
            started = time.process_time()
            parts = coacd.run_coacd(coacd.Mesh(skin.vertices, skin.faces))
            seconds = time.process_time() - started
            pieces = [trimesh.Trimesh(vertices, faces).convex_hull for vertices, faces in parts]
            print(row(name, "CoACD", measure(folder, truth, depths, pieces), truth, seconds), flush=True)


if __name__ == "__main__":
    main()
