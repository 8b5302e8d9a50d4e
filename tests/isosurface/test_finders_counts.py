"""What finders look at and keep, counted by hand from what their documents say.

`Report.visited` is what people compare finders by, and the bounds of `test_finders_bounds.py` are
wide: here every count is the one that the structure described there has, for volumes with ties,
without, smooth (many cells on the diagonal of span space), and with cells that are not valid.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from tests.isosurface.test_finders_bounds import active_tetrahedra, tetrahedra
from tests.isosurface.test_visits import Noted
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finders import FINDERS, propagation
from volviz.isosurface.finders.issue import cuts_of
from volviz.isosurface.finders.noise import places
from volviz.isosurface.finders.pyramid import boxes_of
from volviz.isosurface.finders.span import Points, id_type
from volviz.model.grids import TetMesh
from volviz.model.volume import Volume

KINDS = ("noise", "integers", "smooth", "holes")


@cache
def made(kind):
    """(cells, low and high of those that can be active, their ids, isovalues at and between)."""
    rng = np.random.default_rng(8)
    data = rng.standard_normal((9, 12, 17)).astype(np.float32)
    if kind == "integers":
        data = rng.integers(0, 12, data.shape).astype(np.int16)
        data[2:5, 4:8, 3:9] = 6  # cells that are never active, which nobody keeps
    elif kind == "smooth":
        slope = 4.0 * np.arange(60)[:, None, None]
        data = np.floor(slope + rng.uniform(0, 3, (60, 5, 6))).astype(np.int16)
    elif kind == "holes":
        data[2:4, 5, 3:9] = np.nan
        data[8, 11, 16] = np.inf
    cells = CellRanges.of(Volume.from_array(data))
    low, high = cells.arrays()
    ids = np.flatnonzero(low < high)
    ends = np.unique(np.concatenate([low[ids], high[ids]]))
    chosen = ends[:: max(1, ends.size // 24)].astype(float)
    levels = np.concatenate([chosen, (chosen[:-1] + chosen[1:]) / 2])
    return cells, low[ids], high[ids], ids, np.append(levels, float(ends[-1]) + 1)


def followed(name, kind):
    """(isovalue, rank of it among the ends, ids tested, ids taken untested, report) of each."""
    cells, low, high, _, levels = made(kind)
    finder, ends = FINDERS[name].build(cells, None), np.unique(np.concatenate([low, high]))
    for level in levels:
        noted = Noted()
        _, report = finder.followed(level, noted)
        rank = int(np.searchsorted(ends, level))
        if 0 < rank < ends.size:
            yield level, rank, noted.ids("tested"), noted.ids("reported"), report
        else:
            assert report.active == 0
            assert report.visited == 0 or name in ("octree", "bono", "bricks")


def ranks(kind):
    """Ranks of the ends of the cells among all distinct ends, and how many of those there are."""
    _, low, high, ids, _ = made(kind)
    ends = np.unique(np.concatenate([low, high]))
    return ids, np.searchsorted(ends, low), np.searchsorted(ends, high), ends.size


def lattice(low, high):
    """Where parts begin that have equally many ends, and the parts of both ends."""
    parts, ends = min(256, math.isqrt(low.size)), np.sort(np.concatenate([low, high]))
    cuts = np.unique([ends[k * ends.size // parts] for k in range(1, parts)])
    return cuts, *((cuts[None, :] <= a[:, None]).sum(axis=1) for a in (low, high))


@pytest.mark.parametrize("kind", KINDS)
def test_issue_takes_rows_and_tests_one_part_of_the_diagonal(kind):
    ids, low, high, _ = ranks(kind)
    cuts, row, column = lattice(low, high)
    off = dict(zip(ids.tolist(), (row != column).tolist(), strict=True))
    place = dict(zip(ids.tolist(), row.tolist(), strict=True))
    assert any(off.values())
    searched = 0
    for _, rank, tested, reported, report in followed("issue", kind):
        part = int((cuts <= rank).sum())
        met = (low < rank) & (rank <= high)
        assert report.visited == tested.size + reported.size
        taken = [i for i in reported.tolist() if off[i]]
        assert sorted(taken) == sorted(ids[met & (row != column)].tolist())
        ended = [place[i] for i in tested.tolist() if off[i]]
        unmet = np.unique(row[(row != column) & ~met & (row <= part)])
        assert sorted(ended) == unmet.tolist(), "one beyond each prefix that does not end its row"
        on = [place[i] for i in (*tested.tolist(), *reported.tolist()) if not off[i]]
        assert set(on) <= {part}, "of the diagonal, no other part is searched"
        assert bool(on) == bool(((row == part) & (column == part)).any())
        searched += len(on)
    assert searched > 100 or kind != "smooth"


@pytest.mark.parametrize("count", [1, 3, 4, 9, 100, 70_000])
def test_the_lattice_has_about_a_row_for_each_root_of_the_cells(count):
    low = np.random.default_rng(count).permutation(2 * count)[:count].astype(np.int32)
    points = Points(np.arange(count), low, low + 1, np.arange(2 * count + 1))
    cuts = cuts_of(points)
    assert cuts.size + 1 == min(256, math.isqrt(count))
    between = np.diff(np.searchsorted(np.sort(np.append(low, low + 1)), cuts))
    if between.size:
        assert np.ptp(between) <= 3, "two ends of the same value stay together"


@pytest.mark.parametrize("kind", KINDS)
def test_the_interval_tree_looks_at_one_way_down(kind):
    ids, low, high, count = ranks(kind)
    for _, rank, tested, reported, report in followed("interval-tree", kind):
        visited = on_the_way(low, high, count, rank)
        assert report.visited == visited
        assert np.array_equal(np.sort(reported), ids[(low < rank) & (rank <= high)])
        assert not np.isin(tested, reported).any()


def on_the_way(low, high, count, rank):
    """Nodes of halving 0 … 2ʰ ≥ count until the rank is met, and at each the cells with its number
    in their range that are active, and one that is not if there is one."""
    left = np.ones(low.size, bool)
    begin, end, visited = 0, max(2, 1 << math.ceil(math.log2(count))), 0
    while True:
        node = (begin + end) // 2
        here = left & (low < node) & (node <= high)
        left &= ~here
        met = here & (low < rank) & (rank <= high)
        visited += 1 + int(met.sum()) + bool((here & ~met).any())
        if node == rank:
            return visited
        begin, end = (begin, node) if rank < node else (node, end)


@pytest.mark.parametrize("kind", KINDS)
def test_intervals_look_at_the_shorter_stretch_of_each_class(kind):
    ids, low, high, _ = ranks(kind)
    span = high - low
    for _, rank, tested, _, report in followed("intervals", kind):
        visited = 0
        for bits in range(1, 32):
            own = (span >> (bits - 1)) == 1
            widest = (1 << bits) - 1
            below = own & (rank - widest <= low) & (low < rank)
            above = own & (rank <= high) & (high < rank + widest)
            visited += min(int(below.sum()), int(above.sum()))
        assert report.visited == tested.size == visited
        assert np.isin(ids[(low < rank) & (rank <= high)], tested).all()


@pytest.mark.parametrize("kind", KINDS)
def test_the_kd_tree_tests_nothing_twice_and_takes_whole_parts(kind):
    ids, low, high, _ = ranks(kind)
    whole = 0
    for _, rank, tested, reported, report in followed("noise", kind):
        met = ids[(low < rank) & (rank <= high)]
        assert report.visited == tested.size + reported.size
        assert np.unique(np.concatenate([tested, reported])).size == report.visited
        assert np.isin(reported, met).all()
        # each of the two borders crosses at most 2 √(2 n) boxes of a tree that alternates; what
        # no border crosses is taken or left whole
        assert tested.size <= 4 * (2 * ids.size) ** 0.5
        whole += reported.size > tested.size
    assert whole >= 3 or kind == "smooth"


@pytest.mark.parametrize("count", [1023, 1024, 1025, 1026, 3000])
def test_more_places_than_were_made_room_for(count):
    low = np.zeros(count, np.int32)
    at, visited = places(low, low + 1, 1, 0, count)
    assert np.array_equal(np.sort(at), np.arange(count))
    assert visited == count


def test_ids_of_more_cells_than_32_bits_number():
    assert np.dtype(id_type(2**31 - 1)).itemsize == 4
    assert np.dtype(id_type(2**31)).itemsize == 8


def halves(name, shape):
    """Where nodes begin along each axis, the root first, the leaves of at most 2 cells last."""
    depth = max(1, math.ceil(math.log2(max(shape))))
    for level in range(depth):
        side = 1 << (depth - level)
        if name == "bono":
            yield [list(range(0, n, side)) for n in shape]
        else:
            yield [sorted({a * n // (1 << level) for a in range(1 << level)}) for n in shape]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", ["octree", "bono"])
def test_octrees_look_at_the_children_of_active_nodes(name, kind):
    cells, *_ = made(kind)
    low, high = (a.reshape(cells.shape) for a in cells.arrays())
    plan = list(halves(name, cells.shape))
    for level, _, tested, _, report in followed(name, kind):
        boxes, visited = [tuple((0, n) for n in cells.shape)], 0
        for depth in range(len(plan)):
            visited += len(boxes)
            active = [b for b in boxes if crossed(low, high, b, level)]
            finer = plan[depth + 1] if depth + 1 < len(plan) else [range(n) for n in cells.shape]
            boxes = [child for b in active for child in children(b, finer, cells.shape)]
        assert report.visited == visited + len(boxes)
        at = [np.ravel_multi_index([a for a, _ in b], cells.shape) for b in boxes]
        assert np.array_equal(np.sort(tested), np.sort(np.array(at, int)))


def crossed(low, high, box, level):
    part = tuple(slice(a, b) for a, b in box)
    own = low[part] <= high[part]
    return bool(own.any()) and low[part][own].min() < level <= high[part][own].max()


def children(box, finer, shape):
    """Boxes between the finer starts within a box."""
    sides = []
    for (a, b), starts, n in zip(box, finer, shape, strict=True):
        own = [s for s in starts if a <= s < b]
        later = [s for s in starts if s >= b][:1] or [n]
        sides.append(list(zip(own, [*own[1:], min(later[0], b)], strict=True)))
    return [(z, y, x) for z in sides[0] for y in sides[1] for x in sides[2]]


@pytest.mark.parametrize("kind", KINDS)
def test_bricks_look_at_all_ranges_and_at_whole_bricks(kind):
    cells, *_ = made(kind)
    data = cells.grid.data.astype(float)
    data[~np.isfinite(data)] = np.nan
    corners = [range(0, n, 4) for n in cells.shape]
    bricks = [data[k : k + 5, j : j + 5, i : i + 5] for k in corners[0] for j in corners[1]
              for i in corners[2]]  # fmt: skip
    ends = np.array([(np.nanmin(b), np.nanmax(b)) for b in bricks])
    for level, _, _, _, report in followed("bricks", kind):
        met = int(((ends[:, 0] < level) & (level <= ends[:, 1])).sum())
        assert report.visited == len(bricks) + 64 * met


@pytest.mark.parametrize("kind", KINDS)
def test_propagation_looks_at_its_seeds_and_at_what_it_finds(kind):
    cells, *_ = made(kind)
    lowest, highest = cells.arrays()
    seeds = propagation.seeds_of(cells)
    ends = np.unique(np.concatenate([lowest[seeds], highest[seeds]]))
    low, high = np.searchsorted(ends, lowest[seeds]), np.searchsorted(ends, highest[seeds])
    for level, _, tested, _, report in followed("propagation", kind):
        rank = int(np.searchsorted(ends, level))
        assert report.visited == report.active + on_the_way(low, high, ends.size, rank)
        assert tested.size == report.active


@pytest.mark.parametrize("kind", KINDS)
def test_cells_whose_faces_lead_on_at_every_value_are_no_seeds(kind):
    """One after the other: left out if each value it is active for is on a face with a cell that
    is not left out before."""
    cells, *_ = made(kind)
    data, (low, high) = cells.grid.data, (a.reshape(cells.shape) for a in cells.arrays())
    kept = low <= high
    for cell in np.argwhere(kept):
        at, ranges = tuple(cell), []
        for axis in range(3):
            for side in (0, 1):
                near = cell.copy()
                near[axis] += 2 * side - 1
                if 0 <= near[axis] < cells.shape[axis] and kept[tuple(near)]:
                    block = data[tuple(slice(c, c + 2) for c in cell)]
                    face = block.take(side, axis)
                    ranges.append((face.min(), face.max()))
        reached = low[at]
        for begin, end in sorted(ranges):
            if begin <= reached:
                reached = max(reached, end)
        kept[at] = reached < high[at]
    assert np.array_equal(propagation.seeds_of(cells), np.flatnonzero(kept))


@pytest.mark.parametrize("kind", KINDS)
def test_finders_keep_what_their_documents_say(kind):
    """Ids and ranks are 4 bytes here, starts 8; one value for each rank."""
    cells, low, high, ids, _ = made(kind)
    size, n = low.dtype.itemsize, ids.size
    values = np.unique(np.concatenate([low, high])).size
    kept = {name: FINDERS[name].build(cells, None).report.nbytes for name in FINDERS}
    assert kept["brute-force"] == 0
    layers, rows, columns = (-(-a // 4) for a in cells.shape)
    assert kept["bricks"] == 2 * size * layers * rows * (columns + -(-columns // 64))
    assert kept["noise"] == 12 * n + size * values
    assert kept["intervals"] == 24 * n + size * values
    assert kept["interval-tree"] == 16 * n + 8 * (values + 1) + size * values
    cuts, row, column = lattice(*ranks(kind)[1:3])
    off = int((row != column).sum())
    starts = 4 * cuts.size + 2 * 8 * (cuts.size + 2)
    assert kept["issue"] == 16 * off + 12 * (n - off) + starts + size * values
    samples = cells.grid.data.size
    some = np.isfinite(cells.grid.data)
    seeds = propagation.seeds_of(cells)
    tree = 16 * seeds.size
    rest = kept["propagation"] - 4 * samples - size * np.unique(cells.grid.data[some]).size - tree
    assert 0 < rest <= 12 * (2 * seeds.size + 1)


@pytest.mark.parametrize("name", ["octree", "bono", "bricks"])
def test_tetrahedra_of_active_nodes_are_looked_at(name):
    """As many levels as there are samples' values, each value among them: ties decide."""
    rng = np.random.default_rng(9)
    grid = tetrahedra(rng.integers(0, 7, (5, 6, 7)).astype(np.int16))
    finder = FINDERS[name].build(CellRanges.of(grid), None)
    groups = [grid.values[grid.cells[a : a + 64]] for a in range(0, len(grid.cells), 64)]
    for level in (*range(8), 2.5):
        noted = Noted()
        found, report = finder.followed(level, noted)
        assert np.array_equal(found, active_tetrahedra(grid, level))
        assert np.isin(found, noted.ids("tested")).all()
        if name == "bricks":
            met = [g.size // 4 for g in groups if g.min() < level <= g.max()]
            assert report.visited == len(groups) + sum(met)
        elif found.size:
            nodes = report.visited - noted.ids("tested").size
            assert 1 + 8 <= nodes <= 1 + 8 * len(grid.cells)


@pytest.mark.parametrize("cube", [False, True])
def test_tetrahedra_lie_in_the_box_of_their_middle(cube):
    """Those with a corner at no place are somewhere; about as many boxes as cells."""
    rng = np.random.default_rng(4)
    points = rng.uniform(0, 1, (500, 3)) * (9, 4, 6)
    grid = TetMesh(points, rng.integers(0, 500, (1500, 4)), np.zeros(500))
    boxes = boxes_of(grid, cube)
    count = math.prod(boxes.shape)
    assert 1500 / 8**0.5 <= count <= 1500 * 8**0.5 if cube else 1500 <= count <= 2 * 1500
    middle = grid.vertices.astype(float)[grid.cells].mean(axis=1)[:, ::-1]
    low, extent = middle.min(axis=0), np.ptp(middle, axis=0)
    for box in range(count):
        own = middle[boxes.order[boxes.starts[box] : boxes.starts[box + 1]]]
        at = np.array(np.unravel_index(box, boxes.shape))
        place = (own - low) / extent * boxes.shape
        assert (place >= at - 1e-6).all()
        assert (place <= at + 1 + 1e-6).all()


@pytest.mark.parametrize("name", ["octree", "bono"])
def test_boxes_of_tetrahedra_are_counted_as_memory(name):
    rng = np.random.default_rng(4)
    grid = TetMesh(rng.uniform(0, 1, (50, 3)), rng.integers(0, 50, (200, 4)), np.arange(50.0))
    boxes = boxes_of(grid, name == "octree")
    kept = FINDERS[name].build(CellRanges.of(grid), None).report.nbytes
    levels = [math.prod(len(starts) for starts in level) for level in halves(name, boxes.shape)]
    bare = 2 * grid.values.dtype.itemsize * sum(levels) + 8 * (200 + math.prod(boxes.shape) + 1)
    assert bare < kept <= bare + 8 * 3 * len(levels) * (max(boxes.shape) + 1)
