"""`python -m tests.bench surfaces --growth OUT.png`: how the cost of an isovalue grows.

Two spheres in volumes of 64³ to 512³ samples: one that grows with the volume (its output k grows
with N², the samples with N³), one that stays as large as it is (k is the same, n is 512 times as
much). Each is extracted with all samples looked at, and with the ranges of bricks built before.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

SIDES = (64, 96, 128, 192, 256, 384, 512)
RADIUS = 28.0  # samples, of the sphere that stays
SIZE, EDGE = (900, 640), (90, 40, 870, 570)
COLORS = {
    "grows with the volume, all samples": "#d95f02",
    "grows with the volume, bricks": "#1b9e77",
    "stays, all samples": "#e7298a",
    "stays, bricks": "#1f78b4",
}
Row = tuple[int, str, float, int]


def ball(side: int, radius: float) -> np.ndarray:
    """Distance to a sphere, in samples; float32[side, side, side], made layer by layer."""
    place = np.arange(side, dtype=np.float32) - (side - 1) / 2
    flat = place[:, None] ** 2 + place**2
    data = np.empty((side, side, side), np.float32)
    for layer, z in zip(data, place, strict=True):
        np.sqrt(flat + z * z, out=layer)
        np.subtract(radius, layer, out=layer)
    return data


def median(task: Callable[[], object], runs: int) -> tuple[float, float]:
    """Milliseconds of one call, and processor milliseconds of all threads."""
    task()
    times = []
    for _ in range(runs):
        start, worked = time.perf_counter(), time.process_time()
        task()
        times.append((time.perf_counter() - start, time.process_time() - worked))
    wall, worked = (1000 * statistics.median(column) for column in zip(*times, strict=True))
    return wall, worked


def measure(runs: int) -> list[Row]:
    """(side, series, ms, triangles) of every volume."""
    import volviz
    from volviz.isosurface.cells import CellRanges
    from volviz.isosurface.extractors.marching_cubes import extract
    from volviz.isosurface.finders import FINDERS

    found = []
    for side in SIDES:
        for kind, radius in (("grows with the volume", 0.35 * side), ("stays", RADIUS)):
            volume = volviz.Volume.from_array(ball(side, radius))
            rows = FINDERS["bricks"].build(CellRanges.of(volume), None).rows
            count = len(extract(volume, 0.0).faces)
            whole = median(lambda v=volume: extract(v, 0.0), runs)
            near = median(lambda v=volume, r=rows: extract(v, 0.0, rows=r), runs)
            found += [(side, f"{kind}, all samples", whole[0], count)]
            found += [(side, f"{kind}, bricks", near[0], count)]
            cells = f"{whole[0]:.2f} ({whole[1]:.2f}) | {near[0]:.2f} ({near[1]:.2f})"
            print(f"| {side}³ | {kind} | {count} | {cells} |", flush=True)
    return found


def draw(rows: list[Row], path: Path) -> None:
    """Both axes logarithmic; grey lines grow with N² and N³."""
    image = Image.new("RGB", SIZE, "white")
    pen = ImageDraw.Draw(image)
    x0, y0, x1, y1 = EDGE
    top, bottom = 1.5 * max(r[2] for r in rows), 0.6 * min(r[2] for r in rows)

    def at(side: float, ms: float) -> tuple[float, float]:
        across = np.log(side / SIDES[0]) / np.log(SIDES[-1] / SIDES[0])
        up = np.log(ms / bottom) / np.log(top / bottom)
        return x0 + across * (x1 - x0), y1 - up * (y1 - y0)

    for power in (2, 3):
        start = next(r[2] for r in rows if r[1].startswith("grows") and r[1].endswith("bricks"))
        end = min(SIDES[-1], SIDES[0] * (top / start) ** (1 / power))
        last = at(end, start * (end / SIDES[0]) ** power)
        pen.line([at(SIDES[0], start), last], fill="#bbbbbb", width=2)
        pen.text((last[0] - 34, last[1] + 6), f"N^{power}", fill="#888888", font_size=16)
    pen.rectangle(EDGE, outline="black")
    for side in SIDES:
        x, y = at(side, bottom)
        pen.text((x - 14, y + 8), str(side), fill="black", font_size=15)
    for ms in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000):
        if bottom < ms < top:
            x, y = at(SIDES[0], ms)
            pen.line([(x, y), (x1, y)], fill="#eeeeee")
            pen.text((x - 44, y - 9), f"{ms:g}", fill="black", font_size=15)
    pen.text((x0, 12), "ms per isovalue against samples per side N", fill="black", font_size=18)
    for k, (name, color) in enumerate(COLORS.items()):
        line = [at(r[0], r[2]) for r in rows if r[1] == name]
        pen.line(line, fill=color, width=3)
        for x, y in line:
            pen.ellipse([x - 4, y - 4, x + 4, y + 4], fill=color)
        pen.text((x0 + 16, y0 + 10 + 22 * k), name, fill=color, font_size=16)
    image.save(path)


def main(path: Path, runs: int) -> None:
    """Print the table, then draw it."""
    print("| volume | sphere | triangles | all samples, ms (processor) | bricks, ms (processor) |")
    print("|---|---|---|---|---|")
    draw(measure(runs), path)
    print(f"drawn: {path}")
