#!/usr/bin/env python3
"""Particle substeps per CPU second of gprop's solver and of its peers, one after the other in every round.

    benches/simulate_peers.py [--physgaussian DIR] [--rounds N]

All drop the same cube: 100,000 particles, eight per cell, on a grid of 128^3 over 2 m, in f32. gprop is measured by
`cargo bench --bench simulate`, on one thread, where wall time is at least the CPU time, and for the elastic cube also on two. Peers, on
one thread:
- Taichi: a dense MLS-MPM after its example mpm3d, with fixed corotated stress as in gprop; installed from PyPI;
- PhysGaussian's solver on warp, with each law, from the folder DIR: a checkout of its repository, whose licence does not allow
  shipping it here. warp-lang 0.10.1, for which it is written, is installed from PyPI.

Measured on two cores of an AMD EPYC, two rounds, in million particle substeps per CPU second: gprop 21.3 elastic (38.5 on two
threads, 1.81 times as many per second of wall time), 13.5 von Mises, 13.3 plasticine, 13.1 sand; Taichi 1.01. In place of PhysGaussian's
own code, a solver written in warp from a description of it, which takes the same steps bit for bit: 0.80 elastic, 0.60 the others. So gprop
is 21 times as fast as Taichi, and 27 times (elastic) or 22 times (others) as fast as PhysGaussian's solver.
"""

import argparse
import json
import os
import re
import statistics
import subprocess
import sys
import sysconfig
import time
import venv
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
PACKAGES = ["numpy<2", "taichi==1.7.4", "warp-lang==0.10.1", "h5py"]
COUNT, CELLS, SIDE_M = 100_000, 128, 2.0
YOUNGS_MODULUS_PA, POISSON_RATIO, DENSITY_KG_M3 = 1e5, 0.3, 1000.0
GRAVITY_M_S2, GROUND_M = 9.8, 0.5
# The step of benches/simulate.rs: 0.3 cells at the speed of the pressure wave.
DT_S = 0.3 * SIDE_M / CELLS / 11.6
STEPS = 20
# gprop's name of a law, and the peer's with its parameters as in benches/simulate.rs.
LAWS = {
    "elastic": {"material": "jelly"},
    "von_mises": {"material": "metal", "yield_stress": 1e3},
    "plasticine": {"material": "plasticine", "yield_stress": 1e3, "softening": 0.1},
    "sand": {"material": "sand", "friction_angle": 30.0},
}


def cube():
    """Positions (n, 3) m and the volume of one particle, m^3."""
    import numpy as np

    side, step = round(COUNT ** (1 / 3)), SIDE_M / CELLS / 2
    along = 1.0 + (np.arange(side) + 0.5 - side / 2) * step
    return np.stack(np.meshgrid(along, along, along, indexing="ij"), -1).reshape(-1, 3).astype(np.float32), step**3


def rate(count, step):
    """Particle substeps per CPU second; `step()` takes one substep. The first call is not counted because it compiles."""
    step()
    start = time.process_time()
    for _ in range(STEPS):
        step()
    return count * STEPS / (time.process_time() - start)


def taichi_rate():
    import numpy as np
    import taichi as ti

    ti.init(arch=ti.cpu, cpu_max_num_threads=1, log_level=ti.ERROR, random_seed=1)
    positions, volume = cube()
    count, dx = len(positions), SIDE_M / CELLS
    mass = DENSITY_KG_M3 * volume
    mu = YOUNGS_MODULUS_PA / (2 * (1 + POISSON_RATIO))
    lam = YOUNGS_MODULUS_PA * POISSON_RATIO / ((1 + POISSON_RATIO) * (1 - 2 * POISSON_RATIO))
    x, v = ti.Vector.field(3, ti.f32, count), ti.Vector.field(3, ti.f32, count)
    affine, deformation = ti.Matrix.field(3, 3, ti.f32, count), ti.Matrix.field(3, 3, ti.f32, count)
    grid_v, grid_m = ti.Vector.field(3, ti.f32, (CELLS,) * 3), ti.field(ti.f32, (CELLS,) * 3)
    x.from_numpy(positions)
    v.fill(ti.Vector([0.0, 0.0, -1.0]))
    deformation.from_numpy(np.tile(np.eye(3, dtype=np.float32), (count, 1, 1)))

    @ti.kernel
    def clear():
        for node in ti.grouped(grid_m):
            grid_v[node] = ti.zero(grid_v[node])
            grid_m[node] = 0.0

    @ti.kernel
    def scatter():
        for p in x:
            base = (x[p] / dx - 0.5).cast(int)
            fx = x[p] / dx - base.cast(float)
            w = [0.5 * (1.5 - fx) ** 2, 0.75 - (fx - 1.0) ** 2, 0.5 * (fx - 0.5) ** 2]
            f = (ti.Matrix.identity(ti.f32, 3) + DT_S * affine[p]) @ deformation[p]
            deformation[p] = f
            u, _, q = ti.svd(f)
            j = f.determinant()
            tau = 2 * mu * (f - u @ q.transpose()) @ f.transpose()
            tau += ti.Matrix.identity(ti.f32, 3) * (lam * j * (j - 1))
            moment = mass * affine[p] - (DT_S * volume * 4 / dx**2) * tau
            for offset in ti.static(ti.grouped(ti.ndrange(3, 3, 3))):
                away = (offset.cast(float) - fx) * dx
                weight = w[offset[0]][0] * w[offset[1]][1] * w[offset[2]][2]
                grid_v[base + offset] += weight * (mass * v[p] + moment @ away)
                grid_m[base + offset] += weight * mass

    @ti.kernel
    def update():
        for node in ti.grouped(grid_m):
            if grid_m[node] > 0:
                velocity = grid_v[node] / grid_m[node]
                velocity[2] -= DT_S * GRAVITY_M_S2
                if node[2] * dx < GROUND_M:
                    velocity = ti.zero(velocity)
                grid_v[node] = velocity

    @ti.kernel
    def gather():
        for p in x:
            base = (x[p] / dx - 0.5).cast(int)
            fx = x[p] / dx - base.cast(float)
            w = [0.5 * (1.5 - fx) ** 2, 0.75 - (fx - 1.0) ** 2, 0.5 * (fx - 0.5) ** 2]
            velocity, moment = ti.zero(v[p]), ti.zero(affine[p])
            for offset in ti.static(ti.grouped(ti.ndrange(3, 3, 3))):
                weight = w[offset[0]][0] * w[offset[1]][1] * w[offset[2]][2]
                node_v = grid_v[base + offset]
                velocity += weight * node_v
                moment += 4 / dx * weight * node_v.outer_product(offset.cast(float) - fx)
            v[p], affine[p] = velocity, moment
            x[p] += DT_S * velocity

    def step():
        clear()
        scatter()
        update()
        gather()

    return rate(count, step)


def physgaussian_rate(folder, law):
    import types

    import warp as wp

    # PhysGaussian passes torch's tensors to its solver; here the solver gets arrays, and torch is only a stub.
    sys.modules.setdefault("torch", types.ModuleType("torch"))
    sys.path[:0] = [str(folder / "mpm_solver_warp"), str(folder)]
    wp.init()
    from mpm_solver_warp import MPM_Simulator_WARP
    import numpy as np

    positions, volume = cube()
    count = len(positions)
    solver = MPM_Simulator_WARP(count, n_grid=CELLS, grid_lim=SIDE_M, device="cpu")
    state = solver.mpm_state
    velocity, still = np.tile(np.float32([0, 0, -1]), (count, 1)), np.tile(np.eye(3, dtype=np.float32), (count, 1, 1))
    state.particle_x = wp.from_numpy(positions, dtype=wp.vec3, device="cpu")
    state.particle_v = wp.from_numpy(velocity, dtype=wp.vec3, device="cpu")
    state.particle_F_trial = wp.from_numpy(still, dtype=wp.mat33, device="cpu")
    state.particle_vol = wp.from_numpy(np.full(count, volume, np.float32), dtype=float, device="cpu")
    settings = {"E": YOUNGS_MODULUS_PA, "nu": POISSON_RATIO, "density": DENSITY_KG_M3} | LAWS[law]
    settings |= {"g": [0.0, 0.0, -GRAVITY_M_S2], "n_grid": CELLS, "grid_lim": SIDE_M}
    solver.set_parameters_dict(settings, device="cpu")
    solver.finalize_mu_lam(device="cpu")
    solver.add_surface_collider((1.0, 1.0, GROUND_M), (0.0, 0.0, 1.0), "sticky", 0.0, 0.0, 1e3)
    return rate(count, lambda: solver.p2g2p(0, DT_S, device="cpu"))


def bench_binary():
    """The compiled bench, so that building it is not part of a round."""
    build = ["cargo", "bench", "--bench", "simulate", "--no-run", "--message-format", "json"]
    done = subprocess.run(build, cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    messages = [json.loads(line) for line in done.stdout.splitlines()]
    return next(m["executable"] for m in messages if m.get("target", {}).get("name") == "simulate" and m.get("executable"))


def gprop_rate(binary, law, threads):
    """From criterion's throughput line: particle substeps per second of wall time."""
    name = f"simulate/{law}/{COUNT}/{CELLS}^3/{threads} threads"
    bench = [binary, "--bench", "--exact", name, "--warm-up-time", "0.5", "--measurement-time", "2"]
    done = subprocess.run(bench, cwd=ROOT, capture_output=True, text=True)
    found = re.search(r"thrpt:\s*\[\S+ \S+ (\S+) ([KMG]?)elem/s", done.stdout)
    if done.returncode != 0 or not found:
        sys.exit(f"{' '.join(bench)} failed:\n{done.stderr}\n{done.stdout}")
    return float(found[1]) * {"": 1, "K": 1e3, "M": 1e6, "G": 1e9}[found[2]]


def peer_rate(python, *arguments):
    """Measured in a process of its own, so that no peer holds threads or memory while another runs."""
    done = subprocess.run([python, __file__, *arguments], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(done.stderr)
    return float(done.stdout.split()[-1])


def peers_python():
    """A Python with the peers, in an environment of its own that is made once."""
    folder = Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache")) / "gprop" / "simulate-peers"
    python = folder / ("Scripts" if sysconfig.get_platform().startswith("win") else "bin") / "python"
    if not python.exists():
        venv.create(folder, with_pip=True)
        subprocess.run([python, "-m", "pip", "install", "--quiet", *PACKAGES], check=True)
    return str(python)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--physgaussian", metavar="DIR", type=Path, help="checkout of PhysGaussian")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--measure", choices=["taichi", *LAWS], help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure == "taichi":
        return print(taichi_rate())
    if options.measure:
        return print(physgaussian_rate(options.physgaussian, options.measure))

    python, binary = peers_python(), bench_binary()
    engines = {("gprop", law): lambda law=law: gprop_rate(binary, law, 1) for law in LAWS}
    engines["gprop, 2 threads", "elastic"] = lambda: gprop_rate(binary, "elastic", 2)
    engines["Taichi", "elastic"] = lambda: peer_rate(python, "--measure", "taichi")
    if options.physgaussian:
        folder = ["--physgaussian", str(options.physgaussian.resolve())]
        engines |= {("PhysGaussian", law): lambda law=law: peer_rate(python, "--measure", law, *folder) for law in LAWS}
    rates = {name: [] for name in engines}
    for _ in range(options.rounds):
        for name, measure in engines.items():
            rates[name].append(measure())
    middle = {name: statistics.median(values) for name, values in rates.items()}
    print(f"{'engine':<20} {'law':<12} {'million particle substeps per CPU second':>40} {'gprop is faster by':>20}")
    for (engine, law), value in middle.items():
        ratio = "" if engine.startswith("gprop") else f"{middle['gprop', law] / value:.1f}"
        print(f"{engine:<20} {law:<12} {value / 1e6:>40.2f} {ratio:>20}")
    print(f"two threads: {middle['gprop, 2 threads', 'elastic'] / middle['gprop', 'elastic']:.2f} times one, by the clock")


if __name__ == "__main__":
    main()
