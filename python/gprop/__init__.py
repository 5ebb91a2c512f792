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
    #: A row for each part, in the order of ``field["part_label"]``: id, caption, material, its properties and its mass.
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

    Raises FileNotFoundError if the run did not get as far as the vote, and ValueError if a file is damaged.
    """
    folder = Path(work)
    if not (folder / "field.ply").is_file():
        inside = folder / "gprop"
        hint = f"; did you mean {str(inside)!r}?" if (inside / "field.ply").is_file() else ""
        raise FileNotFoundError(f"{str(folder)!r} has no field.ply, so it is not the work folder of a finished run{hint}")
    labels = _json(folder / "labels.json")
    measured = _json_if_there(folder / "parts.json")
    grasp = _json_if_there(folder / "grasp.json")
    # Without a metric scale there is no object.
    whole = (measured or {}).get("object") or {}
    field = _read_ply(folder / "field.ply")
    return Result(
        folder=folder,
        field=field,
        parts=_parts(labels, measured, field),
        mass_kg=_numbers(whole.get("mass_kg"), _ESTIMATE),
        estimated_scale=(measured or {}).get("estimated_scale"),
        grasps=_grasps(grasp),
        grasp=grasp,
    )


def _json(path: Path):
    try:
        return json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        raise ValueError(f"{str(path)!r} is damaged: {error}") from None


def _json_if_there(path: Path):
    return _json(path) if path.is_file() else None


def _parts(labels: list, measured: dict | None, field: np.ndarray) -> np.ndarray:
    by_id = {part["id"]: part for part in (measured or {"parts": []})["parts"]}
    columns = [
        ("id", _array([label["id"] for label in labels], np.int64)),
        ("caption", np.array([label["caption"] for label in labels], dtype=np.str_)),
        ("material", np.array([label["material"] for label in labels], dtype=np.str_)),
        ("family", np.array([label["family"] for label in labels], dtype=np.str_)),
        ("gaussians", np.bincount(field["part_label"].astype(np.int64), minlength=len(labels))),
    ]
    columns += [(name, _column(labels, name, shape)) for name, shape in _PROPERTIES.items()]
    parts = [by_id.get(label["id"], {}) for label in labels]
    columns += [(name, _column(parts, name, shape)) for name, shape in _MEASURES.items()]
    return _table(columns)


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
    count = next((int(line[2]) for line in lines if line[:2] == ["element", "vertex"]), None)
    names = [line[2] for line in lines if line[:2] == ["property", "float"] and len(line) == 3]
    whole = end and count is not None and ["format", "binary_little_endian", "1.0"] in lines
    if not whole or len(body) != 4 * len(names) * count:
        raise ValueError(f"{str(path)!r} is damaged: it is not a PLY as gprop writes it; run gprop again")
    return np.frombuffer(body, dtype=[(name, "<f4") for name in names], count=count)
