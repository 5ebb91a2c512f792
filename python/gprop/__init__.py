"""Materials and physical properties for every Gaussian of a 3D Gaussian Splatting scene.

``gprop.run("scene", scale="metric")`` runs the program ``gprop``, which the same wheel installs, and returns a ``Result``;
``gprop.load("scene/gprop")`` reads the result of an earlier run. Nothing is computed in Python.

Units are SI: m, kg, s, Pa, N. Positions of the Gaussians are in the scene's own units, all others in metres in the world
frame. An estimate has three numbers, low, mid and high, along its last axis; what is unknown is NaN.
"""

from ._errors import AnswerError, BatchError, BugError, Error, ModelError, SceneError, SceneWarning, UsageError
from ._mesh import Mesh
from ._options import AuditOptions, ExportOptions, MaterialsOptions, RunOptions
from ._results import Result, load
from ._running import audit, call, export, materials, run, run_all

__all__ = [
    "AnswerError",
    "AuditOptions",
    "BatchError",
    "BugError",
    "Error",
    "ExportOptions",
    "MaterialsOptions",
    "Mesh",
    "ModelError",
    "Result",
    "RunOptions",
    "SceneError",
    "SceneWarning",
    "UsageError",
    "audit",
    "call",
    "export",
    "load",
    "materials",
    "run",
    "run_all",
]

for _name in __all__:
    # Messages and documentation name what users import.
    globals()[_name].__module__ = __name__
