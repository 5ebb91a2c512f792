"""Reading the work folder of a run into NumPy arrays. Nothing is computed here: the program does that."""

from __future__ import annotations

import base64
import hashlib
import importlib.metadata
import json
import math
import os
import stat
from dataclasses import dataclass
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ._options import FORMAT_VERSION

if TYPE_CHECKING:
    from ._mesh import Mesh

_Shape = tuple[int, ...]
#: Of each file of a stage, its length and SHA-256.
_Files = dict[str, tuple[int, str]]
_Columns = list[tuple[str, NDArray[Any]]]

_ESTIMATE = (3,)
_VECTOR = (3,)

# As in the program: how deep JSON may be nested, and how long the header of a PLY may be.
_DEEPEST_JSON = 127
_LONGEST_HEADER = 1 << 20

# Columns of `Result.parts`: those of labels.json, then those of parts.json.
_PROPERTIES: dict[str, _Shape] = {
    "density_kg_m3": _ESTIMATE,
    "youngs_modulus_pa": _ESTIMATE,
    "poisson_ratio": _ESTIMATE,
    "yield_strength_pa": _ESTIMATE,
    "friction_rubber": _ESTIMATE,
}
_MEASURES: dict[str, _Shape] = {
    "volume_m3": _ESTIMATE,
    "thickness_m": _ESTIMATE,
    "mass_kg": _ESTIMATE,
    "center_of_mass_m": _VECTOR,
    "inertia_kg_m2": (3, 3),
}
# Columns of `Result.grasps`.
_GRASP: dict[str, _Shape] = {
    "contacts_m": (2, 3),
    "approach": _VECTOR,
    "position_m": _VECTOR,
    "quaternion_wxyz": (4,),
    "width_m": (),
    "thickness_m": _ESTIMATE,
    "lever_m": (),
    "offset_m": (),
    "touched_share": (),
    "bend_rad": (),
    "force_n": (),
    "f_hold_n": (),
    "f_min_n": (),
    "f_max_n": (),
    "f_star_n": (),
    "torque_margin_n_m": (),
}


# A plot shows at most so many Gaussians, evenly chosen; more take matplotlib seconds.
_MOST_POINTS = 20_000


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """What a run found out about an object. A notebook shows it as a figure and a table."""

    #: The work folder.
    folder: Path
    #: A row for each Gaussian, with a column for each property in field.ply: x, y, z, opacity, part_label, density, E, ...
    field: NDArray[Any]
    #: A row for each part: id (its ``field["part_label"]``), caption, material, its properties and its mass.
    parts: NDArray[Any]
    #: The mass of the whole object, low, mid and high, in kg; NaN if the metric scale is unknown.
    mass_kg: NDArray[np.float64]
    #: Its volume, low, mid and high, in m3; NaN if the metric scale is unknown. So are the two below.
    volume_m3: NDArray[np.float64]
    #: Its centre of mass: x, y, z in metres in the world frame.
    center_of_mass_m: NDArray[np.float64]
    #: Its inertia about the centre of mass, along the axes of the world frame, as an array of shape (3, 3).
    inertia_kg_m2: NDArray[np.float64]
    #: The source of the metric scale if a model estimated it, so that all kilograms and newtons are no better than that; or None.
    estimated_scale: str | None
    #: A row for each place to grasp at, best first. Empty if there is none, or if the run did not get that far.
    grasps: NDArray[Any]
    #: The content of grasp.json: the forces at the best place, what limits them, and the gripper's command; or None.
    grasp: dict[str, Any] | None
    #: A PNG of photo, parts and materials in the view that shows most of the object; or None.
    figure: bytes | None

    def __repr__(self) -> str:
        return "\n".join(
            [
                f"{_one_line(self.folder)}: {len(self.parts)} parts, {len(self.field)} Gaussians",
                f"mass {_interval(self.mass_kg, 'kg')}; volume {_interval(1e3 * self.volume_m3, 'l')}",
                f"centre of mass {_vector(self.center_of_mass_m)} m; inertia {_vector(np.diag(self.inertia_kg_m2))} kg m2",
                _shortened("; ".join(f"{_name(part)} {_interval(part['mass_kg'], 'kg')}" for part in self._heaviest())),
                _shortened(self._grasp_in_words()),
            ]
        )

    def _repr_html_(self) -> str:
        figure = ""
        if self.figure is not None:
            picture = base64.b64encode(self.figure).decode()
            figure = f'<img src="data:image/png;base64,{picture}" alt="photo, parts and materials" style="max-width: 100%">'
        rows = [
            (str(part["id"]), _interval(part["mass_kg"], "kg"), part["material"], part["caption"]) for part in self._heaviest()
        ]
        rows.append(("", _interval(self.mass_kg, "kg"), "", "the whole object"))
        cells = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>" for row in rows)
        table = f"<table><tr><th></th><th>mass</th><th>material</th><th>part</th></tr>{cells}</table>"
        return f"{figure}{table}<p>{escape(self._grasp_in_words())}</p>"

    def _heaviest(self) -> NDArray[Any]:
        """The parts, the heaviest first."""
        return self.parts[np.argsort(-np.nan_to_num(self.masses_kg[:, 1]), kind="stable")]

    def _grasp_in_words(self) -> str:
        if self.grasp is None:
            return "no grasp was computed"
        if len(self.grasps) == 0:
            return "no place to grasp at was found"
        best = self.grasps[0]
        name = _one_line(best["part"].partition(",")[0])
        force, low, high = (_number(best[column]) for column in ("force_n", "f_min_n", "f_max_n"))
        no_force = "" if best["feasible"] else ", and no force is safe"
        return f"grasp: {force} N on {name}; slips below {low} N, damaged above {high} N{no_force}"

    @property
    def positions(self) -> NDArray[np.float32]:
        """The centres of the Gaussians, in scene units, as an array of shape (Gaussians, 3)."""
        return np.stack([self.field[axis] for axis in "xyz"], axis=-1)

    @property
    def masses_kg(self) -> NDArray[np.float64]:
        """The mass of each part, as an array of shape (parts, 3): low, mid, high."""
        masses: NDArray[np.float64] = self.parts["mass_kg"]
        return masses

    def part(self, name: str) -> Any:
        """The part whose caption or material contains `name`, ignoring case.

        Raises KeyError if there is no such part, or more than one.
        """
        words = [f"{row['caption']} {row['material']}".lower() for row in self.parts]
        found = [row for row, text in zip(self.parts, words) if name.lower() in text]
        if len(found) != 1:
            captions = "; ".join(row["caption"] for row in (found or self.parts))
            raise KeyError(f"{len(found)} parts are called {name!r}: {captions}")
        return found[0]

    def plot(self, axes: Any = None) -> Any:
        """Draws the Gaussians in the colours of their parts, into `axes` or a new figure, and returns the axes.

        Needs matplotlib. Positions are in scene units, in the splat's own frame.
        """
        try:
            import matplotlib.pyplot
        except ImportError:
            raise ImportError("Result.plot needs matplotlib; `pip install matplotlib` installs it") from None
        if axes is None:
            axes = matplotlib.pyplot.figure().add_subplot(projection="3d")
        shown = slice(None, None, max(1, math.ceil(len(self.field) / _MOST_POINTS)))
        positions, labels = self.positions[shown], self.field["part_label"][shown]
        for part in self.parts:
            x, y, z = positions[labels == part["id"]].T
            axes.scatter(x, y, z, s=1, label=_name(part))
        axes.set_aspect("equal")
        axes.locator_params(nbins=4)
        axes.set(xlabel="x", ylabel="y", zlabel="z")
        axes.legend(markerscale=6)
        return axes


    def mesh(self) -> Mesh:
        """The closed surface of each part, as `gprop export --format glb` writes it.

        The program makes it, with the options of the last run. Raises ValueError if the work folder does not lie in its scene, and
        an `Error` if there are no volumes because the metric scale is unknown.
        """
        from ._mesh import exported

        return exported(self.folder)


def load(work: str | os.PathLike[str]) -> Result:
    """Reads the work folder of a run: ``scene/gprop``, or what ``out`` named.

    Results of a stage that no longer hold, because an earlier stage was done again, are left out. Raises FileNotFoundError if
    the run did not get as far as the vote, and ValueError if a file is damaged, is not a regular file, or has changed since gprop wrote
    it, or if another version of gprop wrote it.
    """
    folder = Path(work)
    if not (folder / "field.ply").exists():
        others = [folder / "gprop", *sorted((folder / "objects").glob("*"))]
        inside = [repr(str(other)) for other in others if (other / "field.ply").is_file()]
        hint = f"; did you mean {' or '.join(inside)}?" if inside else ""
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
    figure = _written(folder, "figure.png", current["vote"])[1] if "figure.png" in current["vote"] else None
    try:
        # Without a metric scale there is no object.
        whole = (measured or {}).get("object") or {}
        return Result(
            folder=folder,
            field=field,
            parts=_parts(labels, measured, field),
            mass_kg=_numbers(whole.get("mass_kg"), _ESTIMATE),
            volume_m3=_numbers(whole.get("volume_m3"), _ESTIMATE),
            center_of_mass_m=_numbers(whole.get("center_of_mass_m"), _VECTOR),
            inertia_kg_m2=_numbers(whole.get("inertia_kg_m2"), (3, 3)),
            estimated_scale=(measured or {}).get("estimated_scale"),
            grasps=_grasps(grasp),
            grasp=grasp,
            figure=figure,
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


def _written(folder: Path, name: str, files: _Files) -> tuple[Path, bytes]:
    """The path and the content of a file, which must be as the stage that lists it in `files` wrote it."""
    path = folder / name
    if name not in files or not path.exists():
        raise ValueError(f"{str(path)!r} is missing, or run.json does not list it; run gprop again")
    length, digest = files[name]
    content = _read(path, length)
    if hashlib.sha256(content).hexdigest() != digest:
        raise ValueError(f"{str(path)!r} has changed since gprop wrote it; run gprop again")
    return path, content


def _json(path: Path, content: bytes) -> Any:
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


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    value = dict(pairs)
    if len(value) != len(pairs):
        raise ValueError("an object has a key twice")
    return value


def _current_stages(path: Path) -> dict[str, _Files]:
    """The stages that were done after all those that they read from, each with the length and SHA-256 of its files."""
    digests: dict[str, str] = {}
    files: dict[str, _Files] = {}
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
        return f"{importlib.metadata.version('gprop')}+format.{FORMAT_VERSION}"
    except importlib.metadata.PackageNotFoundError:
        return None


def _parts(labels: list[Any], measured: dict[str, Any] | None, field: NDArray[Any]) -> NDArray[Any]:
    bodies: dict[int, list[Any]] = {}
    for part in (measured or {"parts": []})["parts"]:
        bodies.setdefault(part["id"], []).append(part)
    ids = _column_of(int, labels, "id")
    if (np.diff(ids, prepend=0) <= 0).any():
        raise ValueError("the labels in labels.json are not numbered in order, from 1 on")
    if not np.isin(field["part_label"], ids).all():
        raise ValueError("field.ply has a part that labels.json does not list")
    columns: _Columns = [
        ("id", ids),
        *((name, _column_of(str, labels, name)) for name in ("caption", "material", "family")),
        ("gaussians", np.bincount(np.searchsorted(ids, field["part_label"]), minlength=len(labels))),
    ]
    columns += [(name, _column(labels, name, shape)) for name, shape in _PROPERTIES.items()]
    parts = [_combined(bodies.get(label["id"], [{}])) for label in labels]
    columns += [(name, _column(parts, name, shape)) for name, shape in _MEASURES.items()]
    return _table(columns)


def _combined(bodies: list[dict[str, Any]]) -> dict[str, Any]:
    """The part that consists of these bodies, each written as a part (`--bodies parts`)."""
    if len(bodies) == 1:
        return bodies[0]
    whole = dict(bodies[0])
    for name in ("volume_m3", "mass_kg"):
        known = [body[name] for body in bodies if body[name] is not None]
        whole[name] = {key: sum(value[key] for value in known) for key in ("low", "mid", "high")} if known else None
    whole["center_of_mass_m"], whole["inertia_kg_m2"] = _moments(bodies)
    return whole


def _moments(bodies: list[dict[str, Any]]) -> tuple[Any, Any]:
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


def _grasps(grasp: dict[str, Any] | None) -> NDArray[Any]:
    places = grasp["candidates"] if grasp else []
    columns: _Columns = [
        ("part_id", _column_of(int, places, "part_id")),
        ("part", _column_of(str, places, "part")),
        ("feasible", _column_of(bool, places, "feasible")),
    ]
    return _table(columns + [(name, _column(places, name, shape)) for name, shape in _GRASP.items()])


def _column_of(kind: type, rows: list[Any], name: str) -> NDArray[Any]:
    """The values called `name` of JSON objects, all of one type. Texts are Python objects: in a column of NumPy's own strings, each would
    take as much memory as the longest."""
    values = [row[name] for row in rows]
    for value in values:
        if type(value) is not kind:
            raise TypeError(f"{name} is {type(value).__name__}, not {kind.__name__}")
        if isinstance(value, str):
            value.encode()  # fails for half a surrogate pair
    dtypes: dict[type, type] = {int: np.int64, str: object, bool: np.bool_}
    return np.array(values, dtype=dtypes[kind])


def _column(rows: list[Any], name: str, shape: _Shape) -> NDArray[np.float64]:
    """The values called `name` of JSON objects, one row each."""
    return np.array([_numbers(row.get(name), shape) for row in rows], dtype=np.float64).reshape(len(rows), *shape)


def _numbers(value: Any, shape: _Shape) -> NDArray[np.float64]:
    """A number, a list of numbers or an estimate; NaN if there is none."""
    if value is None:
        return np.full(shape, np.nan)
    if isinstance(value, dict):
        value = [value["low"], value["mid"], value["high"]]
    flat = np.array(value, dtype=object).reshape(-1)
    if not all(type(number) in (int, float) for number in flat):
        raise TypeError(f"{str(value)[:40]} is not made of numbers")
    return flat.astype(np.float64).reshape(shape)


def _table(columns: _Columns) -> NDArray[Any]:
    """A structured array of columns of the same length."""
    dtype = [(name, column.dtype, column.shape[1:]) for name, column in columns]
    table = np.empty(len(columns[0][1]), dtype=dtype)
    for name, column in columns:
        table[name] = column
    return table


def _ply(path: Path, content: bytes) -> NDArray[Any]:
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


def _interval(estimate: Any, unit: str) -> str:
    if np.isnan(estimate).any():
        return "unknown"
    low, mid, high = estimate
    return f"{_number(mid)} {unit} ({_number(low)} to {_number(high)})"


def _number(value: float) -> str:
    """Three digits, or all before the point."""
    return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"


def _vector(values: Any) -> str:
    return "unknown" if np.isnan(values).any() else "(" + ", ".join(map(_number, values)) + ")"


def _name(part: Any) -> str:
    """The caption of a part up to its first comma, or else its material."""
    return _one_line(part["caption"].partition(",")[0] or part["material"])


def _one_line(text: Any) -> str:
    """A text from strangers as a terminal may show it."""
    return "".join(letter if letter.isprintable() else repr(letter)[1:-1] for letter in str(text))


def _shortened(text: str, length: int = 120) -> str:
    return text if len(text) <= length else text[: length - 3] + "..."
