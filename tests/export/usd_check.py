"""Opens a USD file, runs every validator that usd-core has, and prints its contents as JSON."""

import json
import sys

from pxr import Gf, Usd, UsdGeom, UsdPhysics, UsdValidation

stage = Usd.Stage.Open(sys.argv[1])
registry = UsdValidation.ValidationRegistry()
context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
errors = [f"{error.GetName()}: {error.GetMessage()}" for error in context.Validate(stage)]

root = stage.GetDefaultPrim()
mass = UsdPhysics.MassAPI(root)
turn = Gf.Matrix3d(Gf.Quatd(mass.GetPrincipalAxesAttr().Get()))
diagonal = Gf.Matrix3d(Gf.Vec3d(mass.GetDiagonalInertiaAttr().Get()))
# Gf's rows are the rotated axes.
inertia = turn.GetTranspose() * diagonal * turn
points = UsdGeom.Points(root.GetChild("Gaussians"))
colliders = root.GetChild("Colliders").GetChildren()
print(json.dumps({
    "errors": errors,
    "validators": len(registry.GetOrLoadAllValidators()),
    "meters_per_unit": UsdGeom.GetStageMetersPerUnit(stage),
    "up_axis": UsdGeom.GetStageUpAxis(stage),
    "rigid": root.HasAPI(UsdPhysics.RigidBodyAPI),
    "mass_kg": mass.GetMassAttr().Get(),
    "center_of_mass_m": list(mass.GetCenterOfMassAttr().Get()),
    "inertia_kg_m2": [list(inertia.GetRow(row)) for row in range(3)],
    "points": len(points.GetPointsAttr().Get()),
    "colliders": len(colliders),
    "bound": all(prim.GetRelationship("material:binding:physics").GetTargets() for prim in colliders),
}))
