"""NumPy arrays of what gprop found out about a scene.

``gprop.load("scene/gprop")`` reads the work folder of a finished run. Nothing is computed here: the program ``gprop``,
which the same wheel installs, does that.

Units are SI: m, kg, s, Pa, N. Positions of the Gaussians are in the scene's own units, all others in metres in the world
frame. An estimate has three numbers, low, mid and high, along its last axis; what is unknown is NaN.
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

__all__ = ["Result", "load"]

_ESTIMATE = (3,)
_VECTOR = (3,)

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
    the run did not get as far as the vote, and ValueError if a file is damaged.
    """
    folder = Path(work)
    if not (folder / "field.ply").is_file():
        inside = folder / "gprop"
        hint = f"; did you mean {str(inside)!r}?" if (inside / "field.ply").is_file() else ""
        raise FileNotFoundError(f"{str(folder)!r} has no field.ply, so it is not the work folder of a finished run{hint}")
    if not (folder / "run.json").is_file():
        raise FileNotFoundError(f"{str(folder)!r} has no run.json, which says which results belong together; copy it too")
    current = _current_stages(folder / "run.json")
    if "vote" not in current:
        raise FileNotFoundError(f"{str(folder)!r} is not finished: the vote stage is not done; run gprop again")
    labels = _json(folder / "labels.json")
    measured = _json(folder / "parts.json") if "parts" in current else None
    grasp = _json(folder / "grasp.json") if "grasp" in current else None
    field = _read_ply(folder / "field.ply")
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


def _json(path: Path):
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{str(path)!r} is damaged: {error}") from None


def _current_stages(path: Path) -> dict:
    """The digests of the stages that were done after all those that they read from."""
    current = {}
    try:
        # In the order of the data flow.
        for stage in _json(path)["stages"]:
            if all(current.get(name) == digest for name, digest in stage["inputs"]):
                current[stage["name"]] = stage["digest"]
    except (KeyError, TypeError) as error:
        raise ValueError(f"{str(path)!r} is damaged: {error!r}; run gprop again") from None
    return current


def _parts(labels: list, measured: dict | None, field: np.ndarray) -> np.ndarray:
    bodies = {}
    for part in (measured or {"parts": []})["parts"]:
        bodies.setdefault(part["id"], []).append(part)
    ids = _array([label["id"] for label in labels], np.int64)
    part_of_gaussian = field["part_label"].astype(np.int64)
    if not np.isin(part_of_gaussian, ids).all():
        raise ValueError("field.ply has a part that labels.json does not list")
    columns = [
        ("id", ids),
        ("caption", np.array([label["caption"] for label in labels], dtype=np.str_)),
        ("material", np.array([label["material"] for label in labels], dtype=np.str_)),
        ("family", np.array([label["family"] for label in labels], dtype=np.str_)),
        ("gaussians", (part_of_gaussian == ids[:, None]).sum(axis=1)),
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
        ("part_id", _array([place["part_id"] for place in places], np.int64)),
        ("part", np.array([place["part"] for place in places], dtype=np.str_)),
        ("feasible", _array([place["feasible"] for place in places], np.bool_)),
    ]
    return _table(columns + [(name, _column(places, name, shape)) for name, shape in _GRASP.items()])


def _array(values: list, dtype) -> np.ndarray:
    return np.array(values, dtype=dtype)


def _column(rows: list, name: str, shape: tuple) -> np.ndarray:
    """The values called `name` of JSON objects, one row each."""
    return np.array([_numbers(row.get(name), shape) for row in rows], dtype=np.float64).reshape(len(rows), *shape)


def _numbers(value, shape: tuple) -> np.ndarray:
    """A number, a list of numbers or an estimate; NaN if there is none."""
    if value is None:
        return np.full(shape, np.nan)
    if isinstance(value, dict):
        value = [value["low"], value["mid"], value["high"]]
    return np.array(value, dtype=np.float64).reshape(shape)


def _table(columns: list) -> np.ndarray:
    """A structured array of columns of the same length."""
    dtype = [(name, column.dtype, column.shape[1:]) for name, column in columns]
    table = np.empty(len(columns[0][1]), dtype=dtype)
    for name, column in columns:
        table[name] = column
    return table


def _read_ply(path: Path) -> np.ndarray:
    """The vertices of a PLY as gprop writes it: binary, little endian, float32 properties only."""
    data = path.read_bytes()
    header, end, body = data.partition(b"end_header\n")
    lines = [line.split() for line in header.decode("ascii", "replace").splitlines()]
    counts = [line[2] for line in lines if line[:2] == ["element", "vertex"] and len(line) == 3]
    count = int(counts[0]) if counts and counts[0].isdecimal() else None
    names = [line[2] for line in lines if line[:2] == ["property", "float"] and len(line) == 3]
    whole = end and count is not None and ["format", "binary_little_endian", "1.0"] in lines
    if not whole or len(body) != 4 * len(names) * count:
        raise ValueError(f"{str(path)!r} is damaged: it is not a PLY as gprop writes it; run gprop again")
    return np.frombuffer(body, dtype=[(name, "<f4") for name in names], count=count)
