#!/usr/bin/env python3
"""Lets an object fall in MuJoCo and draws its Gaussians as they move with its bodies, without a GPU.

    gprop export my_scene --format mjcf --mjcf-splats --origin base --out model
    pip install mujoco numpy pillow
    scripts/draw_splats_in_mujoco.py model/scene.xml fall.gif

Each text NAME_splat of the model names the PLY with the Gaussians of the body NAME, in that body's frame. `load` and `place` are all that another
renderer needs: MuJoCo Warp's `create_render_context`, for example, takes centres, rotations, standard deviations and colours as `place` returns
them.
"""

import argparse
import math
from pathlib import Path

import mujoco
import numpy as np
from PIL import Image

WIDTH, HEIGHT = 320, 240
FRAMES_PER_S = 12
FIELD_OF_VIEW_DEG = 40.0
# From the camera to the middle, in diagonals of the object; and where the camera is, seen from there.
DISTANCE = 1.45
FROM = np.array([0.8, -1.0, 0.7])
SH_C0 = 0.28209479177387814
# Fainter Gaussians do not show in a picture of 8 bits.
LEAST_OPACITY = 1 / 255
# A Gaussian is drawn within this many standard deviations.
REACH = 3.0
# Added to the variances in the picture, pixels squared: no Gaussian is narrower than a pixel.
PIXEL = 0.3


def read_ply(path):
    """The columns of a binary PLY with float properties."""
    content = path.read_bytes()
    head, _, data = content.partition(b"end_header\n")
    lines = head.decode().splitlines()
    count = next(int(line.split()[2]) for line in lines if line.startswith("element vertex"))
    names = [line.split()[2] for line in lines if line.startswith("property")]
    return np.frombuffer(data, np.dtype([(name, "<f4") for name in names]), count)


def texts(model):
    """The names and values of the model's texts."""
    for start, address, size in zip(model.name_textadr, model.text_adr, model.text_size):
        yield model.names[start:].split(b"\0", 1)[0].decode(), bytes(model.text_data[address:address + size]).rstrip(b"\0").decode()


def load(scene):
    """The model, and for each body with Gaussians its number and their centres, rotations (w x y z), standard deviations and colours with
    opacity."""
    model = mujoco.MjModel.from_xml_path(str(scene))
    splats = []
    for name, file in texts(model):
        if not name.endswith("_splat"):
            continue
        body, columns = name.removesuffix("_splat"), read_ply(scene.parent / file)
        stacked = lambda *names: np.stack([columns[name] for name in names], axis=1).astype(float)
        rotations = stacked("rot_0", "rot_1", "rot_2", "rot_3")
        colors = np.clip(0.5 + SH_C0 * stacked("f_dc_0", "f_dc_1", "f_dc_2"), 0, 1)
        opacities = 1 / (1 + np.exp(-columns["opacity"].astype(float)))
        splats.append((
            model.body(body).id,
            stacked("x", "y", "z"),
            rotations / np.linalg.norm(rotations, axis=1, keepdims=True),
            np.exp(stacked("scale_0", "scale_1", "scale_2")),
            np.column_stack([colors, opacities]),
        ))
    return model, splats


def matrices(rotations):
    w, x, y, z = rotations.T
    rows = [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z), 1 - 2 * (x * x + z * z),
            2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]
    return np.stack(rows, axis=1).reshape(-1, 3, 3)


def multiplied(one, others):
    """The product of a quaternion with others."""
    w, x, y, z = one
    left = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    return others @ left.T


def place(data, splats):
    """All Gaussians where their bodies are now: centres, rotations, standard deviations, colours with opacity."""
    placed = []
    for body, centers, rotations, deviations, colors in splats:
        turn = data.xmat[body].reshape(3, 3)
        placed.append((centers @ turn.T + data.xpos[body], multiplied(data.xquat[body], rotations), deviations, colors))
    return [np.concatenate(arrays) for arrays in zip(*placed)]


def draw(placed, middle, distance):
    """A picture, by the projection of Zwicker et al. 2001, the farthest Gaussian first. Colours do not depend on the direction of sight."""
    centers, rotations, deviations, colors = placed
    backward = FROM / np.linalg.norm(FROM)
    right = np.cross([0, 0, 1], backward)
    right /= np.linalg.norm(right)
    view = np.stack([right, -np.cross(backward, right), -backward])
    seen = (centers - middle - backward * distance) @ view.T
    focal = 0.5 * HEIGHT / math.tan(0.5 * math.radians(FIELD_OF_VIEW_DEG))
    axes = view @ matrices(rotations) * deviations[:, None, :]
    x, y, depth = seen.T
    zero = np.zeros_like(depth)
    onto = np.stack([focal / depth, zero, -focal * x / depth**2, zero, focal / depth, -focal * y / depth**2], axis=1).reshape(-1, 2, 3) @ axes
    covariances = onto @ onto.transpose(0, 2, 1) + PIXEL * np.eye(2)
    precisions = np.linalg.inv(covariances)
    at = np.stack([0.5 * WIDTH + focal * x / depth, 0.5 * HEIGHT + focal * y / depth], axis=1)
    reach = REACH * np.sqrt(covariances[:, [0, 1], [0, 1]])
    low = np.maximum(np.ceil(at - reach - 0.5), 0).astype(int)
    high = np.minimum(np.floor(at + reach - 0.5) + 1, [WIDTH, HEIGHT]).astype(int)
    picture = np.ones((HEIGHT, WIDTH, 3))
    is_drawn = (depth > 0.05 * distance) & (high > low).all(axis=1) & (colors[:, 3] > LEAST_OPACITY)
    for i in sorted(np.flatnonzero(is_drawn), key=lambda i: -depth[i]):
        (left, top), (end, bottom) = low[i], high[i]
        dx, dy = np.arange(left, end) + 0.5 - at[i, 0], (np.arange(top, bottom) + 0.5 - at[i, 1])[:, None]
        (a, b), (_, c) = precisions[i]
        alpha = (colors[i, 3] * np.exp(-0.5 * (a * dx * dx + 2 * b * dx * dy + c * dy * dy)))[..., None]
        picture[top:bottom, left:end] += alpha * (colors[i, :3] - picture[top:bottom, left:end])
    return Image.fromarray((255 * picture).round().astype(np.uint8))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scene", type=Path)
    parser.add_argument("out", type=Path, help="picture (.png: frames side by side) or .gif")
    parser.add_argument("--seconds", type=float, default=1.0)
    parser.add_argument("--height", type=float, default=0.1, help="from which it falls, m")
    parser.add_argument("--tilt-deg", type=float, default=25.0, help="by which it is turned before")
    options = parser.parse_args()
    model, splats = load(options.scene)
    if not splats:
        parser.error(f"{options.scene} names no Gaussians; export it with --mjcf-splats")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    centers = place(data, splats)[0]
    middle, diagonal = 0.5 * (centers.min(axis=0) + centers.max(axis=0)), np.linalg.norm(np.ptp(centers, axis=0))
    half = math.radians(options.tilt_deg) / 2
    data.qpos[2] += options.height
    data.qpos[3:7] = multiplied([math.cos(half), math.sin(half), 0, 0], data.qpos[3:7])
    frames = []
    for frame in range(round(options.seconds * FRAMES_PER_S) + 1):
        while data.time < frame / FRAMES_PER_S:
            mujoco.mj_step(model, data)
        mujoco.mj_forward(model, data)
        frames.append(draw(place(data, splats), middle, DISTANCE * diagonal))
    if options.out.suffix == ".gif":
        frames[0].save(options.out, save_all=True, append_images=frames[1:], duration=1000 // FRAMES_PER_S, loop=0)
    else:
        strip = Image.new("RGB", (WIDTH * len(frames), HEIGHT))
        for n, frame in enumerate(frames):
            strip.paste(frame, (WIDTH * n, 0))
        strip.save(options.out)


main()
