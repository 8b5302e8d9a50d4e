"""Cells as points (low, high) of span space, in ranks: what `intervals` to `issue` sort.

Ranks number the distinct values 0, 1, 2 …: int32 in place of any dtype, compared exactly, so that
one compiled kernel serves all. A cell is active at rank r if low < r ≤ high, r being that of the
least value that is at least the isovalue. Cells of one value, or with a sample that is not valid,
are never active and left out.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finder import Finder, Ids
from volviz.isosurface.kernel import in_slabs
from volviz.isosurface.trace import Trace
from volviz.progress import Progress, silent

Ranks = NDArray[np.int32]
T = TypeVar("T")


@dataclass(frozen=True, eq=False)
class Points:
    """ids: number of the cell; low, high: its ranks; values: what has rank 0, 1, 2 …"""

    ids: NDArray[Any]
    low: Ranks
    high: Ranks
    values: NDArray[Any]

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""
        return sum(a.nbytes for a in (self.ids, self.low, self.high, self.values))


Search = Callable[[int, Trace | None], tuple[list[NDArray[Any]], int]]
"""Rank in; pieces of ids of the active cells, and how many cells and nodes were looked at."""


def aside(work: Callable[[], T], report: Progress, message: str) -> T:
    """work() on another thread: a cancel does not wait for it."""
    result: T = in_slabs(lambda a, b: work(), 1, 1, report, message)[0]
    return result


def points_of(cells: CellRanges, report: Progress) -> Points:
    """The cells that are active at some isovalue."""
    low, high = cells.arrays(report.part(0, 0.4))

    def choose() -> tuple[Any, ...]:
        kept = np.flatnonzero(low < high)
        a, b = low[kept], high[kept]
        return kept.astype(id_type(cells.count)), a, b, np.unique(np.concatenate([a, b]))

    ids, low, high, values = aside(choose, report.part(0.4, 0.6), "values")
    return Points(
        ids,
        ranked(low, values, report.part(0.6, 0.8)),
        ranked(high, values, report.part(0.8, 1)),
        values,
    )


def ranked(array: NDArray[Any], values: NDArray[Any], report: Progress) -> Ranks:
    """The rank of each of these among the sorted `values`."""
    out = np.empty(array.size, dtype=np.int32)

    def task(a: int, b: int) -> None:
        out[a:b] = np.searchsorted(values, array[a:b])

    in_slabs(task, array.size, 1, report, "ranks")
    return out


def id_type(count: int) -> Any:
    """The smaller integer that numbers so many cells."""
    return np.int32 if count <= np.iinfo(np.int32).max else np.int64


def span_finder(
    name: str,
    cells: CellRanges,
    index: Callable[[Points], tuple[Search, int]],
    progress: Progress | None,
) -> Finder:
    """A finder that sorts points; index: the search over them, and the memory it keeps."""
    begin = time.perf_counter()
    report = progress or silent()
    points = points_of(cells, report.part(0, 0.7))
    search, nbytes = aside(lambda: index(points), report.part(0.7, 1), "sorting cells")
    values = points.values

    def find(limit: Any, report: Progress, trace: Trace | None = None) -> tuple[Ids, int]:
        rank = int(np.searchsorted(values, limit))
        if rank in (0, values.size):  # nothing below it, or nothing as high
            return np.empty(0, dtype=np.int64), 0
        return aside(lambda: gathered(*search(rank, trace)), report, "active cells")

    return Finder(name, cells, find, time.perf_counter() - begin, nbytes + values.nbytes)


def gathered(pieces: list[NDArray[Any]], visited: int) -> tuple[Ids, int]:
    """Pieces of ids as one sorted array."""
    if not pieces:
        return np.empty(0, dtype=np.int64), visited
    return np.sort(np.concatenate(pieces)).astype(np.int64), visited
