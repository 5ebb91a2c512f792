#!/usr/bin/env python3
"""Puts fixtures that were run onto one table, for the picture in the README.

set_table.py OUT RUN:X,Y,DEGREES ...

Each RUN is the work folder of a fixture with its results. OUT becomes a scene: a splat of a wooden table with the objects turned by DEGREES
and with their middles at X,Y (m), cameras around it, and their photos, which are blank: only the page's picture in 3D is used. The results
of each run, with a shorter name, go where those of the object of that number belong; name the runs in the order of their numbers in
`gprop objects OUT`.
"""
import array
import json
import math
import re
import shutil
import struct
import sys
import zlib
from pathlib import Path

COLUMNS = ["x", "y", "z", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", *(f"scale_{n}" for n in range(3)), *(f"rot_{n}" for n in range(4))]
SH_C0 = 0.28209479177387814
HALF_TABLE, STEP = (0.7, 0.5), 0.006


def read(path):
    """The columns of a PLY file of floats, with the colour of the mean direction."""
    data = path.read_bytes()
    head, body = data.split(b"end_header\n", 1)
    names = [line.split()[-1] for line in head.decode("latin-1").splitlines() if line.startswith("property float")]
    values = array.array("f", body)
    return [values[names.index(name) :: len(names)] for name in COLUMNS]


def placed(columns, at, angle):
    """The rows, turned about z and moved, so that the lowest percent is on the table."""
    x, y, z = columns[:3]
    middle = [(min(side) + max(side)) / 2 for side in (x, y)]
    floor = sorted(z)[len(z) // 100]
    cos, sin, half = math.cos(angle), math.sin(angle), (math.cos(angle / 2), math.sin(angle / 2))
    for row in zip(*columns):
        east, north = row[0] - middle[0], row[1] - middle[1]
        w, i, j, k = row[10:]
        turned = (half[0] * w - half[1] * k, half[0] * i - half[1] * j, half[0] * j + half[1] * i, half[0] * k + half[1] * w)
        yield (at[0] + cos * east - sin * north, at[1] + sin * east + cos * north, row[2] - floor, *row[3:10], *turned)


def table():
    """Planks."""
    counts = [round(2 * half / STEP) for half in HALF_TABLE]
    for n in range(counts[0]):
        for m in range(counts[1]):
            x, y = STEP * n - HALF_TABLE[0], STEP * m - HALF_TABLE[1]
            plank = math.floor(y / 0.115)
            grain = 0.035 * math.sin(90 * y + 6 * math.sin(5 * x + plank)) + 0.02 * math.sin(310 * y + 3 * math.sin(9 * x))
            light = 0.62 + 0.05 * ((plank * 7) % 5 - 2) / 2 + grain - (0.22 if y / 0.115 - plank < 0.04 else 0)
            color = [(channel * light - 0.5) / SH_C0 for channel in (1.0, 0.80, 0.60)]
            yield (x, y, 0.0, *color, 6.0, math.log(0.6 * STEP), math.log(0.6 * STEP), math.log(0.0005), 1.0, 0.0, 0.0, 0.0)


def blank_photo(width, height):
    chunk = lambda kind, data: struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    rows = b"".join(b"\0" + bytes([128 + (row + column) % 3 for column in range(3 * width)]) for row in range(height))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")


def main(out, *runs):
    out = Path(out)
    (out / "images").mkdir(parents=True)
    rows, objects = list(table()), []
    for run in runs:
        folder, place = run.rsplit(":", 1)
        x, y, degrees = map(float, place.split(","))
        rows += placed(read(Path(folder) / "field.ply"), (x, y), math.radians(degrees))
        objects.append(Path(folder))
    header = "".join(f"property float {name}\n" for name in COLUMNS)
    with open(out / "point_cloud.ply", "wb") as ply:
        ply.write(f"ply\nformat binary_little_endian 1.0\nelement vertex {len(rows)}\n{header}end_header\n".encode())
        ply.write(array.array("f", [value for row in rows for value in row]).tobytes())
    (out / "transforms.json").write_text(json.dumps(cameras_around(out / "images")))
    for number, folder in enumerate(objects, 1):
        work = out / f"gprop/objects/object_{number}"
        work.mkdir(parents=True)
        shutil.copy(folder / "parts.json", work)
        answer = json.loads((folder / "object.json").read_text())
        answer["object"] = re.split("[,:;]| with ", re.sub(r" \(.*?\)", "", answer["object"]))[0]
        (work / "object.json").write_text(json.dumps(answer))


def cameras_around(images):
    """Sixteen, of which the first, from which the page looks, is a little closer."""
    frames = []
    for n in range(16):
        angle, radius = math.tau * n / 16 - math.pi / 2, 1.5 if n else 1.4
        eye = [radius * math.cos(angle), radius * math.sin(angle), 0.8]
        back = [eye[0], eye[1], eye[2] - 0.2]
        back = [side / math.hypot(*back) for side in back]
        right = [-math.sin(angle), math.cos(angle), 0.0]
        up = [back[1] * right[2] - back[2] * right[1], back[2] * right[0] - back[0] * right[2], back[0] * right[1] - back[1] * right[0]]
        pose = [[right[a], up[a], back[a], eye[a]] for a in range(3)] + [[0, 0, 0, 1]]
        (images / f"{n:03}.png").write_bytes(blank_photo(320, 240))
        frames.append({"file_path": f"images/{n:03}.png", "transform_matrix": pose})
    return {"w": 320, "h": 240, "fl_x": 260, "fl_y": 260, "cx": 160, "cy": 120, "frames": frames}


main(*sys.argv[1:])
