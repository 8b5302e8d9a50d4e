"""Trees over boxes of cells, without pointers: what `octree` and `bono` have in common.

A level is a lattice of nodes; along each axis a node covers the cells from its start to the next
one. The starts of a coarse level are among those of the finer one, so a node has one or two
children along an axis and the place of a node says where they are. Leaves cover up to 2×2×2 cells
of a volume. Tetrahedra are sorted into boxes of space by their centroids, about as many boxes as
cells, which then take the place of cells.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.fields.statistics import padding_value
from volviz.isosurface.cells import CellRanges, active, nothing
from volviz.isosurface.finder import Finder, Ids
from volviz.isosurface.kernel import in_slabs, kernel
from volviz.isosurface.trace import Trace, corners
from volviz.model.grids import TetMesh
from volviz.progress import Progress, silent

Shape = tuple[int, ...]
Starts = tuple[NDArray[np.int64], ...]
Divide = Callable[[Shape], list[Starts]]
"""Starts of the nodes of all levels along z, y, x, the leaves first, the root last."""


@dataclass(frozen=True, eq=False)
class Level:
    """low, high: [z, y, x] per node; starts: first child (first cell, of leaves), and the end."""

    low: NDArray[Any]
    high: NDArray[Any]
    starts: Starts


@dataclass(frozen=True, eq=False)
class Boxes:
    """Tetrahedra by box of space: those of box b are order[starts[b] : starts[b + 1]]."""

    shape: Shape
    order: Ids
    starts: Ids


def tree(
    name: str, cells: CellRanges, divide: Divide, cube: bool, progress: Progress | None
) -> Finder:
    """A finder over the levels of `divide`; cube: boxes of tetrahedra are 2ⁱ along each axis."""
    begin = time.perf_counter()
    report = progress or silent()
    boxes = boxes_of(cells.grid, cube) if isinstance(cells.grid, TetMesh) else None
    levels: list[Level] = []
    if cells.count:
        levels = _levels(cells, boxes, divide, report)

    def find(limit: Any, report: Progress, trace: Trace | None = None) -> tuple[Ids, int]:
        nodes, visited = np.zeros(1, dtype=np.int64), 0
        for i in reversed(range(len(levels))):
            report(None, "active cells")
            level, visited = levels[i], visited + nodes.size
            low, high = level.low.reshape(-1)[nodes], level.high.reshape(-1)[nodes]
            fine = levels[i - 1].low.shape if i else tuple(int(s[-1]) for s in level.starts)
            hit = active(low, high, limit)
            if trace is not None and boxes is None:
                _tell(trace, levels[: i + 1], nodes, hit)
            nodes = _children(nodes[hit], level, fine)
        ids = nodes if boxes is None else _members(nodes, boxes)
        if trace is not None:
            trace.tested(ids)
        return np.sort(among(cells, ids, limit, report)), visited + ids.size

    nbytes = sum(level.low.nbytes + level.high.nbytes for level in levels)
    nbytes += sum(s.nbytes for level in levels for s in level.starts)
    nbytes += boxes.order.nbytes + boxes.starts.nbytes if boxes else 0
    return Finder(name, cells, find, time.perf_counter() - begin, nbytes)


def _tell(trace: Trace, levels: list[Level], nodes: Ids, hit: NDArray[np.bool_]) -> None:
    """Nodes of the last of these levels, as boxes of cells."""
    starts = levels[0].starts
    for level in levels[1:]:
        starts = tuple(s[a] for s, a in zip(starts, level.starts, strict=True))
    at = np.unravel_index(nodes, levels[-1].low.shape)
    boxes = corners(starts, at)
    side = 1 << len(levels)
    trace.level(side, nodes.size, (boxes[0][hit], boxes[1][hit]), (boxes[0][~hit], boxes[1][~hit]))


def among(cells: CellRanges, ids: Ids, limit: Any, report: Progress) -> Ids:
    """Which of these cells are active, by their samples; order kept."""
    grid = cells.grid

    def of_tetrahedra(a: int, b: int) -> Ids:
        part = ids[a:b]
        corners = grid.values[grid.cells[part]]  # type: ignore[union-attr]
        inside, good = corners >= limit, np.isfinite(corners).all(axis=1)
        return part[inside.any(axis=1) & ~inside.all(axis=1) & good]

    def of_volume(a: int, b: int) -> Ids:
        out = np.empty(b - a, dtype=np.int64)
        return out[: _test(grid.data, blank, padded, limit, ids[a:b], out)]  # type: ignore[union-attr]

    padding = None if isinstance(grid, TetMesh) else padding_value(grid)
    blank, padded = cells.dtype.type(0) if padding is None else padding, padding is not None
    task = of_tetrahedra if isinstance(grid, TetMesh) else of_volume
    found = in_slabs(task, ids.size, 8, report, "active cells")
    return np.concatenate(found) if found else ids


def boxes_of(grid: TetMesh, cube: bool) -> Boxes:
    """Boxes of the space that the centroids take, about one per tetrahedron."""
    points = np.nan_to_num(grid.vertices.astype(np.float64), posinf=0, neginf=0)
    middle = points[grid.cells].mean(axis=1)[:, ::-1]
    count = max(len(middle), 1)
    least = middle.min(axis=0, initial=np.inf)
    extent = np.maximum(middle.max(axis=0, initial=-np.inf) - least, 0)
    halvings = max(0, round(np.log2(count) / 3))
    shape = np.full(3, 1 << halvings) if cube else _cubes(extent, count)
    place = np.divide(middle - least, extent, where=extent > 0, out=np.zeros_like(middle))
    at = np.minimum((place * shape).astype(np.int64), shape - 1)
    box = np.ravel_multi_index(tuple(at.T), tuple(shape.tolist()))
    order = np.argsort(box, kind="stable")
    starts = np.searchsorted(box[order], np.arange(int(np.prod(shape)) + 1))
    return Boxes(tuple(shape.tolist()), order, starts)


def _cubes(extent: NDArray[np.float64], count: int) -> NDArray[np.int64]:
    """How many cubes along each axis, about `count` in all; one where it is too thin for more."""
    wide, ratio = extent > 0, np.zeros(3)
    while wide.any():
        scaled = extent[wide] / extent.max()
        ratio[:] = 0
        ratio[wide] = scaled * (count / np.prod(scaled)) ** (1 / scaled.size)
        if (ratio[wide] >= 1).all():
            break
        wide &= ratio >= 1
    return np.maximum(np.ceil(ratio), 1).astype(np.int64)


def _levels(
    cells: CellRanges, boxes: Boxes | None, divide: Divide, report: Progress
) -> list[Level]:
    shape = cells.shape if boxes is None else boxes.shape
    assert shape is not None
    plan = divide(shape)
    low, high = _leaves(cells, boxes, plan[0], report)
    ends = tuple(np.append(s, n) for s, n in zip(plan[0], shape, strict=True))
    levels = [Level(low, high, ends)]
    for fine, coarse in pairwise(plan):
        report(None, "nodes")
        at = [np.searchsorted(f, c) for f, c in zip(fine, coarse, strict=True)]
        low, high = _reduced(np.minimum, low, at), _reduced(np.maximum, high, at)
        ends = tuple(np.append(a, f.size) for a, f in zip(at, fine, strict=True))
        levels.append(Level(low, high, ends))
    return levels


def _leaves(
    cells: CellRanges, boxes: Boxes | None, starts: Starts, report: Progress
) -> tuple[NDArray[Any], NDArray[Any]]:
    if boxes is not None:
        low, high = _of_boxes(cells, boxes, report)
        return _reduced(np.minimum, low, starts), _reduced(np.maximum, high, starts)
    assert cells.shape is not None
    ends = nothing(cells.dtype)
    low, high = (np.full([s.size for s in starts], end, dtype=cells.dtype) for end in ends)
    layer = cells.shape[1] * cells.shape[2]
    for first, (least, most) in cells.chunks(report):
        least, most = (a.reshape(-1, *cells.shape[1:]) for a in (least, most))
        leaf = np.searchsorted(starts[0], first // layer + np.arange(len(least)), "right") - 1
        for ufunc, values, out in ((np.minimum, least, low), (np.maximum, most, high)):
            ufunc.at(out, leaf, _reduced(ufunc, values, (None, *starts[1:])))
    return low, high


def _of_boxes(
    cells: CellRanges, boxes: Boxes, report: Progress
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Ranges of the tetrahedra of each box."""
    ends, full = nothing(cells.dtype), np.flatnonzero(np.diff(boxes.starts))
    pair = []
    for ufunc, values, end in zip(
        (np.minimum, np.maximum), cells.arrays(report), ends, strict=True
    ):
        out = np.full(boxes.starts.size - 1, end, dtype=cells.dtype)
        out[full] = ufunc.reduceat(values[boxes.order], boxes.starts[full])
        pair.append(out.reshape(boxes.shape))
    return pair[0], pair[1]


def _reduced(ufunc: Any, values: NDArray[Any], starts: Any) -> NDArray[Any]:
    for axis in (2, 1, 0):
        if starts[axis] is not None:
            values = ufunc.reduceat(values, starts[axis], axis=axis)
    return values


def _children(nodes: Ids, level: Level, fine: Shape) -> Ids:
    """Places of the children in the lattice `fine`."""
    at = np.unravel_index(nodes, level.low.shape)
    found = []
    for offset in np.ndindex(2, 2, 2):
        child = [s[a] + o for s, a, o in zip(level.starts, at, offset, strict=True)]
        ends = [s[a + 1] for s, a in zip(level.starts, at, strict=True)]
        inside = np.logical_and.reduce([c < e for c, e in zip(child, ends, strict=True)])
        found.append(((child[0] * fine[1] + child[1]) * fine[2] + child[2])[inside])
    return np.concatenate(found)


def _members(places: Ids, boxes: Boxes) -> Ids:
    first, count = boxes.starts[places], boxes.starts[places + 1] - boxes.starts[places]
    before = np.cumsum(count) - count
    return boxes.order[np.repeat(first - before, count) + np.arange(int(count.sum()))]


@kernel
def _test(data: Any, blank: Any, padded: bool, limit: Any, ids: Any, out: Any) -> int:
    """Those of the cells that are active, to the front of out; how many."""
    ny, nx = data.shape[1] - 1, data.shape[2] - 1
    at = 0
    for cell in ids:
        x, y, z = cell % nx, cell // nx % ny, cell // (nx * ny)
        inside, good = 0, True
        for i in range(8):
            value = data[z + (i >> 2), y + ((i >> 1) & 1), x + (i & 1)]
            inside += value >= limit
            good &= (value - value) == 0 and not (padded and value == blank)
        out[at] = cell
        at += good and 0 < inside < 8
    return at
