"""Compares how soft parts give in MuJoCo, Newton and gprop's own simulation, under a press and under their own weight.

compare_deformable.py mpm SIMULATION CASE [X]    the frames of `gprop simulate`: a folder WORK/simulation
compare_deformable.py mujoco NAME.xml CASE [X]   the MJCF of `gprop export --deformable`
compare_deformable.py newton NAME.usda CASE [X]  its USD

CASE is `press:N`, N newtons spread over the mass of the upper third, or `weight:G`, a gravity of G m/s2. The underside is held. X leaves out
what is at a greater |x|, in metres: the faces of a mallet that its handle bends. Printed is the mean strain along z of the sides between 0.2 and 0.6 of the height,
away from what is held or pressed: the slope of the displacements. Needs numpy; for the simulators also mujoco, or newton with usd-core.
"""

import glob
import os
import sys

import numpy as np

# Part of the height in which the strain is measured, and above which the press acts.
LOW, HIGH, PRESSED = 0.2, 0.6, 2 / 3
SETTLES_S = {"mujoco": 0.15, "newton": 0.03}


def strain(start, after, keep):
    """The slope of the vertical displacements of the points of the sides."""
    start, after = start[keep], after[keep]
    low, high = start[:, 2].min(), start[:, 2].max()
    height = (start[:, 2] - low) / (high - low)
    between = (height > LOW) & (height < HIGH)
    z, moved = start[between, 2], (after - start)[between, 2]
    z = z - z.mean()
    return float(z @ (moved - moved.mean()) / (z @ z))


def mean_of_last_half(values):
    half = values[len(values) // 2:]
    return np.mean(half), np.ptp(half)


def positions(path):
    """The positions in a PLY of float32."""
    with open(path, "rb") as file:
        data = file.read()
    head, body = data.split(b"end_header\n", 1)
    lines = head.decode().splitlines()
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    names = [line.split()[2] for line in lines if line.startswith("property")]
    rows = np.frombuffer(body, "<f4", count * len(names)).reshape(count, len(names))
    return rows[:, [names.index(axis) for axis in "xyz"]].astype(float)


def on_mpm(folder, _, most_x):
    frames = [positions(path) for path in sorted(glob.glob(os.path.join(folder, "frames", "*.ply")))]
    keep = np.abs(frames[0][:, 0]) < most_x
    return [strain(frames[0], frame, keep) for frame in frames[1:]]


def surface_nodes(elements):
    """The nodes of the faces that belong to one tetrahedron."""
    faces = np.sort(np.concatenate([np.delete(elements, k, axis=1) for k in range(4)]), axis=1)
    faces, count = np.unique(faces, axis=0, return_counts=True)
    return np.unique(faces[count == 1])


def held_and_pressed(start):
    low, high = start[:, 2].min(), start[:, 2].max()
    return start[:, 2] < low + 0.03 * (high - low), start[:, 2] > low + PRESSED * (high - low)


def on_mujoco(path, case, most_x):
    import mujoco

    spec = mujoco.MjSpec.from_file(path)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    start, bodies = data.flexvert_xpos.copy(), model.flex_vertbodyid
    held, pressed = held_and_pressed(start)
    gravity, newtons = case
    spec.option.gravity = [0, 0, -gravity]
    model = spec.compile()
    model.jnt_stiffness[np.isin(model.jnt_bodyid, bodies[held])] = 1e9
    data = mujoco.MjData(model)
    masses = model.body_mass[bodies[pressed]]
    data.xfrc_applied[bodies[pressed], 2] = -newtons * masses / masses.sum()
    keep = np.isin(np.arange(len(start)), surface_nodes(model.flex_elem.reshape(-1, 4))) & (np.abs(start[:, 0]) < most_x)
    strains = []
    while data.time < SETTLES_S["mujoco"]:
        mujoco.mj_step(model, data)
        strains.append(strain(start, data.flexvert_xpos, keep))
    return strains


def on_newton(path, case, most_x):
    import newton
    import warp as wp
    from pxr import Usd

    wp.config.quiet, wp.config.enable_backward = True, False
    gravity, newtons = case
    builder = newton.ModelBuilder()
    builder.add_usd(Usd.Stage.Open(path), load_visual_shapes=False)
    start = np.array(builder.particle_q)
    masses = np.array(builder.particle_mass)
    held, pressed = held_and_pressed(start)
    for particle in np.flatnonzero(held):
        builder.particle_mass[particle] = 0.0
    builder.color()
    model = builder.finalize(device="cpu")
    model.set_gravity((0.0, 0.0, -gravity))
    forces = np.zeros_like(start)
    forces[pressed, 2] = -newtons * masses[pressed] / masses[pressed].sum()
    forces = wp.array(forces.astype(np.float32), dtype=wp.vec3)
    solver = newton.solvers.SolverVBD(model, iterations=20, particle_enable_self_contact=False)
    states = [model.state(), model.state()]
    control, contacts = model.control(), None
    elements = np.array(builder.tet_indices).reshape(-1, 4)
    keep = np.isin(np.arange(len(start)), surface_nodes(elements)) & (np.abs(start[:, 0]) < most_x)
    strains = []
    for _ in range(round(SETTLES_S["newton"] / STEP_S)):
        states[0].clear_forces()
        states[0].particle_f.assign(forces)
        solver.step(states[0], states[1], control, contacts, STEP_S)
        states.reverse()
        strains.append(strain(start, states[0].particle_q.numpy().astype(float), keep))
    return strains


# Of Newton: with longer ones, the sweeps of SolverVBD do not converge, and what is stiff gives too much.
STEP_S = 1e-4

if __name__ == "__main__":
    what, path, case, *most_x = sys.argv[1:]
    kind, value = case.split(":")
    case = (float(value), 0.0) if kind == "weight" else (9.8, float(value))
    strains = {"mpm": on_mpm, "mujoco": on_mujoco, "newton": on_newton}[what](path, case, float(most_x[0]) if most_x else np.inf)
    mean, swing = mean_of_last_half(np.array(strains))
    print(f"{what} {os.path.basename(path)} {kind}:{value} strain {mean:.5f}, within {swing:.5f}")
