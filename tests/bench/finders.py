"""`python -m tests.bench finders`: what each finder costs, looks at and promises, against n.

Counts are exact. Build time is processor time (user and system, all threads), the least of some
runs, compilation left out; memory is what the finder keeps. `visited` counts cells and nodes at
the isovalue, of nine spread over the values, with most active cells; `× bound` is the greatest
visited / bound of the nine, so 1 or less means that the bound holds at each.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable
from math import ceil, log2, prod, sqrt
from pathlib import Path
from typing import Any

import numpy as np

DATA = Path(__file__).parents[3] / "shared" / "data"
SIZES = (32, 64, 128, 256)


def sphere(n: int) -> np.ndarray:
    z, y, x = np.ogrid[-1 : 1 : n * 1j, -1 : 1 : n * 1j, -1 : 1 : n * 1j]
    return (0.7 - np.sqrt(x * x + y * y + z * z)).astype(np.float32)


def noise(n: int) -> np.ndarray:
    return np.random.default_rng(1).standard_normal((n, n, n), np.float32)


def head(n: int) -> np.ndarray:
    """The nearest samples of a real CT on n³ places."""
    import volviz

    data = volviz.load(DATA / "ct/cranium_head_ct.nrrd").data
    at = [np.rint(np.linspace(0, size - 1, n)).astype(int) for size in data.shape]
    return np.ascontiguousarray(data[np.ix_(*at)])


FIELDS: dict[str, Callable[[int], np.ndarray]] = {
    "sphere, float": sphere,
    "noise, float": noise,
    "head CT, int16": head,
}

# finder: the bound of n cells, k active, the longest side s, h distinct values; in words
BOUNDS: dict[str, tuple[Callable[[float, float, int, int], float], str]] = {
    "brute-force": (lambda n, k, s, h: n, "n"),
    "bricks": (lambda n, k, s, h: ceil(s / 4) ** 3 + 64 * k, "⌈s / 4⌉³ + 64 k"),
    "octree": (lambda n, k, s, h: 1 + 8 * k * ceil(log2(s)), "1 + 8 k ⌈log₂ s⌉"),
    "bono": (lambda n, k, s, h: 1 + 8 * k * ceil(log2(s)), "1 + 8 k ⌈log₂ s⌉"),
    "interval-tree": (lambda n, k, s, h: k + 2 * h.bit_length(), "k + 2 ⌈log₂ h⌉"),
    "noise": (lambda n, k, s, h: k + 6 * sqrt(n), "k + 6 √n"),
    "issue": (lambda n, k, s, h: k + min(256, sqrt(n)) + sqrt(n), "k + L + √n, L ≤ 256"),
    "propagation": (lambda n, k, s, h: 2 * k + 2 * h.bit_length(), "2 k + 2 ⌈log₂ h⌉"),
}


def row(name: str, data: np.ndarray, distinct: int, runs: int) -> dict[str, Any]:
    """Build time, memory and what was looked at, of one finder."""
    import volviz
    from volviz.isosurface.cells import CellRanges
    from volviz.isosurface.finders import FINDERS

    cells = CellRanges.of(volviz.Volume.from_array(data))
    seconds = []
    for _ in range(runs):
        start = time.process_time()
        finder = FINDERS[name].build(cells, None)
        seconds.append(time.process_time() - start)
    looked, worst, query = [], 0.0, 0.0
    for isovalue in np.quantile(data[::2, ::2, ::2], np.linspace(0.1, 0.9, 9)).tolist():
        start = time.process_time()
        active = finder(isovalue).size
        query = max(query, time.process_time() - start)
        looked.append((active, finder.report.visited))
        if name in BOUNDS:
            bound = BOUNDS[name][0](cells.count, active, max(cells.shape), distinct)
            worst = max(worst, finder.report.visited / bound)
    active, visited = max(looked)
    made = {"seconds": min(seconds), "nbytes": finder.report.nbytes, "query": query}
    return made | {"active": active, "visited": visited, "worst": worst}


def trees() -> None:
    """How many nodes the octrees have, against the cells."""
    from volviz.isosurface.finders import bono, octree

    print("\n| cells | nodes of BONO | nodes / cells | nodes of the full octree |")
    print("|---|---|---|---|")
    for shape in ((320, 320, 40), (32,) * 3, (33,) * 3, (255,) * 3, (256,) * 3, (511,) * 3):
        count = bono.nodes(shape)
        sides = " × ".join(str(n) for n in shape)
        print(f"| {sides} | {count} | {count / prod(shape):.4f} | {octree.nodes(shape)} |")


def main(arguments: list[str]) -> None:
    """Run all finders and print a table per field."""
    from volviz.isosurface.finders import FINDERS

    parser = argparse.ArgumentParser(prog="python -m tests.bench finders")
    parser.add_argument("fields", nargs="*", help=f"any part of {', '.join(FIELDS)}")
    parser.add_argument("--sizes", type=int, nargs="*", default=SIZES)
    parser.add_argument("--runs", type=int, default=1)
    chosen = parser.parse_args(arguments)
    for name in FINDERS:
        row(name, sphere(8), 2, 1)  # compiles
        row(name, np.rint(8 * sphere(8)).astype(np.int16), 2, 1)
    for field, make in FIELDS.items():
        if chosen.fields and not any(part in field for part in chosen.fields):
            continue
        grids = [make(n) for n in chosen.sizes]
        values = [np.unique(g).size for g in grids]
        sides = ", ".join(f"{n}³" for n in chosen.sizes)
        print(f"\n{field}, samples {sides}; looked at in the largest\n")
        print("| finder | build s | MB | query ms | active k | visited | bound | × bound |")
        print("|---|---|---|---|---|---|---|---|", flush=True)
        for name in FINDERS:
            rows = [row(name, g, h, chosen.runs) for g, h in zip(grids, values, strict=True)]
            seconds = " / ".join(f"{r['seconds']:.2f}" for r in rows)
            memory = " / ".join(f"{r['nbytes'] / 1e6:.3g}" for r in rows)
            last, bound = rows[-1], BOUNDS[name][1] if name in BOUNDS else "none"
            worst = f"{max(r['worst'] for r in rows):.3f}" if name in BOUNDS else "–"
            print(
                f"| {name} | {seconds} | {memory} | {1000 * last['query']:.1f} "
                f"| {last['active']} | {last['visited']} | {bound} | {worst} |",
                flush=True,
            )
    trees()
