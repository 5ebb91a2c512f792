"""NumPy arrays of what gprop found out about a scene.

``gprop.load("scene/gprop")`` reads the work folder of a finished run. Nothing is computed here: the program ``gprop``,
which the same wheel installs, does that.

Units are SI: m, kg, s, Pa, N. Positions of the Gaussians are in the scene's own units, all others in metres in the world
frame. An estimate has three numbers, low, mid and high, along its last axis; what is unknown is NaN.
"""

import hashlib
import importlib.metadata
import json
import math
import stat
from dataclasses import dataclass
from pathlib import Path

import numpy as np

__all__ = ["Result", "load"]

_ESTIMATE = (3,)
_VECTOR = (3,)

# As in the program: the format of its files, how deep JSON may be nested, and how long the header of a PLY may be.
_FORMAT_VERSION = 10
_DEEPEST_JSON = 127
_LONGEST_HEADER = 1 << 20

# Columns of `Result.parts`: those of labels.json, then those of parts.json.
_PROPERTIES = {
    "density_kg_m3": _ESTIMATE,
    "youngs_modulus_pa": _ESTIMATE,
    "poisson_ratio": _ESTIMATE,
    "yield_strength_pa": _ESTIMATE,
    "friction_rubber": _ESTIMATE,
}
_MEASURES = {
    "volume_m3": _ESTIMATE,
    "thickness_m": _ESTIMATE,
    "mass_kg": _ESTIMATE,
    "center_of_mass_m": _VECTOR,
    "inertia_kg_m2": (3, 3),
}
# Columns of `Result.grasps`.
_GRASP = {
    "contacts_m": (2, 3),
    "approach": _VECTOR,
    "position_m": _VECTOR,
    "quaternion_wxyz": (4,),
    "width_m": (),
    "thickness_m": _ESTIMATE,
    "lever_m": (),
    "f_min_n": (),
    "f_max_n": (),
    "f_star_n": (),
    "torque_margin_n_m": (),
}


@dataclass(frozen=True)
class Result:
    """What a run found out about its scene."""

    folder: Path
    #: A row for each Gaussian, with a column for each property in field.ply: x, y, z, opacity, part_label, density, E, ...
    field: np.ndarray
    #: A row for each part: id (its ``field["part_label"]``), caption, material, its properties and its mass.
    parts: np.ndarray
    #: The mass of the whole object, low, mid and high, in kg; NaN if the metric scale is unknown.
    mass_kg: np.ndarray
    #: The source of the metric scale if a model estimated it, so that all kilograms and newtons are no better than that; or None.
    estimated_scale: str | None
    #: A row for each place to grasp at, best first. Empty if there is none, or if the run did not get that far.
    grasps: np.ndarray
    #: The content of grasp.json: the forces at the best place, what limits them, and the gripper's command; or None.
    grasp: dict | None

    @property
    def positions(self) -> np.ndarray:
        """The centres of the Gaussians, in scene units, as an array of shape (Gaussians, 3)."""
        return np.stack([self.field[axis] for axis in "xyz"], axis=-1)

    @property
    def masses_kg(self) -> np.ndarray:
        """The mass of each part, as an array of shape (parts, 3): low, mid, high."""
        return self.parts["mass_kg"]

    def part(self, name: str) -> np.void:
        """The part whose caption or material contains `name`, ignoring case.

        Raises KeyError if there is no such part, or more than one.
        """
        words = [f"{row['caption']} {row['material']}".lower() for row in self.parts]
        found = [row for row, text in zip(self.parts, words) if name.lower() in text]
        if len(found) != 1:
            captions = "; ".join(row["caption"] for row in (found or self.parts))
            raise KeyError(f"{len(found)} parts are called {name!r}: {captions}")
        return found[0]


def load(work: str | Path) -> Result:
    """Reads the work folder of a run: ``scene/gprop``, or what ``--out`` named.

    Results of a stage that no longer hold, because an earlier stage was done again, are left out. Raises FileNotFoundError if
    the run did not get as far as the vote, and ValueError if a file is damaged, is not a regular file, or has changed since gprop wrote
    it, or if another version of gprop wrote it.
    """
    folder = Path(work)
    if not (folder / "field.ply").exists():
        inside = folder / "gprop"
        hint = f"; did you mean {str(inside)!r}?" if (inside / "field.ply").is_file() else ""
        raise FileNotFoundError(f"{str(folder)!r} has no field.ply, so it is not the work folder of a finished run{hint}")
    if not (folder / "run.json").exists():
        raise FileNotFoundError(f"{str(folder)!r} has no run.json, which says which results belong together; copy it too")
    current = _current_stages(folder / "run.json")
    if "vote" not in current:
        raise FileNotFoundError(f"{str(folder)!r} is not finished: the vote stage is not done; run gprop again")
    labels = _json(*_written(folder, "labels.json", current["vote"]))
    measured = _json(*_written(folder, "parts.json", current["parts"])) if "parts" in current else None
    grasp = _json(*_written(folder, "grasp.json", current["grasp"])) if "grasp" in current else None
    field = _ply(*_written(folder, "field.ply", current["vote"]))
    try:
        # Without a metric scale there is no object.
        whole = (measured or {}).get("object") or {}
        return Result(
            folder=folder,
            field=field,
            parts=_parts(labels, measured, field),
            mass_kg=_numbers(whole.get("mass_kg"), _ESTIMATE),
            estimated_scale=(measured or {}).get("estimated_scale"),
            grasps=_grasps(grasp),
            grasp=grasp,
        )
    except (AttributeError, KeyError, OverflowError, TypeError, ValueError) as error:
        problem = f"labels.json, parts.json, grasp.json and field.ply are not what gprop wrote: {error!r}; run gprop again"
        raise ValueError(f"{str(folder)!r} is damaged: {problem}") from None


def _read(path: Path, length: int | None = None) -> bytes:
    """The content of a regular file, of `length` bytes if that is known: reading a pipe would wait, and a device may never end."""
    found = path.stat()
    if not stat.S_ISREG(found.st_mode):
        kinds = [(stat.S_ISDIR, "a folder"), (stat.S_ISFIFO, "a named pipe"), (stat.S_ISSOCK, "a socket")]
        kind = next((name for is_kind, name in kinds if is_kind(found.st_mode)), "a device")
        raise ValueError(f"cannot read {str(path)!r}: it is {kind}, not a regular file")
    return path.read_bytes() if length in (None, found.st_size) else b""


def _written(folder: Path, name: str, files: dict) -> tuple:
    """The path and the content of a file, which must be as the stage that lists it in `files` wrote it."""
    path = folder / name
    if name not in files or not path.exists():
        raise ValueError(f"{str(path)!r} is missing, or run.json does not list it; run gprop again")
    length, digest = files[name]
    content = _read(path, length)
    if hashlib.sha256(content).hexdigest() != digest:
        raise ValueError(f"{str(path)!r} has changed since gprop wrote it; run gprop again")
    return path, content


def _json(path: Path, content: bytes):
    """The value of JSON as the program reads it: without NaN, infinity, repeated keys, or nesting without end."""
    try:
        text = content.decode("utf-8")
        value = json.loads(text, parse_constant=_finite, parse_float=_finite, object_pairs_hook=_object)
        level, depth = [value], 0
        while containers := [inner for inner in level if isinstance(inner, (dict, list))]:
            level = [inner for outer in containers for inner in (outer.values() if isinstance(outer, dict) else outer)]
            depth += 1
        if depth > _DEEPEST_JSON:
            raise RecursionError
        return value
    except RecursionError:
        raise ValueError(f"{str(path)!r} is damaged: it is nested more than {_DEEPEST_JSON} deep") from None
    except ValueError as error:
        raise ValueError(f"{str(path)!r} is damaged: {error}") from None


def _finite(text: str) -> float:
    number = float(text)
    if not math.isfinite(number):
        raise ValueError(f"the number {text[:40]} is out of range")
    return number


def _object(pairs: list) -> dict:
    value = dict(pairs)
    if len(value) != len(pairs):
        raise ValueError("an object has a key twice")
    return value


def _current_stages(path: Path) -> dict:
    """The stages that were done after all those that they read from, each with the length and SHA-256 of its files."""
    digests, files = {}, {}
    record = _json(path, _read(path))
    try:
        writer, reader = record["version"], _version()
        # In the order of the data flow.
        for stage in record["stages"]:
            if all(digests.get(name) == digest for name, digest in stage["inputs"]):
                digests[stage["name"]] = stage["digest"]
                files[stage["name"]] = {file["path"]: (file["bytes"], file["sha256"]) for file in stage["outputs"]}
    except (KeyError, TypeError, ValueError) as error:
        raise ValueError(f"{str(path)!r} is damaged: {error!r}; run gprop again") from None
    if reader not in (None, writer):
        raise ValueError(f"{str(path)!r} was made by gprop {writer!r}, but this is {reader!r}; run gprop again")
    return files


def _version() -> str | None:
    """The wheel's version as run.json writes it; None if this module was not installed by a wheel."""
    try:
        return f"{importlib.metadata.version('gprop')}+format.{_FORMAT_VERSION}"
    except importlib.metadata.PackageNotFoundError:
        return None


def _parts(labels: list, measured: dict | None, field: np.ndarray) -> np.ndarray:
    bodies = {}
    for part in (measured or {"parts": []})["parts"]:
        bodies.setdefault(part["id"], []).append(part)
    ids = _column_of(int, labels, "id")
    if (np.diff(ids, prepend=0) <= 0).any():
        raise ValueError("the labels in labels.json are not numbered in order, from 1 on")
    if not np.isin(field["part_label"], ids).all():
        raise ValueError("field.ply has a part that labels.json does not list")
    columns = [
        ("id", ids),
        *((name, _column_of(str, labels, name)) for name in ("caption", "material", "family")),
        ("gaussians", np.bincount(np.searchsorted(ids, field["part_label"]), minlength=len(labels))),
    ]
    columns += [(name, _column(labels, name, shape)) for name, shape in _PROPERTIES.items()]
    parts = [_combined(bodies.get(label["id"], [{}])) for label in labels]
    columns += [(name, _column(parts, name, shape)) for name, shape in _MEASURES.items()]
    return _table(columns)


def _combined(bodies: list) -> dict:
    """The part that consists of these bodies, each written as a part (`--bodies parts`)."""
    if len(bodies) == 1:
        return bodies[0]
    whole = dict(bodies[0])
    for name in ("volume_m3", "mass_kg"):
        known = [body[name] for body in bodies if body[name] is not None]
        whole[name] = {key: sum(value[key] for value in known) for key in ("low", "mid", "high")} if known else None
    whole["center_of_mass_m"], whole["inertia_kg_m2"] = _moments(bodies)
    return whole


def _moments(bodies: list) -> tuple:
    """The centre of mass of several bodies, and their inertia about it; None twice if one of them has no mass."""
    if any(body[name] is None for body in bodies for name in ("mass_kg", "center_of_mass_m", "inertia_kg_m2")):
        return None, None
    masses = np.array([body["mass_kg"]["mid"] for body in bodies])
    centers = np.array([body["center_of_mass_m"] for body in bodies])
    center = masses @ centers / masses.sum()
    inertia = np.sum([body["inertia_kg_m2"] for body in bodies], axis=0)
    # By the parallel axis theorem.
    for mass, offset in zip(masses, centers - center):
        inertia = inertia + mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    return center, inertia


def _grasps(grasp: dict | None) -> np.ndarray:
    places = grasp["candidates"] if grasp else []
    columns = [
        ("part_id", _column_of(int, places, "part_id")),
        ("part", _column_of(str, places, "part")),
        ("feasible", _column_of(bool, places, "feasible")),
    ]
    return _table(columns + [(name, _column(places, name, shape)) for name, shape in _GRASP.items()])


def _column_of(kind: type, rows: list, name: str) -> np.ndarray:
    """The values called `name` of JSON objects, all of one type. Texts are Python objects: in a column of NumPy's own strings, each would
    take as much memory as the longest."""
    values = [row[name] for row in rows]
    for value in values:
        if type(value) is not kind:
            raise TypeError(f"{name} is {type(value).__name__}, not {kind.__name__}")
        if kind is str:
            value.encode()  # fails for half a surrogate pair
    return np.array(values, dtype={int: np.int64, str: object, bool: np.bool_}[kind])


def _column(rows: list, name: str, shape: tuple) -> np.ndarray:
    """The values called `name` of JSON objects, one row each."""
    return np.array([_numbers(row.get(name), shape) for row in rows], dtype=np.float64).reshape(len(rows), *shape)


def _numbers(value, shape: tuple) -> np.ndarray:
    """A number, a list of numbers or an estimate; NaN if there is none."""
    if value is None:
        return np.full(shape, np.nan)
    if isinstance(value, dict):
        value = [value["low"], value["mid"], value["high"]]
    flat = np.array(value, dtype=object).reshape(-1)
    if not all(type(number) in (int, float) for number in flat):
        raise TypeError(f"{str(value)[:40]} is not made of numbers")
    return flat.astype(np.float64).reshape(shape)


def _table(columns: list) -> np.ndarray:
    """A structured array of columns of the same length."""
    dtype = [(name, column.dtype, column.shape[1:]) for name, column in columns]
    table = np.empty(len(columns[0][1]), dtype=dtype)
    for name, column in columns:
        table[name] = column
    return table


def _ply(path: Path, content: bytes) -> np.ndarray:
    """The vertices of a PLY as gprop writes it: binary, little endian, float32 properties only."""
    header, end, _ = content[:_LONGEST_HEADER].partition(b"end_header\n")
    lines = [line.split() for line in header.decode("ascii", "replace").splitlines()]
    counts = [line[2] for line in lines if line[:2] == ["element", "vertex"] and len(line) == 3]
    names = [line[2] for line in lines if line[:2] == ["property", "float"] and len(line) == 3]
    rows = [(name, "<f4") for name in names]
    body_at = len(header) + len(end)
    whole = end and ["format", "binary_little_endian", "1.0"] in lines and len(set(names)) == len(names)
    whole = whole and {"x", "y", "z", "part_label"} <= set(names)
    count, rest = divmod(len(content) - body_at, 4 * max(len(names), 1))
    if not whole or rest != 0 or counts != [str(count)]:
        raise ValueError(f"{str(path)!r} is damaged: it is not a PLY as gprop writes it; run gprop again")
    return np.frombuffer(content, dtype=rows, count=count, offset=body_at)
