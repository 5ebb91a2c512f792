#!/usr/bin/env python3
"""The vote by contribution in NumPy, beside `cargo bench --bench vote`: the same million Gaussians, cameras and label maps.

    python3 -m pip install numpy==2.4.6
    python3 benches/vote_numpy.py [VIEWS]          # of the bench's ten views; all ten if it is not given

Written in the usual way, without loops over Gaussians or pixels: a whole view is projected at once, splats are sorted by depth and
binned into tiles of 16 x 16 pixels, and a tile is blended as one matrix of splats by pixels (alpha, cumulative product of
1 - alpha, weights, median depth), then summed by segment. Single precision and round Gaussians, as in the bench: the projection
of a round Gaussian needs no rotation, which only makes it faster than the general case. Prints the seconds per view, and the
number of Gaussians that at least one view sees, which the bench prints too.
"""

import sys
import time

import numpy as np

COUNT, VIEWS, SIZE, TILE = 1_000_000, 10, 800, 16
SCALE, OPACITY = 0.005, 1.0 / (1.0 + np.exp(-1.0))
ALPHA_MIN, ALPHA_MAX, T_MIN, LOW_PASS = 1.0 / 255.0, 0.99, 1e-4, 0.3
VISIBLE_SHARE = 0.1


def on_sphere(n, count):
    z = 1.0 - (2.0 * n + 1.0) / count
    angle = n * np.pi * (3.0 - np.sqrt(5.0))
    r = np.sqrt(1.0 - z * z)
    return np.stack([np.cos(angle) * r, np.sin(angle) * r, z], axis=-1)


def camera(n):
    eye = on_sphere(np.float64(n), VIEWS) * 3.0
    forward = -eye / np.linalg.norm(eye)
    right = np.cross(forward, [0.1, 0.2, 1.0])
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(forward, right), forward]), eye


def project(positions, rotation, eye):
    """Centres, conics, reach, depth of what is in the picture, front to back."""
    focal, middle = 1.2 * SIZE, 0.5 * SIZE
    x, y, z = ((positions - eye) @ rotation.T).T
    u, v = focal * x / z + middle, focal * y / z + middle
    jx, jy = focal * SCALE / z, -focal * SCALE * x / z**2
    ky = -focal * SCALE * y / z**2
    a, b, c = jx * jx + jy * jy + LOW_PASS, jy * ky, jx * jx + ky * ky + LOW_PASS
    det = a * c - b * b
    q = 2.0 * np.log(OPACITY / ALPHA_MIN)
    reach_u, reach_v = np.sqrt(q * a), np.sqrt(q * c)
    seen = (z > 0.01) & (u + reach_u > 0) & (v + reach_v > 0) & (u - reach_u < SIZE) & (v - reach_v < SIZE)
    order = np.flatnonzero(seen)
    order = order[np.argsort(z[order], kind="stable")]
    columns = [w[order].astype(np.float32) for w in (u, v, c / det, -b / det, a / det, reach_u, reach_v, z)]
    return order, columns


def tiles_of(u, v, reach_u, reach_v):
    """Positions of the sorted splats, tile by tile, each tile's front to back."""
    side = -(-SIZE // TILE)
    low = lambda w, r: np.clip(((w - r) // TILE).astype(np.int64), 0, side - 1)
    high = lambda w, r: np.clip(((w + r) // TILE).astype(np.int64), 0, side - 1)
    x0, x1, y0, y1 = low(u, reach_u), high(u, reach_u), low(v, reach_v), high(v, reach_v)
    width, count = x1 - x0 + 1, (x1 - x0 + 1) * (y1 - y0 + 1)
    splat = np.repeat(np.arange(len(u)), count)
    nth = np.arange(len(splat)) - np.repeat(np.cumsum(count) - count, count)
    tile = (y0[splat] + nth // width[splat]) * side + x0[splat] + nth % width[splat]
    order = np.argsort(tile, kind="stable")
    return splat[order], np.searchsorted(tile[order], np.arange(side * side + 1)), side


def vote_view(positions, labels, rotation, eye, votes):
    order, (u, v, ca, cb, cc, reach_u, reach_v, z) = project(positions, rotation, eye)
    splats, starts, side = tiles_of(u, v, reach_u, reach_v)
    arrived, sent = np.zeros((COUNT, 2), np.float32), np.zeros(COUNT, np.float32)
    depth = np.full((SIZE, SIZE), np.inf, np.float32)
    inside = np.arange(TILE * TILE)
    for t in range(side * side):
        own = splats[starts[t] : starts[t + 1]]
        if len(own) == 0:
            continue
        px, py = t % side * TILE + inside % TILE, t // side * TILE + inside // TILE
        du = (px + np.float32(0.5))[None] - u[own, None]
        dv = (py + np.float32(0.5))[None] - v[own, None]
        power = -0.5 * (ca[own, None] * du * du + cc[own, None] * dv * dv) - cb[own, None] * du * dv
        alpha = np.minimum(np.float32(OPACITY) * np.exp(power), np.float32(ALPHA_MAX))
        alpha[alpha < ALPHA_MIN] = 0.0
        after = np.cumprod(1.0 - alpha, axis=0)
        before = np.concatenate([np.ones((1, TILE * TILE), np.float32), after[:-1]])
        alpha[before < T_MIN] = 0.0
        weight = alpha * before
        half = (before >= 0.5) & (after < 0.5)
        found = half.any(axis=0)
        depth[py[found], px[found]] = z[own[half.argmax(axis=0)[found]]]
        right = labels[py, px] == 2
        gaussian = order[own]
        arrived[gaussian, 0] += weight[:, ~right].sum(axis=1)
        arrived[gaussian, 1] += weight[:, right].sum(axis=1)
        sent[gaussian] += alpha.sum(axis=1)
    visible = arrived.sum(axis=1) >= VISIBLE_SHARE * sent
    votes += arrived * visible[:, None]
    return depth


def main():
    views = int(sys.argv[1]) if len(sys.argv) > 1 else VIEWS
    positions = on_sphere(np.arange(COUNT, dtype=np.float64), COUNT)
    labels = np.where(np.arange(SIZE) >= SIZE // 2, 2, 1)[None].repeat(SIZE, axis=0)
    votes = np.zeros((COUNT, 2), np.float32)
    start = time.perf_counter()
    for n in range(views):
        vote_view(positions, labels, *camera(n), votes)
    seconds = time.perf_counter() - start
    winner = votes.argmax(axis=1)
    seen = np.count_nonzero(votes[np.arange(COUNT), winner] > 0)
    print(f"{views} views: {seconds:.1f} s, {seconds / views:.2f} s per view; {seen} seen")


if __name__ == "__main__":
    main()
