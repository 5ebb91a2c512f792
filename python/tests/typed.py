"""Never run: a type checker must accept these calls, and refuse those with a comment, in strict mode."""

from pathlib import Path
from typing import Any, assert_type

import gprop
import numpy as np
from numpy.typing import NDArray

result = gprop.run("scene", scale="metric", to="grasp", progress=print)
assert_type(result, gprop.Result)
assert_type(result.mass_kg, NDArray[np.float64])
assert_type(gprop.run_all(Path("table"), no_simulate=True, from_="vote"), dict[str, gprop.Result])
assert_type(gprop.export("scene", "out", format=["mjcf", "usda"], known_mass=0.3, frames=3), list[Path])
assert_type(gprop.audit("robot.urdf", Path("assets"), ignore=["density", "center"], fix=True), dict[str, Any])
assert_type(gprop.materials(family="wood"), list[dict[str, Any]])
options: gprop.RunOptions = {"view_list": ["000", "004"], "crop_to_foreground": False, "materials": Path("own.csv")}
gprop.run("scene", **options)
try:
    gprop.call("evaluate mass", "scene", weights="weights.csv")
except gprop.UsageError as error:
    assert_type(error.exit_code, int)

gprop.run("scene", to="lunch")  # type: ignore[arg-type]
gprop.run("scene", scael="metric")  # type: ignore[call-arg]
gprop.run("scene", frames="many")  # type: ignore[arg-type]
gprop.run()  # type: ignore[call-arg]
gprop.export("scene", "out", format="docx")  # type: ignore[arg-type]
