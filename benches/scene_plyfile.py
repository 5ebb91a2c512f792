#!/usr/bin/env python3
"""Loading a 1,000,000-Gaussian PLY with plyfile (PyPI) beside gprop, on the same file in one run.

    python3 -m venv /tmp/venv && /tmp/venv/bin/pip install plyfile==1.1.2
    /tmp/venv/bin/python benches/scene_plyfile.py

Both end with the same arrays in memory: positions, normals, SH, opacities, scales and rotations, one row per Gaussian. plyfile's
memory-mapped structured array (its fast path) is copied into them column by column, as splat trainers and viewers do.
gprop's time and peak memory, and the time to read the bytes alone, come from `cargo run --release --example load_splat`, best of five.
"""

import os
import subprocess
import sys
import tempfile
import time

import numpy
import plyfile

COUNT = 1_000_000
NAMES = (
    "x y z nx ny nz".split()
    + [f"f_dc_{i}" for i in range(3)]
    + [f"f_rest_{i}" for i in range(45)]
    + ["opacity"]
    + [f"scale_{i}" for i in range(3)]
    + [f"rot_{i}" for i in range(4)]
)


def write(path):
    rows = numpy.random.default_rng(1).normal(size=(COUNT, len(NAMES))).astype("<f4")
    header = "ply\nformat binary_little_endian 1.0\nelement vertex %d\n" % COUNT
    header += "".join(f"property float {name}\n" for name in NAMES) + "end_header\n"
    with open(path, "wb") as file:
        file.write(header.encode())
        file.write(rows.tobytes())


def with_plyfile(path):
    vertex = plyfile.PlyData.read(path)["vertex"]
    table = lambda names: numpy.stack([vertex[name] for name in names], axis=1)
    return [table(NAMES[first:end]) for first, end in ((0, 3), (3, 6), (6, 9), (9, 54), (54, 55), (55, 58), (58, 62))]


def best_of(runs, action):
    times = []
    for _ in range(runs):
        start = time.perf_counter()
        result = action()
        times.append(time.perf_counter() - start)
        del result
    return min(times)


def main():
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "point_cloud.ply")
        write(path)
        peer = best_of(5, lambda: with_plyfile(path))
        command = ["cargo", "run", "--release", "--quiet", "--example", "load_splat", "--", path]
        ours = subprocess.run(command, check=True, capture_output=True, text=True).stdout
        numbers = dict(line.split() for line in ours.splitlines())
        seconds = float(numbers["load_s"])
        print(f"file           {os.path.getsize(path) / 1e6:8.1f} MB")
        print(f"read the bytes {float(numbers['read_s']):8.3f} s")
        print(f"gprop          {seconds:8.3f} s   {float(numbers['read_s']) / seconds:.2f} of the speed of reading the bytes")
        print(f"plyfile        {peer:8.3f} s   gprop is {peer / seconds:.1f} times as fast")
        print(f"peak memory    {float(numbers['peak_over_size']):8.2f} times the file's size")


if __name__ == "__main__":
    sys.exit(main())
