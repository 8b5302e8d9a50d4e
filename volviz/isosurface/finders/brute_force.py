"""Every cell is looked at, every time: what the other finders are compared with."""

from __future__ import annotations

import numpy as np

from volviz.isosurface.cells import CellRanges, active
from volviz.isosurface.finder import Finder, Ids
from volviz.isosurface.trace import Trace
from volviz.progress import Progress


def build(cells: CellRanges, progress: Progress | None = None) -> Finder:
    """Nothing to build."""

    def find(limit: object, report: Progress, trace: Trace | None = None) -> tuple[Ids, int]:
        found = []
        for first, (low, high) in cells.chunks(report):
            found.append(first + np.flatnonzero(active(low, high, limit)))
            if trace is not None:
                trace.tested(np.arange(first, first + low.size))
        return np.concatenate(found).astype(np.int64), cells.count

    return Finder("brute-force", cells, find, 0.0, 0)
