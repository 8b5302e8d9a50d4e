"""Least and greatest value of each cell: all that a finder needs to know of a grid.

A cell is active, that is met by the surface, if some of its samples are at least the isovalue and
some are not: low < isovalue ≤ high. Cells with a sample that is not valid (NaN, infinite, padding)
have low > high and are never active. A volume's cells are numbered x first, then y, then z.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.fields.statistics import padding_value
from volviz.isosurface.kernel import in_slabs, kernel
from volviz.model.grids import TetMesh
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

Grid = Volume | TetMesh
Ranges = tuple[NDArray[Any], NDArray[Any]]
_CHUNK = 1 << 21  # cells at a time: a few megabytes beyond the grid


@dataclass(frozen=True, eq=False)
class CellRanges:
    """The cells of a grid. shape: cells along z, y, x of a volume, None for tetrahedra."""

    grid: Grid
    count: int
    shape: tuple[int, int, int] | None
    dtype: np.dtype[Any]

    @classmethod
    def of(cls, grid: Grid) -> CellRanges:
        """The cells of a volume or of tetrahedra."""
        if isinstance(grid, TetMesh):
            return cls(grid, len(grid.cells), None, grid.values.dtype)
        z, y, x = (n - 1 for n in grid.data.shape)
        return cls(grid, z * y * x, (z, y, x), grid.data.dtype)

    def chunks(self, progress: Progress | None = None) -> Iterator[tuple[int, Ranges]]:
        """(first cell, (low, high)) piece by piece, in order, in the grid's own dtype."""
        report = progress or silent()
        if self.count == 0:
            return
        layer = 1 if self.shape is None else self.shape[1] * self.shape[2]
        step = max(1, _CHUNK // layer)
        for start in range(0, self.count // layer, step):
            report(start * layer / self.count, "cells")
            end = min(start + step, self.count // layer)
            yield start * layer, self._ranges(start, end, report.part(0, 0))

    def arrays(self, progress: Progress | None = None) -> Ranges:
        """(low, high) of all cells."""
        low = np.empty(self.count, dtype=self.dtype)
        high = np.empty(self.count, dtype=self.dtype)
        for first, (a, b) in self.chunks(progress):
            low[first : first + a.size], high[first : first + b.size] = a, b
        return low, high

    def _ranges(self, start: int, end: int, report: Progress) -> Ranges:
        if isinstance(self.grid, TetMesh):
            return _of_tetrahedra(self.grid.values[self.grid.cells[start:end]])
        assert self.shape is not None
        low = np.empty((end - start, *self.shape[1:]), dtype=self.dtype)
        high = np.empty_like(low)
        padding = padding_value(self.grid)
        blank = self.dtype.type(0) if padding is None else padding
        data, ends, padded = self.grid.data, nothing(self.dtype), padding is not None

        def task(a: int, b: int) -> None:
            box_ranges(data, blank, padded, ends, start + a, start + b, low[a:b], high[a:b])

        in_slabs(task, end - start, self.shape[1] * self.shape[2], report, "cells")
        return low.reshape(-1), high.reshape(-1)


def nothing(dtype: np.dtype[Any]) -> tuple[Any, Any]:
    """(low, high) of a cell that is never active."""
    if dtype.kind == "f":
        return dtype.type(np.inf), dtype.type(-np.inf)
    return dtype.type(np.iinfo(dtype).max), dtype.type(np.iinfo(dtype).min)


def active(low: NDArray[Any], high: NDArray[Any], limit: Any) -> NDArray[np.bool_]:
    """Which ranges contain the isovalue; limit: `kernel.threshold` of it."""
    return (low < limit) & (limit <= high)


def _of_tetrahedra(corners: NDArray[Any]) -> Ranges:
    low, high = corners.min(axis=1), corners.max(axis=1)
    if corners.dtype.kind == "f":
        bad = ~np.isfinite(corners).all(axis=1)
        low[bad], high[bad] = nothing(corners.dtype)
    return low, high


@kernel
def box_ranges(
    data: Any, blank: Any, padded: bool, ends: Any, first: int, last: int, low: Any, high: Any
) -> None:
    """Ranges of the cells of layers first..last into low and high [z, y, x]."""
    nx = data.shape[2]
    least, most, bad = np.empty(nx, data.dtype), np.empty(nx, data.dtype), np.empty(nx, np.bool_)
    for z in range(first, last):
        for y in range(data.shape[1] - 1):
            a, b = data[z, y], data[z, y + 1]
            c, d = data[z + 1, y], data[z + 1, y + 1]
            for x in range(nx):
                least[x] = min(a[x], b[x], c[x], d[x])
                most[x] = max(a[x], b[x], c[x], d[x])
                bad[x] = (
                    ((a[x] - a[x]) != 0)
                    | ((b[x] - b[x]) != 0)
                    | ((c[x] - c[x]) != 0)
                    | ((d[x] - d[x]) != 0)
                )
            if padded:
                for x in range(nx):
                    bad[x] |= a[x] == blank or b[x] == blank or c[x] == blank or d[x] == blank
            low_row, high_row = low[z - first, y], high[z - first, y]
            for x in range(nx - 1):
                low_row[x] = min(least[x], least[x + 1])
                high_row[x] = max(most[x], most[x + 1])
            for x in range(nx - 1):
                if bad[x] or bad[x + 1]:
                    low_row[x], high_row[x] = ends
