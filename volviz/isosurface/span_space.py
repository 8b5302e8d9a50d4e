"""Span space to look at: how many cells have which least and greatest value, and what a query is.

Each cell is a point (low, high) on or above the diagonal. The active cells of an isovalue are
those of the rectangle low < isovalue ≤ high, its corner on the diagonal (Livnat, Shen, Johnson,
A near optimal isosurface extraction algorithm using the span space, 1996).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.cells import CellRanges
from volviz.progress import Progress, silent

OUTSIDE, EDGE, INSIDE = 0, 1, 2


@dataclass(frozen=True, eq=False)
class SpanSpace:
    """counts: int64[high, low], cells per bin. edges: float64[bins + 1], values, of both axes.

    A bin has the values from its lower edge up to, without, its upper one; the last has both.
    """

    counts: NDArray[np.int64]
    edges: NDArray[np.float64]

    def rectangle(self, isovalue: float) -> tuple[float, float, float, float]:
        """(low from, low to, high from, high to) of the query, cut to the edges."""
        least, most = float(self.edges[0]), float(self.edges[-1])
        corner = min(max(isovalue, least), most)
        return least, corner, corner, most

    def visited(self, isovalue: float) -> NDArray[np.uint8]:
        """uint8[high, low]: what a search of span space looks at.

        INSIDE: bins of which every cell is active, which need no test; EDGE: bins that may have
        some active cells, whose cells or whose sorted ends are tested; OUTSIDE: not looked at.
        """
        first, last = self.edges[:-1], self.edges[1:].copy()
        last[-1] = np.nextafter(last[-1], np.inf)
        some = (first < isovalue)[None, :] & (last > isovalue)[:, None]
        every = (last <= isovalue)[None, :] & (first >= isovalue)[:, None]
        return np.where(every, INSIDE, np.where(some, EDGE, OUTSIDE)).astype(np.uint8)


def span_space(
    cells: CellRanges,
    bins: int = 128,
    ids: NDArray[np.int64] | None = None,
    progress: Progress | None = None,
) -> SpanSpace:
    """Count the cells in bins × bins of equal size over the values of all valid cells.

    ids: only these cells (the active ones, or those that a finder looked at), over the same bins.
    Cells with a sample that is not valid are not counted. Raises Cancelled.
    """
    report = progress or silent()
    edges = edges_of(cells, bins, report.part(0, 0.5))
    chosen = None
    if ids is not None:
        chosen = np.zeros(cells.count, dtype=np.bool_)
        chosen[ids] = True
    counts = np.zeros(bins * bins, dtype=np.int64)
    for first, (low, high) in cells.chunks(report.part(0.5, 1)):
        counted = low <= high
        if chosen is not None:
            counted &= chosen[first : first + low.size]
        counts += np.bincount(numbers(edges, low[counted], high[counted]), minlength=bins * bins)
    return SpanSpace(counts.reshape(bins, bins), edges)


def edges_of(cells: CellRanges, bins: int, report: Progress) -> NDArray[np.float64]:
    """float64[bins + 1]: bins of equal size over the values of all valid cells."""
    least, most = np.inf, -np.inf
    for _, (low, high) in cells.chunks(report):
        valid = low <= high
        if valid.any():
            least, most = min(least, low[valid].min()), max(most, high[valid].max())
    least, most = float(least), float(most)
    if not least <= most:
        least, most = 0.0, 0.0
    return np.linspace(least, most if most > least else least + 1, bins + 1)


def numbers(edges: NDArray[np.float64], low: NDArray[Any], high: NDArray[Any]) -> NDArray[np.int64]:
    """Which bin each cell is in, row · bins + column."""
    bins = edges.size - 1
    column, row = (
        np.clip(np.searchsorted(edges, ends, "right") - 1, 0, bins - 1) for ends in (low, high)
    )
    return row * bins + column
