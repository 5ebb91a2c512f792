"""Loads assets with deformable bodies and prints what was loaded as JSON, a list with one entry for each.

deformable_check.py mujoco MODEL...    the MJCF; also how it moves after it was put onto a plane
deformable_check.py newton ASSET...    the USD, as Newton imports it
"""

import json
import sys

import numpy as np

RESTS_S = 0.3


def volumes(points, elements):
    a, b, c, d = (points[elements[:, k]] for k in range(4))
    return np.einsum("ij,ij->i", np.cross(b - a, c - a), d - a) / 6


def on_mujoco(path):
    import mujoco

    spec = mujoco.MjSpec.from_file(path)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    lowest = data.flexvert_xpos[:, 2].min()
    for geom in range(model.ngeom):
        lowest = min(lowest, data.geom_xpos[geom, 2] - model.geom_rbound[geom])
    elements = model.flex_elem.reshape(-1, 4)
    start = data.flexvert_xpos.copy()
    found = {
        "mass_kg": float(model.body_mass.sum()),
        "elements": len(elements),
        "least_volume_m3": float(np.abs(volumes(start, elements)).min()),
        "rigid_bodies": int(np.sum(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)),
        "attached": int(np.sum(model.body_dofnum[model.flex_vertbodyid] != 3)),
        "nodes": int(model.nflexvert),
    }
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 1], pos=[0, 0, start[:, 2].min()])
    model = spec.compile()
    data = mujoco.MjData(model)
    while data.time < RESTS_S:
        mujoco.mj_step(model, data)
    speed = np.abs(data.qvel)
    edges = model.flex_edge
    length = lambda points: np.linalg.norm(points[edges[:, 0]] - points[edges[:, 1]], axis=1)
    stretched = np.abs(length(data.flexvert_xpos) / length(start) - 1)
    return found | {"speed_m_s": float(np.median(speed)), "stretched": float(stretched.max())}


def on_newton(path):
    import newton
    import warp as wp
    from pxr import Usd

    wp.config.quiet = True
    builder = newton.ModelBuilder()
    builder.add_usd(Usd.Stage.Open(path), return_deformable_results=True)
    points = np.array(builder.particle_q)
    elements = np.array(builder.tet_indices).reshape(-1, 4)
    return {
        "mass_kg": float(sum(builder.particle_mass) + sum(builder.body_mass)),
        "elements": len(elements),
        "least_volume_m3": float(volumes(points, elements).min()),
        "rigid_bodies": builder.body_count,
        "attached": len(builder.attachment_particle_body_particle) if hasattr(builder, "attachment_particle_body_particle") else -1,
        "nodes": len(points),
    }


if __name__ == "__main__":
    simulator, *paths = sys.argv[1:]
    check = {"mujoco": on_mujoco, "newton": on_newton}[simulator]
    print(json.dumps([check(path) for path in paths]))
