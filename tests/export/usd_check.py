"""Opens a USD file, runs every validator that usd-core has, and prints its contents as JSON."""

import json
import sys

import numpy as np
from pxr import Gf, Usd, UsdGeom, UsdPhysics, UsdShade, UsdValidation


def check(path):
    stage = Usd.Stage.Open(path)
    registry = UsdValidation.ValidationRegistry()
    context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
    errors = [f"{error.GetName()}: {error.GetMessage()}" for error in context.Validate(stage)]
    for prim in stage.Traverse():
        # SimReady compares them to the last bit. USD computes none for the Gaussians.
        boundable = UsdGeom.Boundable(prim)
        computed = UsdGeom.Boundable.ComputeExtentFromPlugins(boundable, Usd.TimeCode.Default()) if boundable else None
        if computed is not None and computed != boundable.GetExtentAttr().Get():
            errors.append(f"{prim.GetPath()}: the extent is {computed}")

    root = stage.GetDefaultPrim()
    mass = UsdPhysics.MassAPI(root)
    turn = Gf.Matrix3d(Gf.Quatd(mass.GetPrincipalAxesAttr().Get()))
    diagonal = Gf.Matrix3d(Gf.Vec3d(mass.GetDiagonalInertiaAttr().Get()))
    # Gf's rows are the rotated axes.
    inertia = turn.GetTranspose() * diagonal * turn
    splat = root.GetChild("splat")
    colliders = root.GetChild("colliders").GetChildren()
    skin = UsdGeom.Mesh(root.GetChild("skin"))
    triangles = np.array(skin.GetFaceVertexIndicesAttr().Get()).reshape(-1, 3)
    edges = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    subsets = [child for child in root.GetChild("skin").GetChildren() if child.IsA(UsdGeom.Subset)]
    material, _ = UsdShade.MaterialBindingAPI(subsets[0]).ComputeBoundMaterial()
    texture = material.GetPrim().GetChild("picture").GetAttribute("inputs:file").Get()
    visible = {}
    for choice in root.GetVariantSet("appearance").GetVariantNames():
        root.GetVariantSet("appearance").SetVariantSelection(choice)
        visible[choice] = [
            name for name in ("skin", "splat")
            if UsdGeom.Imageable(root.GetChild(name)).ComputeVisibility() != UsdGeom.Tokens.invisible
        ]
    grasps = root.GetChild("grasps")
    return {
        "errors": errors,
        "validators": len(registry.GetOrLoadAllValidators()),
        "meters_per_unit": UsdGeom.GetStageMetersPerUnit(stage),
        "up_axis": UsdGeom.GetStageUpAxis(stage),
        "rigid": root.HasAPI(UsdPhysics.RigidBodyAPI),
        "mass_kg": mass.GetMassAttr().Get(),
        "center_of_mass_m": list(mass.GetCenterOfMassAttr().Get()),
        "inertia_kg_m2": [list(inertia.GetRow(row)) for row in range(3)],
        "gaussians": len(splat.GetAttribute("positions").Get()),
        "harmonics": len(splat.GetAttribute("radiance:sphericalHarmonicsCoefficients").Get()),
        "kind": str(splat.GetTypeName()),
        "colliders": len(colliders),
        "bound": all(prim.GetRelationship("material:binding:physics").GetTargets() for prim in colliders),
        "skin_triangles": len(triangles),
        "skin_closed": bool((np.unique(edges, axis=0, return_counts=True)[1] == 2).all()),
        "subset_faces": sum(len(UsdGeom.Subset(subset).GetIndicesAttr().Get()) for subset in subsets),
        "texture": bool(texture.resolvedPath),
        "visible": visible,
        "grasps": [len(child.GetAttribute("points").Get()) for child in grasps.GetChildren()] if grasps else [],
    }


print(json.dumps([check(path) for path in sys.argv[1:]]))
