"""Opens USD files that refer to others, runs every validator that usd-core has, and prints what is in them as JSON."""

import json
import sys

from pxr import Usd, UsdGeom, UsdPhysics, UsdValidation


def check(path):
    stage = Usd.Stage.Open(path)
    registry = UsdValidation.ValidationRegistry()
    context = UsdValidation.ValidationContext(registry.GetOrLoadAllValidators())
    errors = [f"{error.GetName()}: {error.GetMessage()}" for error in context.Validate(stage)]
    root = stage.GetDefaultPrim()
    prims = list(stage.Traverse())
    textures = [prim.GetAttribute("inputs:file").Get() for prim in prims if prim.GetName() == "picture"]
    visible = {}
    for choice in root.GetVariantSet("appearance").GetVariantNames():
        root.GetVariantSet("appearance").SetVariantSelection(choice)
        drawn = [prim for prim in stage.Traverse() if prim.GetTypeName() in ("Mesh", "Plane", "ParticleField3DGaussianSplat")]
        shown = [prim for prim in drawn if UsdGeom.Imageable(prim).ComputeVisibility() != UsdGeom.Tokens.invisible]
        visible[choice] = sorted({prim.GetName() for prim in shown if UsdGeom.Imageable(prim).ComputePurpose() == "default"})
    splats = [prim for prim in stage.Traverse() if prim.GetTypeName() == "ParticleField3DGaussianSplat"]
    support = root.GetChild("support")
    return {
        "errors": errors,
        "bodies": [prim.GetName() for prim in prims if prim.HasAPI(UsdPhysics.RigidBodyAPI)],
        "support": support.HasAPI(UsdPhysics.CollisionAPI) and not support.HasAPI(UsdPhysics.RigidBodyAPI),
        "gravity": [prim.GetName() for prim in prims if prim.IsA(UsdPhysics.Scene)],
        "textures": bool(textures) and all(texture.resolvedPath for texture in textures),
        "gaussians": [len(prim.GetAttribute("positions").Get()) for prim in splats],
        "visible": visible,
    }


print(json.dumps([check(path) for path in sys.argv[1:]]))
