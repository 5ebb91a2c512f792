"""The surfaces of the parts, read from the GLB that the program exports."""

import json
import struct
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _running
from ._options import ExportOptions

_COMPONENTS = {5121: np.uint8, 5123: np.uint16, 5125: np.uint32, 5126: np.float32}
_HEADER, _CHUNK_HEADER = 12, 8


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles around each part."""

    #: x, y and z in metres, z up, as an array of shape (vertices, 3).
    vertices: NDArray[np.float64]
    #: Indices of the vertices of each triangle, counter-clockwise seen from outside, as an array of shape (triangles, 3).
    triangles: NDArray[np.int64]
    #: The id of each triangle's part.
    parts: NDArray[np.int64]


def exported(work: Path) -> Mesh:
    """The mesh of the object in this work folder, which lies in its scene."""
    folder = work.resolve()
    options: ExportOptions = {"format": ["glb"]}
    if folder.parent.name == "objects":
        options["object"] = folder.name
        folder = folder.parent.parent
    if folder.name != "gprop":
        problem = "is not in its scene (SCENE/gprop), so the scene is unknown; use gprop.export(scene, out, work=..., format='glb')"
        raise ValueError(f"{str(work)!r} {problem}")
    with tempfile.TemporaryDirectory() as out:
        files = _running.export(folder.parent, out, **options)
        [file] = [file for file in files if file.suffix == ".glb" and not file.stem.endswith("_colliders")]
        return _read(file.read_bytes())


def _read(glb: bytes) -> Mesh:
    (length,) = struct.unpack_from("<I", glb, _HEADER)
    start = _HEADER + _CHUNK_HEADER
    gltf = json.loads(glb[start : start + length])
    binary = glb[start + length + _CHUNK_HEADER :]

    def values(index: int, columns: int) -> NDArray[Any]:
        accessor = gltf["accessors"][index]
        view = gltf["bufferViews"][accessor["bufferView"]]
        offset = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
        kind = _COMPONENTS[accessor["componentType"]]
        return np.frombuffer(binary, kind, accessor["count"] * columns, offset).reshape(-1, columns)

    vertices, triangles, parts = [np.empty((0, 3))], [np.empty((0, 3), np.int64)], [np.empty(0, np.int64)]
    count = 0
    for node in gltf["nodes"]:
        # A part's own coordinates have z up; the node above turns y up.
        if "mesh" not in node or "part" not in node.get("extras", {}):
            continue
        for primitive in gltf["meshes"][node["mesh"]]["primitives"]:
            vertices.append(values(primitive["attributes"]["POSITION"], 3).astype(np.float64))
            corners = values(primitive["indices"], 1).reshape(-1, 3).astype(np.int64)
            triangles.append(corners + count)
            parts.append(np.full(len(corners), node["extras"]["part"], np.int64))
            count += len(vertices[-1])
    return Mesh(np.concatenate(vertices), np.concatenate(triangles), np.concatenate(parts))
