"""Active cells with their corners, piece by piece: for the extractors that are not in a hurry.

Marching cubes has bits for this (`signs.py`); the others take the ids of active cells, from a
finder or from a look at all cells, and work on a piece of them at a time with numpy.
"""

from __future__ import annotations

from collections.abc import Iterator
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError, UsageError
from volviz.fields.statistics import padding_value
from volviz.isosurface.cells import CellRanges, Grid
from volviz.isosurface.cells import active as crosses
from volviz.isosurface.kernel import threshold
from volviz.model.grids import TetMesh
from volviz.progress import Progress

Ids = NDArray[np.int64]
Floats = NDArray[np.float64]
PIECE = 1 << 15  # cells at a time: some megabytes, some tens of milliseconds
_skipped: WeakKeyDictionary[Grid, int] = WeakKeyDictionary()


def active_cells(grid: Grid, isovalue: float, cells: Ids | None, report: Progress) -> Ids:
    """Sorted ids of the cells that the surface meets, and whose samples are all valid.

    cells: sorted ids among which they all are, None to look at every cell. Raises UsageError for
    ids that are not sorted or not there, Cancelled.
    """
    ranges = CellRanges.of(grid)
    limit = threshold(ranges.dtype, isovalue)
    if limit is None or ranges.count == 0:
        return np.empty(0, dtype=np.int64)
    if cells is None:
        found = [
            first + np.flatnonzero(crosses(low, high, limit))
            for first, (low, high) in ranges.chunks(report)
        ]
        return np.concatenate(found)
    ids = np.ascontiguousarray(cells, dtype=np.int64)
    if ids.size and not (ids[0] >= 0 and ids[-1] < ranges.count and np.all(ids[1:] > ids[:-1])):
        raise UsageError(f"cell ids are sorted and go from 0 to {ranges.count - 1}", field="cells")
    kept = [np.empty(0, dtype=np.int64)]
    for piece in pieces(ids, report, "cells"):
        values, good = _samples(grid, piece)
        inside = values >= limit
        kept.append(piece[good.all(axis=1) & inside.any(axis=1) & ~inside.all(axis=1)])
    return np.concatenate(kept)


def skipped_cells(grid: Grid, report: Progress) -> int:
    """How many cells are left out because a sample is not valid; remembered with the grid."""
    if grid not in _skipped:
        ranges = CellRanges.of(grid)
        sure = ranges.dtype.kind != "f" and (
            isinstance(grid, TetMesh) or padding_value(grid) is None
        )
        chunks = () if sure else ranges.chunks(report)
        _skipped[grid] = sum(int(np.count_nonzero(low > high)) for _, (low, high) in chunks)
    return _skipped[grid]


def pieces(ids: Ids, report: Progress, message: str, size: int = PIECE) -> Iterator[Ids]:
    """The ids, some at a time, with progress. Raises Cancelled."""
    for start in range(0, ids.size, size):
        report(start / ids.size, message)
        yield ids[start : start + size]


def corner_samples(shape: tuple[int, ...], ids: Ids) -> Ids:
    """int64[n, 8]: flat numbers of the samples at the corners x + 2y + 4z of a volume's cells."""
    z, y, x = np.unravel_index(ids, tuple(n - 1 for n in shape))
    first = (z * shape[1] + y) * shape[2] + x
    layer = shape[1] * shape[2]
    steps = [(c & 1) + (c >> 1 & 1) * shape[2] + (c >> 2 & 1) * layer for c in range(8)]
    return np.asarray(first[:, None] + np.array(steps), dtype=np.int64)


def places(shape: tuple[int, ...], samples: Ids) -> Floats:
    """float64[..., 3]: x, y, z of samples by their flat numbers."""
    z, y, x = np.unravel_index(samples, shape)
    return np.stack([x, y, z], axis=-1).astype(np.float64)


def to_world(affine: Floats, index: Floats) -> Floats:
    """World mm of index coordinates x, y, z; float64[..., 3] both."""
    return np.asarray(index @ affine[:3, :3].T + affine[:3, 3])


def mirrored(affine: Floats) -> bool:
    """True if the map turns a right hand into a left one."""
    axes = affine[:3, :3] / np.linalg.norm(affine[:3, :3], axis=0)
    return bool(np.linalg.det(axes) < 0)


def numbered(keys: Ids) -> tuple[Ids, NDArray[np.uint32]]:
    """(each key once, sorted; the number of each given key in them, in the shape of the keys).

    Raises LimitError where 32 bits do not number them.
    """
    known, numbers = np.unique(keys, return_inverse=True)
    if known.size >= 1 << 32:
        raise LimitError(
            f"the surface has {known.size} vertices, more than 32 bits can number",
            fix="choose another isovalue or a smaller region",
        )
    return known, numbers.reshape(keys.shape).astype(np.uint32)


def averaged_normals(
    points: Floats, faces: NDArray[np.uint32], outward: Floats
) -> NDArray[np.float32]:
    """float32[n, 3]: the mean of the normals of a vertex's triangles, weighted by area.

    points: float64[n, 3], mm. outward: float64[n, 3], some way out of the solid at each vertex,
    of any length, for vertices all of whose triangles have no area.
    """
    a, b, c = (points[faces[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    total = np.empty_like(points)
    for axis in range(3):
        weights = np.repeat(flat[:, axis], 3)
        total[:, axis] = np.bincount(faces.ravel(), weights, minlength=len(points))
    length = np.linalg.norm(total, axis=1)
    size = np.abs(points).max(initial=0.0) * 1e-7
    poor = ~(length > size * size)
    total[poor], length[poor] = outward[poor], np.linalg.norm(outward[poor], axis=1)
    length[length == 0] = 1
    return (total / length[:, None]).astype(np.float32)


def _samples(grid: Grid, ids: Ids) -> tuple[NDArray[np.generic], NDArray[np.bool_]]:
    """Values at the corners of cells, and which of them are valid."""
    if isinstance(grid, TetMesh):
        values = grid.values[grid.cells[ids]]
        return values, np.isfinite(values)
    values = grid.data.reshape(-1)[corner_samples(grid.data.shape, ids)]
    padding = padding_value(grid)
    good = np.isfinite(values)
    return values, good if padding is None else good & (values != padding)
