#!/usr/bin/env python3
"""How gprop's cost grows with views, Gaussians and segments: CPU seconds and peak memory of every stage, on one thread.

    benches/growth.py measure SWEEP...    SWEEP: views, gaussians, segments; their rows in docs/growth.csv are replaced
    benches/growth.py plot                draws docs/growth.svg from it and prints the fitted rates

The object is fixtures/hammer (28,736 Gaussians of SH degree 3, views of 512 x 512). Each stage is a run of its own that continues
where the previous one ended. Its CPU time is that of the process, less that of a run that finds everything done (loading and hashing the
scene, which is the stage `scene`). CPU time is measured because a busy machine changes it least. Answers come from a server in this script
that gives the same answer for every segment at once, so a model's own time is not included.

- views: 1 to 200, with SAM's segments; more than the fixture's 30 are copies of them;
- gaussians: 10,000 to 1,000,000 with four views and SAM's segments: a random subset, or copies shifted by half a standard deviation;
  a twentieth of a second is simulated, all of it in substeps of the same length: the object deforms as a whole, softened to the same
  stiffness, and hits the ground after half of that time;
- segments: 1 to 64 stripes of the object in each of four views, in place of SAM's segments.

Needs `cargo build --release` and Python's standard library.
"""

import argparse
import csv
import http.server
import json
import math
import multiprocessing
import os
import random
import re
import shutil
import struct
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
SCENE = ROOT / "fixtures/hammer"
TABLE = ROOT / "docs/growth.csv"
PLOT = ROOT / "docs/growth.svg"
GPROP = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target")) / "release/gprop"
COLUMNS = ["sweep", "value", "stage", "cpu_s", "peak_mb", "views", "gaussians", "segments", "questions", "parts"]
SWEEPS = {
    "views": [1, 4, 16, 64, 200],
    "gaussians": [10_000, 30_000, 100_000, 300_000, 1_000_000],
    "segments": [1, 4, 16, 64],
}
VIEWS = 4
SEED = 11
# So near to the ground, the fall is simulated in substeps too.
SIMULATION = ["--rigid", "never", "--max-stiffness", "2e7", "--drop-height", "0.01", "--duration", "0.05", "--frames", "2"]


class Server(http.server.ThreadingHTTPServer):
    """Answers every question with the part of one recorded answer of the fixture that is about a segment, and counts them."""

    def __init__(self):
        super().__init__(("127.0.0.1", 0), Handler)
        recording = json.loads(min((SCENE / "recorded").glob("*.json")).read_text())
        asked = json.loads((ROOT / "prompts/segment.schema.json").read_text())["properties"]
        answer = {name: value for name, value in json.loads(recording["response"]).items() if name in asked}
        self.answer, self.questions = json.dumps(answer), 0
        threading.Thread(target=self.serve_forever, daemon=True).start()

    def flags(self):
        return ["--lmm-url", f"http://127.0.0.1:{self.server_port}/v1", "--lmm-model", "none"]


class Handler(http.server.BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"

    def do_POST(self):
        self.rfile.read(int(self.headers["Content-Length"]))
        self.server.questions += 1
        message = {"role": "assistant", "content": self.server.answer}
        body = json.dumps({
            "id": "1", "object": "chat.completion", "model": "none",
            "choices": [{"index": 0, "finish_reason": "stop", "message": message}],
            "usage": {"prompt_tokens": 1200, "completion_tokens": 80, "total_tokens": 1280},
        }).encode()
        self.send_response(200)
        self.send_header("Content-Type", "application/json")
        self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, *_):
        pass


def apart(work, *given):
    """Does something in a process of its own: otherwise the memory it takes would count towards every gprop started later,
    since a process begins with its parent's peak."""
    process = multiprocessing.Process(target=work, args=given)
    process.start()
    process.join()
    if process.exitcode != 0:
        sys.exit(f"{work.__name__} failed")


def scene(folder, views=0):
    """The fixture without its recordings, with copies of its views until there are `views`."""
    shutil.copytree(SCENE / "images", folder / "images")
    cameras = json.loads((SCENE / "transforms.json").read_text())
    frames, originals = cameras["frames"], list(cameras["frames"])
    for number in range(len(frames), views):
        seen = originals[number % len(originals)]
        copy = f"images/{number:03}.png"
        shutil.copy(folder / seen["file_path"], folder / copy)
        frames.append({**seen, "file_path": copy})
    (folder / "transforms.json").write_text(json.dumps(cameras))
    shutil.copy(SCENE / "point_cloud.ply", folder)
    (folder / "gprop.toml").write_text('scale = "metric"\nlevel = "small"\nask = "segments"\n')
    return folder


def resize(cloud, count):
    """Gives a PLY `count` Gaussians: a random choice of them, or copies shifted by half their standard deviation."""
    data = cloud.read_bytes()
    end = data.index(b"end_header\n") + len(b"end_header\n")
    lines = data[:end].decode().splitlines()
    names = [line.split()[2] for line in lines if line.startswith("property float")]
    place = next(at for at, line in enumerate(lines) if line.startswith("element vertex"))
    have = int(lines[place].split()[2])
    lines[place] = f"element vertex {count}"
    row = 4 * len(names)
    at = [4 * names.index(name) for name in ("x", "y", "z", "scale_0", "scale_1", "scale_2")]
    noise = random.Random(SEED)
    chosen = sorted(noise.sample(range(have), count)) if count <= have else [n % have for n in range(count)]
    rows = bytearray()
    for number, source in enumerate(chosen):
        one = bytearray(data[end + row * source : end + row * (source + 1)])
        if number >= have:
            for axis, log_scale in zip(at[:3], at[3:]):
                (here,), (size,) = struct.unpack_from("<f", one, axis), struct.unpack_from("<f", one, log_scale)
                struct.pack_into("<f", one, axis, here + noise.gauss(0, 0.5) * math.exp(size))
        rows += one
    cloud.write_bytes("\n".join(lines).encode() + b"\n" + rows)


def run(folder, to, flags):
    """CPU seconds and peak memory in MB of one run of gprop."""
    command = [GPROP, "run", folder, "--to", to, "--threads", "1", "-q", *flags]
    with tempfile.TemporaryFile() as words:
        process = subprocess.Popen(command, stdout=words, stderr=words)
        _, status, usage = os.wait4(process.pid, 0)
        if status != 0:
            words.seek(0)
            sys.exit(f"{command}: {words.read().decode()}")
    return usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1000


def measure(sweep, value, folder, stages, flags):
    """One row per stage."""
    server, rows = Server(), []
    flags = [*flags, *server.flags()]
    first = run(folder, "scene", flags)
    loading = run(folder, "scene", flags)[0]
    counts = {"sweep": sweep, "value": value}
    for stage in ["scene", *stages]:
        cpu, peak = first if stage == "scene" else run(folder, stage, flags)
        if stage == "simulate" and json.loads((folder / "gprop/simulation/simulation.json").read_text())["substeps"] == 0:
            sys.exit("the simulation took no substeps: its CPU time would say nothing")
        less = 0 if stage == "scene" else loading
        rows.append({**counts, "stage": stage, "cpu_s": round(max(cpu - less, 0), 3), "peak_mb": round(peak)})
        print(*rows[-1].values(), flush=True)
    views = json.loads((folder / "gprop/views.json").read_text())
    answers = (folder / "gprop/answers.jsonl").read_text().count("\n")
    parts = len(json.loads((folder / "gprop/labels.json").read_text()))
    found = {"views": len(views["views"]), "gaussians": views["gaussians"], "segments": answers, "parts": parts}
    return [{**row, **found, "questions": server.questions} for row in rows]


def stripes(source, folder, count):
    """Label maps of `count` segments each: the foreground of those in `source` cut into stripes of equal area. Both are NumPy
    arrays of int32, height x width, -1 where there is nothing."""
    folder.mkdir()
    for path in source.glob("*_s.npy"):
        data = path.read_bytes()
        (length,) = struct.unpack_from("<H", data, 8)
        shape = re.search(rb"'shape': \(([\d, ]+)\)", data[: 10 + length])[1]
        height, width = map(int, re.findall(rb"\d+", shape))
        labels = struct.unpack_from(f"<{height * width}i", data, 10 + length)
        columns = [sum(labels[y * width + x] >= 0 for y in range(height)) for x in range(width)]
        area, seen, stripe_of = sum(columns), 0, []
        for pixels in columns:
            stripe_of.append(min(count - 1, seen * count // area))
            seen += pixels
        cut = [stripe_of[at % width] if label >= 0 else -1 for at, label in enumerate(labels)]
        (folder / path.name).write_bytes(data[: 10 + length] + struct.pack(f"<{height * width}i", *cut))


def sweep_rows(sweep):
    home = Path(tempfile.mkdtemp(prefix="gprop-growth-"))
    try:
        if sweep == "views":
            for count in SWEEPS[sweep]:
                folder = scene(home / str(count), count)
                yield from measure(sweep, count, folder, ["segment", "query", "vote", "parts"], ["--views", str(count)])
            return
        start = scene(home / "start")
        run(start, "segment", ["--views", str(VIEWS), "--also", "npy"])
        segments = start / "gprop/segments"
        names = ",".join(sorted(path.stem for path in segments.glob("*.png")))
        for value in SWEEPS[sweep]:
            stages, more = ["segment", "query", "vote", "parts"], []
            folder, labels = scene(home / str(value)), segments
            if sweep == "gaussians":
                apart(resize, folder / "point_cloud.ply", value)
                stages += ["simulate", "grasp", "report"]
                more = SIMULATION
            else:
                apart(stripes, segments, labels := home / f"stripes-{value}", value)
            yield from measure(sweep, value, folder, stages, ["--view-list", names, "--segments", labels, *more])
            shutil.rmtree(folder)
    finally:
        shutil.rmtree(home)


def table():
    if not TABLE.exists():
        return []
    with TABLE.open(newline="") as lines:
        numbers = lambda row: {name: cell if name in ("sweep", "stage") else float(cell) for name, cell in row.items()}
        return [numbers(row) for row in csv.DictReader(lines)]


def save(rows):
    with TABLE.open("w", newline="") as out:
        writer = csv.DictWriter(out, COLUMNS, lineterminator="\n")
        writer.writeheader()
        writer.writerows({name: f"{cell:g}" if isinstance(cell, float) else cell for name, cell in row.items()} for row in rows)


def line(points):
    """Least squares, each point by its relative error: intercept, slope, largest relative error."""
    weights = [1 / y**2 for _, y in points]
    total = sum(weights)
    x_mean = sum(w * x for w, (x, _) in zip(weights, points)) / total
    y_mean = sum(w * y for w, (_, y) in zip(weights, points)) / total
    slope = sum(w * (x - x_mean) * (y - y_mean) for w, (x, y) in zip(weights, points))
    slope /= sum(w * (x - x_mean) ** 2 for w, (x, _) in zip(weights, points))
    intercept = y_mean - slope * x_mean
    return intercept, slope, max(abs(intercept + slope * x - y) / y for x, y in points)


STYLE = """text{font:12px system-ui,sans-serif;fill:#333}.soft{fill:#777}.grid{stroke:#ddd}path{fill:none;stroke-width:2}
.scene{stroke:#8a8a8a}.segment{stroke:#c9615a}.query{stroke:#b8860b}.vote{stroke:#2f8f8f}.parts{stroke:#4f7fc9}.simulate{stroke:#8a5fc9}.grasp{stroke:#4f9d69}.report{stroke:#c96aa8}
@media(prefers-color-scheme:dark){text{fill:#ddd}.soft{fill:#999}.grid{stroke:#3a3d42}}"""
# Axis label of each panel.
PANELS = {"views": "views of 28,736 Gaussians", "gaussians": "Gaussians in 4 views, 0.05 s simulated", "segments": "segments in each of 4 views"}
WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 330, 300, 46, 66, 30, 44
LEAST = 0.02


def plot(rows):
    """Three panels side by side with logarithmic axes, one line per stage with the stage's name at its end."""
    powers = lambda low, high: [10.0**n for n in range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)]
    seconds = powers(LEAST, max(row["cpu_s"] for row in rows))
    share = lambda value, low, high: (math.log10(value) - math.log10(low)) / (math.log10(high) - math.log10(low))
    y = lambda value: HEIGHT - BOTTOM - (HEIGHT - BOTTOM - TOP) * share(max(value, seconds[0]), seconds[0], seconds[-1])
    out = []
    for panel, (sweep, axis) in enumerate(PANELS.items()):
        mine = [row for row in rows if row["sweep"] == sweep]
        values = sorted({row["value"] for row in mine})
        x = lambda value: LEFT + (WIDTH - LEFT - RIGHT) * share(value, values[0], values[-1])
        out.append(f'<g transform="translate({panel * WIDTH})"><text x="{LEFT}" y="16">CPU seconds of each stage</text>')
        middle = (LEFT + WIDTH - RIGHT) / 2
        out.append(f'<text x="{middle:.0f}" y="{HEIGHT - 6}" text-anchor="middle">{axis}</text>')
        for tick in seconds:
            out.append(f'<path class="grid" style="stroke-width:1" d="M{LEFT} {y(tick):.1f}H{WIDTH - RIGHT}"/>')
            out.append(f'<text class="soft" x="{LEFT - 6}" y="{y(tick) + 4:.1f}" text-anchor="end">{tick:g}</text>')
        for tick in values:
            name = f"{tick / 1e6:g}M" if tick >= 1e6 else f"{tick / 1e3:g}k" if tick >= 1e3 else f"{tick:g}"
            out.append(f'<text class="soft" x="{x(tick):.1f}" y="{HEIGHT - BOTTOM + 18}" text-anchor="middle">{name}</text>')
        ends = []
        for stage in dict.fromkeys(row["stage"] for row in mine):
            points = [(row["value"], row["cpu_s"]) for row in mine if row["stage"] == stage]
            if max(cpu for _, cpu in points) >= LEAST:
                out.append(f'<path class="{stage}" d="M' + "L".join(f"{x(v):.1f} {y(cpu):.1f}" for v, cpu in points) + '"/>')
                ends.append([y(points[-1][1]), stage])
        lowest = -math.inf
        for end in sorted(ends):
            end[0] = lowest = max(end[0], lowest + 13)
            out.append(f'<text x="{WIDTH - RIGHT + 5}" y="{end[0] + 4:.1f}">{end[1]}</text>')
        out.append("</g>")
    size = f'viewBox="0 0 {len(PANELS) * WIDTH} {HEIGHT}" width="{len(PANELS) * WIDTH}" height="{HEIGHT}"'
    label = "CPU seconds of each stage as views, Gaussians and segments grow"
    PLOT.write_text(f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img" aria-label="{label}">\n<style>{STYLE}</style>\n' + "\n".join(out) + "\n</svg>\n")


# Fits: sweep, stage, column, text for one unit of the column, factor, unit of the result.
RATES = [
    ("views", "segment", "views", "per view", 1, "s"),
    ("views", "vote", "views", "per view", 1e3, "ms"),
    ("segments", "query", "segments", "per segment", 1e3, "ms"),
    ("segments", "parts", "parts", "per 3D part", 1e3, "ms"),
    ("gaussians", "scene", "gaussians", "per Gaussian", 1e6, "us"),
    ("gaussians", "vote", "gaussians", "per Gaussian and view", 1e6 / VIEWS, "us"),
    ("gaussians", "parts", "gaussians", "per Gaussian", 1e6, "us"),
    ("gaussians", "simulate", "gaussians", "per Gaussian", 1e6, "us"),
    ("gaussians", "grasp", "gaussians", "per Gaussian", 1e6, "us"),
    ("gaussians", "report", "gaussians", "per Gaussian", 1e6, "us"),
]


def rates(rows):
    """Prints the CPU time that each view, segment, part and Gaussian adds, and the peak memory of any stage."""
    for sweep, stage, column, what, factor, unit in RATES:
        points = [(row[column], row["cpu_s"]) for row in rows if (row["sweep"], row["stage"]) == (sweep, stage)]
        if points:
            start, slope, off = line(points)
            print(f"{stage:9} {start:7.2f} s + {slope * factor:8.2f} {unit} {what}; off by {100 * off:.0f} % at most")
    for sweep, column in [("views", "views"), ("segments", "parts"), ("gaussians", "gaussians")]:
        mine = [row for row in rows if row["sweep"] == sweep]
        peaks = {int(row[column]): max(r["peak_mb"] for r in mine if r["value"] == row["value"]) for row in mine}
        print(f"peak memory, MB, by {column}: " + ", ".join(f"{at:,} {peak:g}" for at, peak in peaks.items()))
    asked = {(row["segments"], row["questions"]) for row in rows}
    print("questions per segment:", {questions / segments for segments, questions in asked})


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["measure", "plot"])
    parser.add_argument("sweeps", nargs="*", choices=[*SWEEPS, []])
    given = parser.parse_args()
    if given.what == "plot":
        plot(table())
        return rates(table())
    for sweep in given.sweeps or SWEEPS:
        begun, rows = time.monotonic(), list(sweep_rows(sweep))
        kept = [row for row in table() if row["sweep"] != sweep]
        save(sorted(kept + rows, key=lambda row: list(SWEEPS).index(row["sweep"])))
        print(f"{sweep}: {time.monotonic() - begun:.0f} s", flush=True)


if __name__ == "__main__":
    main()
