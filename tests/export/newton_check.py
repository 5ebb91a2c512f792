"""Imports a USD into Newton and prints what was imported, and how it moves, as JSON.

newton_check.py ASSET        dropped from 2 cm onto a plane, how it moves from 2 s to 4 s after the drop
newton_check.py SCENE table  of each body of a scene with its own support: mass, place, how far it is moved and turned 2 s later
"""

import json
import sys

import newton
import numpy as np
import warp as wp
from pxr import Usd

# As long as MuJoCo's in mujoco_check.py.
DROP_M, RESTS_S, END_S = 0.02, 2.0, 4.0
STEP_S = 0.002


def lowest(builder):
    """The least z of the colliders' vertices."""
    least = np.inf
    for kind, source, xform, scale in zip(builder.shape_type, builder.shape_source, builder.shape_transform, builder.shape_scale):
        if int(kind) != int(newton.GeoType.CONVEX_MESH):
            continue
        turn = np.array(wp.quat_to_matrix(wp.quat(*xform[3:]))).reshape(3, 3)
        vertices = np.asarray(source.vertices) * np.array(scale) @ turn.T + np.array(xform[:3])
        least = min(least, float(vertices[:, 2].min()))
    return least


def simulated(builder, seconds):
    """The poses of all bodies before each step."""
    model = builder.finalize(device="cpu")
    solver = newton.solvers.SolverXPBD(model, iterations=10)
    states = [model.state(), model.state()]
    newton.eval_fk(model, model.joint_q, model.joint_qd, states[0])
    control, pipeline = model.control(), newton.CollisionPipeline(model)
    contacts = pipeline.contacts()
    yield states[0].body_q.numpy().copy()
    for _ in range(round(seconds / STEP_S)):
        states[0].clear_forces()
        pipeline.collide(states[0], contacts)
        solver.step(states[0], states[1], control, contacts, STEP_S)
        states.reverse()
        yield states[0].body_q.numpy().copy()


def dropped(builder):
    """How far and how fast the body moves once it should rest."""
    builder.add_ground_plane(height=lowest(builder) - DROP_M)
    poses = [pose[0, :3] for pose in simulated(builder, END_S)]
    resting = poses[round(RESTS_S / STEP_S):]
    return {
        "fell_m": float(poses[0][2] - poses[-1][2]),
        "moved_m": float(np.linalg.norm(np.ptp(resting, axis=0))),
    }


def center(pose, com):
    """The centre of mass of a body in the world."""
    turn = np.array(wp.quat_to_matrix(wp.quat(*pose[3:].tolist()))).reshape(3, 3)
    return turn @ np.array(com) + pose[:3]


def table(builder):
    """How far each body is from where it was put."""
    *_, after = poses = list(simulated(builder, RESTS_S))
    before = poses[0]
    return [
        {
            "name": builder.body_label[n],
            "mass_kg": float(builder.body_mass[n]),
            "place_m": center(before[n], com).tolist(),
            "moved_m": float(np.linalg.norm(center(after[n], com) - center(before[n], com))),
            "turned_rad": float(2 * np.arccos(min(1.0, abs(before[n, 3:] @ after[n, 3:])))),
        }
        for n, com in enumerate(builder.body_com)
    ]


wp.config.quiet = True
# Nothing is differentiated, and half of the kernels need not be compiled.
wp.config.enable_backward = False
builder = newton.ModelBuilder()
builder.add_usd(Usd.Stage.Open(sys.argv[1]))
kinds = [int(kind) for kind in builder.shape_type]
imported = {
    "bodies": builder.body_count,
    "mass_kg": float(builder.body_mass[0]),
    "center_of_mass_m": [float(c) for c in builder.body_com[0]],
    "gaussians": sum(kind == int(newton.GeoType.GAUSSIAN) for kind in kinds),
    "colliders": sum(kind == int(newton.GeoType.CONVEX_MESH) for kind in kinds),
    "shapes": len(kinds),
}
moves = {"table": table(builder)} if sys.argv[2:] == ["table"] else dropped(builder)
print(json.dumps(imported | moves))
