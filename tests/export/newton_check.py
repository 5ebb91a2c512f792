"""Imports a USD asset into Newton and prints what was imported, as JSON."""

import json
import sys

import newton
import warp as wp
from pxr import Usd

wp.config.quiet = True
builder = newton.ModelBuilder()
builder.add_usd(Usd.Stage.Open(sys.argv[1]))
kinds = [int(kind) for kind in builder.shape_type]
print(json.dumps({
    "bodies": builder.body_count,
    "mass_kg": float(builder.body_mass[0]),
    "center_of_mass_m": [float(c) for c in builder.body_com[0]],
    "gaussians": sum(kind == int(newton.GeoType.GAUSSIAN) for kind in kinds),
    "colliders": sum(kind == int(newton.GeoType.CONVEX_MESH) for kind in kinds),
    "shapes": len(kinds),
}))
