"""Imports a USD asset into Newton, drops it from 2 cm on a plane, and prints what was imported and where it rests, as JSON."""

import json
import sys

import newton
import numpy as np
import warp as wp
from pxr import Usd

wp.config.quiet = True
stage = Usd.Stage.Open(sys.argv[1])
builder = newton.ModelBuilder()
imported = builder.add_usd(stage)
kinds = [int(kind) for kind in builder.shape_type]
bodies = builder.body_count
mass = float(builder.body_mass[0])
center = [float(c) for c in builder.body_com[0]]
lowest = float(sys.argv[2])
builder.body_q[0] = wp.transform(wp.vec3(0.0, 0.0, 0.02 - lowest), wp.quat_identity())
if builder.joint_count:
    builder.joint_q[:7] = [0.0, 0.0, 0.02 - lowest, 0.0, 0.0, 0.0, 1.0]
builder.add_ground_plane()
model = builder.finalize(device="cpu")
solver = newton.solvers.SolverMuJoCo(model, njmax=2000, nconmax=1000)
first, second, control = model.state(), model.state(), model.control()
newton.eval_fk(model, model.joint_q, model.joint_qd, first)
heights, step = [], 0.002
for _ in range(1000):
    first.clear_forces()
    contacts = model.collide(first) if not getattr(solver, "use_mujoco_contacts", True) else None
    solver.step(first, second, control, contacts, step)
    first, second = second, first
    heights.append(first.body_q.numpy()[0])
last = np.array(heights[-250:])
print(json.dumps({
    "bodies": bodies,
    "mass_kg": mass,
    "center_of_mass_m": center,
    "gaussians": sum(kind == int(newton.GeoType.GAUSSIAN) for kind in kinds),
    "shapes": len(kinds),
    "moved_in_last_half_second_m": float(np.linalg.norm(np.ptp(last[:, :3], axis=0))),
    "speed_m_s": float(np.linalg.norm(first.body_qd.numpy()[0][:3])),
    "z_m": float(last[-1, 2]),
    "finite": bool(np.isfinite(last).all()),
}))
