"""What a finder looks at for one isovalue, cell by cell as it really does, told by bins of span
space and by nodes of its tree.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finder import Finder, Report
from volviz.isosurface.span_space import SpanSpace, edges_of, numbers
from volviz.isosurface.trace import Corners, Trace
from volviz.progress import Progress, silent

BINS = 128
MOST_NODES = 20_000
"""Nodes of a level that are listed one by one."""
_PIECE = 1 << 21


@dataclass(frozen=True, eq=False)
class Binned:
    """Span space, and where in it each cell is. of_cell: uint16 (uint32 beyond 255 bins), the
    number row · bins + column of its bin, bins² for cells that are not valid."""

    space: SpanSpace
    of_cell: NDArray[Any]


@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of one level that cover about side³ cells. looked_at: how many were tested; count: how
    many of them have the isovalue in their range. active, idle: int32[n, 2, 3], first and last
    sample (x, y, z) of those with it and without it; None where they are too many to be listed."""

    side: int
    looked_at: int
    count: int
    active: NDArray[np.int32] | None
    idle: NDArray[np.int32] | None


@dataclass(frozen=True, eq=False)
class Visits:
    """One query. tested, reported: int64[high, low], cells per bin of which an end or a sample was
    compared with the isovalue, and active cells that were taken without. levels: the root first;
    none where the finder has no nodes in space."""

    isovalue: float
    report: Report
    tested: NDArray[np.int64]
    reported: NDArray[np.int64]
    levels: tuple[Nodes, ...]


def binned(
    cells: CellRanges,
    bins: int = BINS,
    progress: Progress | None = None,
    *,
    span: tuple[float, float] | None = None,
) -> Binned:
    """Count the cells in bins × bins, and remember where each is: two bytes per cell.

    span: values at which the axes begin and end, the outermost bins then have what lies beyond
    (default: all values). Of whole numbers each bin has equally many, so there may be fewer bins:
    with one more here and there, their counts would show stripes. Raises Cancelled.
    """
    report = progress or silent()
    if span is None:
        edges = edges_of(cells, bins, report.part(0, 0.4))
    else:
        edges = _even(*span, bins) if cells.dtype.kind in "ui" else np.linspace(*span, bins + 1)
    bins = edges.size - 1
    nowhere = bins * bins
    of_cell = np.full(cells.count, nowhere, np.uint16 if nowhere < 1 << 16 else np.uint32)
    counts = np.zeros(nowhere + 1, dtype=np.int64)
    for first, (low, high) in cells.chunks(report.part(0.4, 1)):
        part = of_cell[first : first + low.size]
        valid = low <= high
        part[valid] = numbers(edges, low[valid], high[valid])
        counts += np.bincount(part, minlength=nowhere + 1)
    return Binned(SpanSpace(counts[:-1].reshape(bins, bins), edges), of_cell)


def _even(low: float, high: float, bins: int) -> NDArray[np.float64]:
    """Edges halfway between whole numbers, as many of these in each of at most so many bins."""
    first, last = np.floor(low), np.ceil(high)
    step = max(np.ceil((last - first + 1) / bins), 1.0)
    return np.asarray(first - 0.5 + step * np.arange(np.ceil((last - first + 1) / step) + 1))


def visits(
    finder: Finder, where: Binned, isovalue: float, progress: Progress | None = None
) -> Visits:
    """Search once and watch what the search looks at. where: of the same cells. Raises Cancelled.

    What the search of `intervals` to `issue` finds by halving sorted lists is counted as taken
    without a test, but for the one cell at which each list ends.
    """
    watching = _Watching(where, progress or silent())
    _, report = finder.followed(isovalue, watching, progress)
    shape = where.space.counts.shape
    return Visits(
        isovalue,
        report,
        watching.counts[0, :-1].reshape(shape),
        watching.counts[1, :-1].reshape(shape),
        tuple(watching.levels),
    )


@dataclass
class _Watching(Trace):
    where: Binned
    report: Progress
    levels: list[Nodes] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.counts = np.zeros((2, self.where.space.counts.size + 1), dtype=np.int64)

    def tested(self, ids: NDArray[Any]) -> None:
        self._count(0, ids)

    def reported(self, ids: NDArray[Any]) -> None:
        self._count(1, ids)

    def level(self, side: int, looked_at: int, active: Corners, idle: Corners | None) -> None:
        pair = _listed(active), None if idle is None else _listed(idle)
        self.levels.append(Nodes(side, looked_at, len(active[0]), *pair))

    def _count(self, kind: int, ids: NDArray[Any]) -> None:
        for start in range(0, ids.size, _PIECE):
            self.report(None, "what the search looks at")
            bins = self.where.of_cell[ids[start : start + _PIECE]]
            self.counts[kind] += np.bincount(bins, minlength=self.counts.shape[1])


def _listed(nodes: Corners) -> NDArray[np.int32] | None:
    return None if len(nodes[0]) > MOST_NODES else np.stack(nodes, axis=1).astype(np.int32)
