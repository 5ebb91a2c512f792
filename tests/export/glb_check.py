"""Loads GLBs with trimesh and prints, for each and each of its meshes, whether it is closed, its volume and its node's
extras, as JSON."""

import json
import sys

import trimesh


def check(path):
    scene = trimesh.load(path, force="scene")
    found = {}
    for node in scene.graph.nodes_geometry:
        turn, name = scene.graph[node]
        mesh = scene.geometry[name].copy()
        mesh.apply_transform(turn)
        parent = scene.graph.transforms.parents.get(node)
        extras = scene.graph.transforms.edge_data[(parent, node)].get("metadata", {})
        found[node] = {
            "closed": bool(mesh.is_watertight and mesh.is_winding_consistent),
            "volume_m3": float(mesh.volume),
            "bounds_m": mesh.bounds.tolist(),
            "parent": parent,
            "extras": {key: value for key, value in extras.items() if isinstance(value, (int, float, str))},
        }
    return found


print(json.dumps([check(path) for path in sys.argv[1:]]))
