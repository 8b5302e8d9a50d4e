"""Cells sorted by least and by greatest value, in classes of like span.

Two sorted lists as of Giles and Haimes (Advanced interactive visualization for CFD, 1990): a cell
of span at most w that is active at r has its low end in r − w … r − 1 and its high end in
r … r + w − 1; the shorter of the two stretches is looked at. Lists per class of span as of
Gallagher (Span filtering, 1991), each twice as wide as the one before, so that a few wide cells
do not make all stretches long. Spans are counted in ranks of distinct values.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finder import Finder
from volviz.isosurface.finders.span import Points, Search, span_finder
from volviz.isosurface.trace import Trace
from volviz.progress import Progress


def build(cells: CellRanges, progress: Progress | None = None) -> Finder:
    """Sorts all cells that can be active, twice."""
    return span_finder("intervals", cells, index, progress)


def index(points: Points) -> tuple[Search, int]:
    """Both lists of every class."""
    wide = np.frexp((points.high - points.low).astype(np.float64))[1]  # span < 2**wide
    lists = [_by_ends(points, wide == w, (1 << int(w)) - 1) for w in np.unique(wide)]

    def search(rank: int, trace: Trace | None = None) -> tuple[list[NDArray[Any]], int]:
        found, visited = [], 0
        for span, by_low, by_high in lists:
            a, b = np.searchsorted(by_low[1], (rank - span, rank))
            c, d = np.searchsorted(by_high[2], (rank, rank + span))
            ids, low, high = (
                (array[a:b] for array in by_low)
                if b - a <= d - c
                else (array[c:d] for array in by_high)
            )
            visited += ids.size
            if trace is not None:
                trace.tested(ids)
            found.append(ids[(low < rank) & (rank <= high)])
        return found, visited

    return search, sum(a.nbytes for _, *pair in lists for arrays in pair for a in arrays)


def _by_ends(points: Points, chosen: NDArray[np.bool_], span: int) -> tuple[int, Any, Any]:
    arrays = [a[chosen] for a in (points.ids, points.low, points.high)]
    by_low, by_high = (np.argsort(a, kind="stable") for a in arrays[1:])
    return span, [a[by_low] for a in arrays], [a[by_high] for a in arrays]
