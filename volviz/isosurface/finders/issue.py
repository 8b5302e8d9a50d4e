"""The lattice of span space: most of what is active is reported without a test.

Shen, Hansen, Livnat, Johnson (Isosurfacing in span space with utmost efficiency, 1996). Both axes
are cut at the same L − 1 values, between which equally many ends of cells lie (equal lengths
would put most of a CT in few parts). A query that falls into part r reports of each row i < r a
prefix by descending high ends, of row r a prefix by ascending low ends, and searches the kd-tree
of the diagonal part (r, r): O(k + L + √m) where that part has m cells.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finder import Finder
from volviz.isosurface.finders import noise
from volviz.isosurface.finders.span import Points, Search, span_finder
from volviz.isosurface.trace import Trace
from volviz.progress import Progress

_SIDE = 256  # the most parts along an axis


def build(cells: CellRanges, progress: Progress | None = None) -> Finder:
    """Sorts all cells that can be active into the lattice, those off its diagonal twice."""
    return span_finder("issue", cells, index, progress)


def index(points: Points) -> tuple[Search, int]:
    """The lattice of these cells."""
    cuts = cuts_of(points)
    row, column = (np.searchsorted(cuts, a, "right") for a in (points.low, points.high))
    rows = np.arange(cuts.size + 2)
    off = np.flatnonzero(row != column)
    low, high = points.low[off], points.high[off]
    down, up = np.lexsort((-high, row[off])), np.lexsort((low, row[off]))
    starts = np.searchsorted(row[off][up], rows)
    by_high, keys_high = points.ids[off[down]], -high[down]
    by_low, keys_low = points.ids[off[up]], low[up]
    on = np.flatnonzero(row == column)
    on = on[np.argsort(row[on], kind="stable")]
    edges = np.searchsorted(row[on], rows)
    noise.arrange(points.low, points.high, on, edges)
    near, near_low, near_high = points.ids[on], points.low[on], points.high[on]

    def search(rank: int, trace: Trace | None = None) -> tuple[list[NDArray[Any]], int]:
        part = int(np.searchsorted(cuts, rank, "right"))
        found: list[NDArray[Any]] = []
        visited = 0
        for i in range(part):
            a, b = starts[i], starts[i + 1]
            end = a + np.searchsorted(keys_high[a:b], -rank, "right")
            visited += _prefix(by_high, a, end, b, found, trace)
        a, b = starts[part], starts[part + 1]
        end = a + np.searchsorted(keys_low[a:b], rank)
        visited += _prefix(by_low, a, end, b, found, trace)
        ends = edges[part : part + 2].tolist()
        at, tested = noise.places(near_low, near_high, rank, *ends)
        found.append(near[at])
        if trace is not None:
            noise.tell(trace, near, near_low, near_high, rank, *ends)
        return found, visited + tested

    kept = (cuts, starts, by_high, keys_high, by_low, keys_low, edges, near, near_low, near_high)
    return search, sum(a.nbytes for a in kept)


def _prefix(
    ids: NDArray[Any], first: Any, end: Any, last: Any, found: list[Any], trace: Trace | None
) -> int:
    """Take a prefix of the sorted list first … last; how many of it were looked at."""
    found.append(ids[first:end])
    if trace is not None:
        trace.reported(ids[first:end])
        trace.tested(ids[end : min(end + 1, last)])
    return int(end - first) + int(end < last)


def cuts_of(points: Points) -> NDArray[np.int32]:
    """Ranks at which parts begin: about √n parts, no more than 256, of equally many ends."""
    side = min(_SIDE, int(points.ids.size**0.5))
    if side < 2:
        return np.empty(0, dtype=np.int32)
    ends = np.sort(np.concatenate([points.low, points.high]))
    return np.unique(ends[np.arange(1, side) * ends.size // side])
