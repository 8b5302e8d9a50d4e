"""What every finder is once it is built: isovalue in, sorted cell ids out, and what that took."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.kernel import threshold
from volviz.isosurface.trace import Trace
from volviz.progress import Progress, silent

Ids = NDArray[np.int64]


class Find(Protocol):
    """The search of a finder."""

    def __call__(
        self, limit: Any, report: Progress, trace: Trace | None = None, /
    ) -> tuple[Ids, int]:
        """The active cells, in order, and how many cells and nodes were looked at."""


@dataclass(frozen=True)
class Report:
    """cells: how many the grid has. nbytes: memory of the structure. visited: cells (or, where
    the structure has nodes, cells and nodes) that the last query looked at; active: found by it."""

    name: str
    cells: int
    build_seconds: float = 0.0
    nbytes: int = 0
    visited: int = 0
    active: int = 0


class Finder:
    """Call it with an isovalue: sorted int64 ids of the active cells (`cells.py`).

    find: takes the isovalue as the least value of the grid's dtype that is at least as high.
    """

    def __init__(self, name: str, cells: CellRanges, find: Find, seconds: float, nbytes: int):
        self.cells = cells
        self.report = Report(name, cells.count, seconds, nbytes)
        self._find = find

    def __call__(self, isovalue: float, progress: Progress | None = None) -> Ids:
        """The active cells of this isovalue. Raises Cancelled."""
        ids, self.report = self._search(isovalue, progress, None)
        return ids

    def followed(
        self, isovalue: float, trace: Trace | None, progress: Progress | None = None
    ) -> tuple[Ids, Report]:
        """The active cells and a report of this query alone; a trace is told what it looks at.

        It leaves `report` alone, so that it may run beside queries of others. Raises Cancelled.
        """
        return self._search(isovalue, progress, trace)

    def _search(
        self, isovalue: float, progress: Progress | None, trace: Trace | None
    ) -> tuple[Ids, Report]:
        limit = threshold(self.cells.dtype, isovalue)
        ids, visited = np.empty(0, dtype=np.int64), 0
        if limit is not None and self.cells.count:
            ids, visited = self._find(limit, progress or silent(), trace)
        return ids, replace(self.report, visited=visited, active=ids.size)
