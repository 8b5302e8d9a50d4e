"""From seeds, over faces that the surface crosses, to all of each component.

Itoh and Koyamada (Automatic isosurface propagation using an extrema graph and sorted boundary cell
lists, 1995) walk breadth-first from cell to cell; their volume thinning (1996) and the seed sets
of Bajaj, Pascucci, Schikore (Fast isocontouring for improved interactivity, 1996) leave out cells
that a walk reaches anyway. So do we, in a way that holds for any cells, faces and values:

Cells are taken up one by one. One is left out if the ranges of its faces with cells that are not
left out so far cover its own range; then, at each isovalue that it is active for, one of those
faces is crossed, and the cell behind it is active, in the same component, and left out later or
never. Going on from there ends at a seed after finitely many steps: every component of every
isovalue has one. What was left out stays so, and a cell that had to be kept would have to be kept
later as well, so no seed can be spared afterwards.

An interval tree gives the seeds that are active. Values are kept as ranks (`span.py`), −1 where a
sample is not valid.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.fields.statistics import padding_value
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finder import Finder, Ids
from volviz.isosurface.finders.interval_tree import Tree
from volviz.isosurface.finders.span import Points, Ranks, aside, id_type, ranked
from volviz.isosurface.kernel import hot, kernel
from volviz.isosurface.trace import Trace
from volviz.model.grids import TetMesh
from volviz.progress import Progress, silent

_BATCH = 1 << 19  # cells between two looks at the cancel
Step = Callable[[int, Any, Ids, int, int, int], tuple[int, int]]
"""(rank, marks, queue, head, tail, count) → (head, tail): the next `count` cells of the walk."""


def build(cells: CellRanges, progress: Progress | None = None) -> Finder:
    """Ranks of the samples, faces of tetrahedra, and the seeds."""
    start = time.perf_counter()
    report = progress or silent()
    ranks, values = _ranks(cells, report.part(0, 0.4))
    ready = _of_tetrahedra if isinstance(cells.grid, TetMesh) else _of_volume
    step, kept, size = ready(cells, ranks, report.part(0.4, 0.9))
    seeds, extremes = aside(lambda: _seeds(cells, ranks, kept), report.part(0.9, 1), "seeds")

    def find(limit: Any, report: Progress, trace: Trace | None = None) -> tuple[Ids, int]:
        rank = int(np.searchsorted(values, limit))
        among = int(np.searchsorted(extremes, rank))
        if among in {0, extremes.size}:
            return np.empty(0, dtype=np.int64), 0
        pieces, visited = seeds.search(among)
        found = _walk(step, rank, np.concatenate(pieces), cells.count, report)
        if trace is not None:
            trace.tested(found)  # the walk reads the samples of each cell that it comes to
        return found, visited + found.size

    size += sum(a.nbytes for a in (ranks, values, seeds, extremes))
    return Finder("propagation", cells, find, time.perf_counter() - start, size)


def seeds_of(cells: CellRanges, progress: Progress | None = None) -> Ids:
    """Ids of the seeds: at every isovalue each component of the active cells has one."""
    report = progress or silent()
    ready = _of_tetrahedra if isinstance(cells.grid, TetMesh) else _of_volume
    return np.flatnonzero(ready(cells, _ranks(cells, report)[0], report)[1])


def _of_volume(
    cells: CellRanges, ranks: Ranks, report: Progress
) -> tuple[Step, NDArray[np.bool_], int]:
    """How to walk, which cells are seeds, and what the walk needs beyond the ranks."""
    kept = _whole(ranks)

    def task(a: int, b: int) -> None:
        thin_volume(ranks, kept, a, b)

    _thin(task, len(kept) if cells.count else 0, cells.count // max(len(kept), 1), report)

    def step(*state: Any) -> tuple[int, int]:
        head, tail = walk_volume(ranks, *state)
        return head, tail

    return step, kept.reshape(-1), 0


def _of_tetrahedra(
    cells: CellRanges, ranks: Ranks, report: Progress
) -> tuple[Step, NDArray[np.bool_], int]:
    assert isinstance(cells.grid, TetMesh)
    corners = cells.grid.cells
    kept: NDArray[np.bool_] = np.all(ranks[corners] >= 0, axis=1)
    faces = aside(lambda: neighbours(corners, kept), report.part(0, 0.4), "faces")

    def task(a: int, b: int) -> None:
        thin_tetrahedra(ranks, corners, faces, kept, a, b)

    _thin(task, cells.count, 1, report.part(0.4, 1))

    def step(*state: Any) -> tuple[int, int]:
        head, tail = walk_tetrahedra(ranks, corners, faces, *state)
        return head, tail

    return step, kept, faces.nbytes


def neighbours(corners: Ids, valid: NDArray[np.bool_]) -> NDArray[Any]:
    """int[cells, 4]: the valid cell behind the face without corner i; −1 if there is none.

    More than two cells with one face make a ring: each names the next one.
    """
    chosen = np.flatnonzero(valid)
    around = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]]
    triples = np.sort(corners[chosen][:, around].reshape(-1, 3), axis=1)
    order = np.lexsort(triples.T)
    triples = triples[order]
    first = np.append(True, (triples[1:] != triples[:-1]).any(axis=1))[: order.size]
    starts = np.flatnonzero(first)
    following = np.arange(1, order.size + 1)
    following[np.append(starts[1:], order.size)[: starts.size] - 1] = starts
    owner = chosen[order // 4]
    behind = np.full(order.size, -1, dtype=id_type(len(corners)))
    other = owner[following]
    behind[order] = np.where(other == owner, -1, other)
    out = np.full((len(corners), 4), -1, dtype=behind.dtype)
    out[chosen] = behind.reshape(-1, 4)
    return out


def _ranks(cells: CellRanges, report: Progress) -> tuple[Ranks, NDArray[Any]]:
    """Ranks of the samples in the grid's shape, and the values that they number."""
    if isinstance(cells.grid, TetMesh):
        data, valid = cells.grid.values, np.isfinite(cells.grid.values)
    else:
        data, padding = cells.grid.data, padding_value(cells.grid)
        valid = np.isfinite(data)
        if padding is not None:
            valid &= data != padding
    values = aside(lambda: np.unique(data[valid]), report, "values")
    ranks = ranked(data.reshape(-1), values, report).reshape(data.shape)
    ranks[~valid] = -1
    return ranks, values


def _whole(ranks: Ranks) -> NDArray[np.bool_]:
    """Which cells of a volume have valid samples only."""
    whole = ranks >= 0
    for axis in range(3):
        whole = np.logical_and(
            *(np.take(whole, np.arange(whole.shape[axis] - 1) + i, axis) for i in (0, 1))
        )
    return whole


def _thin(task: Callable[[int, int], None], layers: int, layer: int, report: Progress) -> None:
    """task(first, last) over all layers, one range after the other."""
    size = max(1, _BATCH // max(layer, 1))
    for a in range(0, layers, size):
        part = report.part(a / layers, 1)
        aside(lambda a=a: task(a, min(a + size, layers)), part, "seeds")  # type: ignore[misc]


def _seeds(
    cells: CellRanges, ranks: Ranks, kept: NDArray[np.bool_]
) -> tuple[Tree, NDArray[np.int32]]:
    """A tree of the seeds, and the ranks that it numbers."""
    ids = np.flatnonzero(kept)
    if isinstance(cells.grid, TetMesh):
        around = ranks[cells.grid.cells[ids]]
    else:
        z, y, x = np.unravel_index(ids, cells.shape or ())
        around = np.stack([ranks[z + k, y + j, x + i] for k, j, i in np.ndindex(2, 2, 2)], axis=1)
    low, high = around.min(axis=1, initial=np.iinfo(np.int32).max), around.max(axis=1, initial=-1)
    extremes = np.unique(np.concatenate([low, high]))
    low, high = (np.searchsorted(extremes, ends).astype(np.int32) for ends in (low, high))
    return Tree.of(Points(ids.astype(id_type(kept.size)), low, high, extremes)), extremes


def _walk(step: Step, rank: int, seeds: Any, count: int, report: Progress) -> Ids:
    """All cells that the seeds lead to, sorted."""
    marks = np.zeros(count, dtype=np.bool_)
    marks[seeds] = True
    queue, head, tail = seeds.astype(np.int64), 0, seeds.size
    while head < tail:
        batch = min(_BATCH, max(tail, 1024))
        if queue.size < tail + 6 * batch:
            longer = np.empty(2 * (tail + 6 * batch), dtype=np.int64)
            longer[:tail] = queue[:tail]
            queue = longer
        state = rank, marks, queue, head, tail, batch
        head, tail = aside(lambda state=state: step(*state), report, "active cells")  # type: ignore[misc]
    return np.sort(queue[:tail])


@hot
def _covered(low: int, high: int, starts: Any, ends: Any, count: int) -> bool:
    """Whether these ranges cover low … high."""
    at, moved = low, True
    while moved and at < high:
        moved = False
        for i in range(count):
            if starts[i] <= at < ends[i]:
                at, moved = ends[i], True
    return at >= high


@hot
def _corners(ranks: Any, z: int, y: int, x: int, out: Any) -> None:
    for i in range(8):
        out[i] = ranks[z + (i >> 2), y + ((i >> 1) & 1), x + (i & 1)]


@kernel
def thin_volume(ranks: Any, kept: Any, first: int, last: int) -> None:
    """Leave out cells of layers first … last from kept [z, y, x]."""
    nz, ny, nx = kept.shape
    corner, starts, ends = np.empty(8, np.int32), np.empty(6, np.int32), np.empty(6, np.int32)
    for z in range(first, last):
        for y in range(ny):
            for x in range(nx):
                if not kept[z, y, x]:
                    continue
                _corners(ranks, z, y, x, corner)
                count = 0
                for face in range(6):
                    axis, side = face >> 1, face & 1
                    a = z + (2 * side - 1 if axis == 2 else 0)
                    b = y + (2 * side - 1 if axis == 1 else 0)
                    c = x + (2 * side - 1 if axis == 0 else 0)
                    if a < 0 or b < 0 or c < 0 or a >= nz or b >= ny or c >= nx:
                        continue
                    if not kept[a, b, c]:
                        continue
                    starts[count], ends[count] = 2147483647, -1
                    for i in range(8):
                        if (i >> axis) & 1 == side:
                            starts[count] = min(starts[count], corner[i])
                            ends[count] = max(ends[count], corner[i])
                    count += 1
                if _covered(corner.min(), corner.max(), starts, ends, count):
                    kept[z, y, x] = False


@kernel
def walk_volume(
    ranks: Any, rank: int, marks: Any, queue: Any, head: int, tail: int, count: int
) -> Any:
    """The next `count` cells of the walk over a volume: head and tail of the queue after them."""
    nz, ny, nx = ranks.shape[0] - 1, ranks.shape[1] - 1, ranks.shape[2] - 1
    corner, other = np.empty(8, np.int32), np.empty(8, np.int32)
    stop = head + count
    while head < tail and head < stop:
        cell = queue[head]
        head += 1
        x, y, z = cell % nx, cell // nx % ny, cell // (nx * ny)
        _corners(ranks, z, y, x, corner)
        for face in range(6):
            axis, side = face >> 1, face & 1
            a = z + (2 * side - 1 if axis == 2 else 0)
            b = y + (2 * side - 1 if axis == 1 else 0)
            c = x + (2 * side - 1 if axis == 0 else 0)
            if a < 0 or b < 0 or c < 0 or a >= nz or b >= ny or c >= nx:
                continue
            near = (a * ny + b) * nx + c
            inside = 0
            for i in range(8):
                if (i >> axis) & 1 == side and corner[i] >= rank:
                    inside += 1
            if marks[near] or not 0 < inside < 4:
                continue
            marks[near] = True
            _corners(ranks, a, b, c, other)
            if other.min() >= 0:
                queue[tail] = near
                tail += 1
    return head, tail


@kernel
def thin_tetrahedra(ranks: Any, corners: Any, faces: Any, kept: Any, first: int, last: int) -> None:
    """Leave out cells first … last from kept."""
    starts, ends = np.empty(4, np.int32), np.empty(4, np.int32)
    for cell in range(first, last):
        if not kept[cell]:
            continue
        low, high, count = 2147483647, -1, 0
        for i in range(4):
            value = ranks[corners[cell, i]]
            low, high = min(low, value), max(high, value)
            near = faces[cell, i]
            if near < 0 or not kept[near]:
                continue
            starts[count], ends[count] = 2147483647, -1
            for j in range(4):
                if j != i:
                    starts[count] = min(starts[count], ranks[corners[cell, j]])
                    ends[count] = max(ends[count], ranks[corners[cell, j]])
            count += 1
        if _covered(low, high, starts, ends, count):
            kept[cell] = False


@kernel
def walk_tetrahedra(
    ranks: Any,
    corners: Any,
    faces: Any,
    rank: int,
    marks: Any,
    queue: Any,
    head: int,
    tail: int,
    count: int,
) -> Any:
    """The next `count` cells of the walk over tetrahedra: head and tail of the queue after them."""
    stop = head + count
    while head < tail and head < stop:
        cell = queue[head]
        head += 1
        for i in range(4):
            near = faces[cell, i]
            inside = 0
            for j in range(4):
                if j != i and ranks[corners[cell, j]] >= rank:
                    inside += 1
            if near >= 0 and not marks[near] and 0 < inside < 3:
                marks[near] = True
                queue[tail] = near
                tail += 1
    return head, tail
