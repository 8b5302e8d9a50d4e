"""What each finder promises beyond the right cells: how much it looks at, keeps, and where from."""

from __future__ import annotations

import gc
import math
import threading
import weakref

import numpy as np
import pytest

from tests.isosurface.shapes import VOLUMES_FOR_DTYPES, sphere, torus
from tests.isosurface.test_finders import by_hand
from volviz.errors import Cancelled
from volviz.isosurface import finder_of
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finders import FINDERS, bono, octree, propagation
from volviz.isosurface.finders.intervals import index as intervals_of
from volviz.isosurface.finders.pyramid import boxes_of
from volviz.isosurface.finders.span import Points
from volviz.model.grids import TetMesh
from volviz.model.volume import Volume
from volviz.progress import Progress

TREES = ("octree", "bono", "intervals", "interval-tree", "noise", "issue", "propagation")
# corners z y x of the five tetrahedra of an even cell; an odd one is mirrored along x
FIVE = np.array(
    [
        [(0, 0, 0), (0, 0, 1), (0, 1, 0), (1, 0, 0)],
        [(0, 1, 1), (0, 0, 1), (0, 1, 0), (1, 1, 1)],
        [(1, 0, 1), (0, 0, 1), (1, 0, 0), (1, 1, 1)],
        [(1, 1, 0), (0, 1, 0), (1, 0, 0), (1, 1, 1)],
        [(0, 0, 1), (0, 1, 0), (1, 0, 0), (1, 1, 1)],
    ]
)


def tetrahedra(data):
    """The cells of an array as five tetrahedra each, faces matching."""
    cells = []
    for cell in np.ndindex(*(n - 1 for n in data.shape)):
        corners = FIVE.copy()
        if sum(cell) % 2:
            corners[..., 2] = 1 - corners[..., 2]
        cells.append(np.ravel_multi_index(tuple(np.moveaxis(corners + cell, 2, 0)), data.shape))
    points = np.indices(data.shape).reshape(3, -1).T[:, ::-1]
    return TetMesh(points, np.concatenate(cells), data.reshape(-1))


def active_tetrahedra(grid, level):
    corners = grid.values[grid.cells]
    inside, good = corners >= level, np.isfinite(corners.astype(float)).all(axis=1)
    return np.flatnonzero(good & inside.any(axis=1) & ~inside.all(axis=1))


def grids(rng):
    noise = rng.standard_normal((24, 26, 28)).astype(np.float32)
    whole = rng.integers(0, 9, (24, 26, 28)).astype(np.uint8)
    return {
        "noise": (Volume.from_array(noise), np.linspace(-3, 3, 13)),
        "integers": (Volume.from_array(whole), range(10)),
        "smooth": (torus(32, 2), np.linspace(-1, 0.15, 13)),
    }


@pytest.fixture(params=["noise", "integers", "smooth"])
def grid(request, rng):
    return grids(rng)[request.param]


@pytest.mark.parametrize(
    "shape", [(1, 1, 1), (2, 3, 4), (17, 17, 17), (32, 33, 64), (40, 320, 320)]
)
def test_nodes_of_the_octrees(shape):
    count, sides = 0, list(shape)
    while True:  # halve and round up until one node is left
        sides = [-(-n // 2) for n in sides]
        count += math.prod(sides)
        if max(sides) == 1:
            break
    assert bono.nodes(shape) == count
    longest = 2
    while longest < max(shape):
        longest *= 2
    assert octree.nodes(shape) == (longest**3 - 1) // 7
    assert bono.nodes(shape) <= octree.nodes(shape)


def test_nodes_as_wilhelms_and_van_gelder_count_them():
    assert bono.nodes((320, 320, 40)) == 585_439
    assert octree.nodes((320, 320, 40)) == 19_173_961


def test_branch_on_need_is_below_the_ratio_of_the_survey(rng):
    ratios = [bono.nodes(s) / math.prod(s) for s in rng.integers(32, 300, (200, 3)).tolist()]
    assert 1 / 7 <= max(ratios) <= 0.162
    assert bono.nodes((33, 33, 33)) / 33**3 == pytest.approx(0.16148, abs=1e-5)
    assert bono.nodes((17, 17, 17)) / 17**3 > 0.162  # shorter sides: not promised


@pytest.mark.parametrize("shape", [(3, 4, 5), (9, 18, 34), (2, 2, 50)])
def test_octrees_keep_what_they_say(shape, rng):
    """Two ranges per node and the starts; nodes without a cell are not kept."""
    volume = Volume.from_array(rng.standard_normal(shape).astype(np.float32))
    cells = CellRanges.of(volume)
    report = FINDERS["bono"].build(cells, None).report
    starts = sum(s.size + 1 for level in bono.divide(cells.shape) for s in level)
    assert report.nbytes == 2 * 4 * bono.nodes(cells.shape) + 8 * starts
    kept = FINDERS["octree"].build(cells, None).report.nbytes
    assert 2 * 4 * bono.nodes(cells.shape) < kept
    assert kept < 2 * 4 * octree.nodes(cells.shape) + 8 * 40 * max(shape)


def test_octrees_look_at_active_nodes_and_their_children(grid):
    volume, levels = grid
    for name in ("octree", "bono"):
        finder = FINDERS[name].build(CellRanges.of(volume), None)
        height = (max(finder.cells.shape) - 1).bit_length()
        for level in levels:
            found = finder(level).size
            assert found <= finder.report.visited <= 1 + 8 * height * found


def test_the_interval_tree_is_optimal(grid):
    volume, levels = grid
    finder = FINDERS["interval-tree"].build(CellRanges.of(volume), None)
    height = np.unique(volume.data).size.bit_length()
    for level in levels:
        found = finder(level).size
        assert found <= finder.report.visited <= found + 2 * height


@pytest.mark.parametrize("side", [8, 16, 32, 48])
def test_the_kd_tree_looks_at_few_more_than_it_finds(side, rng):
    """At most c·√n beyond the active ones, with the same c for all n."""
    volume = Volume.from_array(rng.standard_normal((side,) * 3).astype(np.float32))
    for name, most in (("noise", 6), ("issue", 1)):
        finder = FINDERS[name].build(CellRanges.of(volume), None)
        for level in np.linspace(-3, 3, 13):
            found = finder(level).size
            extra = finder.report.visited - found
            rows = min(256, side**1.5) if name == "issue" else 0
            assert 0 <= extra <= most * finder.report.cells**0.5 + rows


def test_sorted_intervals_look_at_a_few_times_what_they_find(rng):
    """Ends that are spread evenly: active ones are at least every third of those looked at."""
    low = rng.permutation(20000).astype(np.int32)
    span = rng.integers(1, 2000, low.size).astype(np.int32)
    points = Points(np.arange(low.size), low, low + span, np.arange(22000))
    search, _ = intervals_of(points)
    for rank in range(3000, 19000, 1000):
        pieces, visited = search(rank)
        found = np.sort(np.concatenate(pieces))
        assert np.array_equal(found, np.flatnonzero((low < rank) & (rank <= low + span)))
        assert visited <= 3 * found.size


def test_a_wide_cell_costs_sorted_intervals_one_look(rng):
    data = np.linspace(0, 1, 30**3, dtype=np.float32).reshape(30, 30, 30)
    plain = FINDERS["intervals"].build(CellRanges.of(Volume.from_array(data)), None)
    data = data.copy()
    data[15, 15, 15] = 1e6
    wide = FINDERS["intervals"].build(CellRanges.of(Volume.from_array(data)), None)
    plain(0.1), wide(0.1)
    assert wide.report.visited <= plain.report.visited + 8


def component_of_cells(volume, level):
    """(active ids, component of each): cells are joined by faces that the surface crosses."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    ids, inside = by_hand(volume, level), volume.data >= level
    shape = tuple(n - 1 for n in volume.data.shape)
    number = np.full(shape, -1)
    number.reshape(-1)[ids] = np.arange(ids.size)
    pairs = []
    for axis in range(3):
        near, far = np.delete(number, -1, axis), np.delete(number, 0, axis)
        around = inside.take(np.arange(1, inside.shape[axis] - 1), axis)
        for other in {0, 1, 2} - {axis}:
            a, b = np.delete(around, -1, other), np.delete(around, 0, other)
            around = a.astype(int) + b
        crossed = (around > 0) & (around < 4) & (near >= 0) & (far >= 0)
        pairs.append(np.stack([near[crossed], far[crossed]]))
    i, j = np.concatenate(pairs, axis=1)
    graph = coo_array((np.ones(i.size), (i, j)), shape=(ids.size, ids.size))
    return ids, connected_components(graph, directed=False)[1]


def sweep_components(volume, levels):
    """Every component has a seed, at every level; the most components that there were."""
    cells = CellRanges.of(volume)
    seeds, finder = propagation.seeds_of(cells), FINDERS["propagation"].build(cells, None)
    most = 0
    for level in levels:
        ids, labels = component_of_cells(volume, level)
        seeded = np.isin(ids, seeds)
        assert np.array_equal(np.unique(labels[seeded]), np.unique(labels))
        assert np.array_equal(finder(level), ids)
        assert ids.size <= finder.report.visited <= 3 * ids.size + 80
        most = max(most, np.unique(labels).size)
    return most, seeds.size / cells.count


def test_propagation_meets_every_component_at_every_value(rng):
    """All isovalues that differ, since they are compared with samples only."""
    for data in (
        rng.standard_normal((8, 9, 10)).astype(np.float32),
        rng.integers(0, 40, (9, 10, 11)).astype(np.int16),
    ):
        volume = Volume.from_array(data)
        most, share = sweep_components(volume, np.unique(data)[:: 1 + data.size // 720])
        assert most >= 3
        assert share < 0.5


def test_propagation_around_cells_that_are_not_valid(rng):
    data = sphere(24).data.copy()
    data[:, 10:12, :] = np.nan  # cuts every surface in two, but for rings around a hole
    data[:, 11, 3:5] = sphere(24).data[:, 11, 3:5]
    data[rng.random(data.shape) < 0.02] = np.nan
    most, _ = sweep_components(Volume.from_array(data), np.linspace(-1, 0.7, 40))
    assert most >= 2


def test_propagation_on_a_real_ct(data):
    from volviz.io import load

    volume = load(data / "ct" / "totalseg_torso_sm_ct.nii.gz")
    levels = [-1000, -950, -700, -200.5, -60, 0, 30.5, 60, 300, 1000]
    most, share = sweep_components(volume, levels)
    assert most >= 50
    assert share < 0.35


@pytest.mark.slow
def test_propagation_over_a_long_sweep(data, rng):
    from volviz.io import load

    noise = Volume.from_array(rng.standard_normal((40, 41, 42)).astype(np.float32))
    sweep_components(noise, np.linspace(-4, 4, 100))
    volume = load(data / "ct" / "totalseg_torso_sm_ct.nii.gz")
    sweep_components(volume, np.linspace(-1024, 1500, 100))


@pytest.mark.slow
@pytest.mark.parametrize("name", FINDERS)
def test_a_hundred_isovalues_of_everything(name, data, rng):
    from volviz.io import load

    volumes = {kind: volume for kind, (volume, _) in grids(rng).items()}
    volumes["ct"] = load(data / "ct" / "totalseg_torso_sm_ct.nii.gz")
    for volume in volumes.values():
        finder = FINDERS[name].build(CellRanges.of(volume), None)
        least, most = float(volume.data.min()), float(volume.data.max())
        samples = rng.choice(volume.data.reshape(-1), 50).astype(float)
        for level in (*rng.uniform(least, most, 50), *samples):
            assert np.array_equal(finder(level), by_hand(volume, level))


@pytest.mark.parametrize("name", FINDERS)
@pytest.mark.parametrize("kind", ["float", "integers", "holes", "constant", "islands", "one"])
def test_tetrahedra_that_share_faces(name, kind, rng):
    data = rng.standard_normal((9, 7, 8)).astype(np.float32)
    if kind == "holes":
        data[3:5, 2, 2:6] = np.nan
    elif kind == "integers":
        data = (data * 3).astype(np.int16)
    elif kind == "constant":
        data[:] = 1
    grid = tetrahedra(data if kind != "one" else data[:2, :2, :2])
    if kind == "islands":  # no faces between many of them, and some there twice
        cells = rng.permutation(grid.cells)[: len(grid.cells) // 3]
        grid = TetMesh(grid.vertices, np.concatenate([cells, cells[:40], cells[:20]]), grid.values)
    finder = FINDERS[name].build(CellRanges.of(grid), None)
    for level in (*np.linspace(-3, 3, 25), *rng.choice(data.reshape(-1), 25).astype(float)):
        if np.isfinite(level):
            assert np.array_equal(finder(level), active_tetrahedra(grid, level))


def test_the_walk_over_tetrahedra_needs_few_seeds(rng):
    grid = tetrahedra(sphere(16).data)
    seeds = propagation.seeds_of(CellRanges.of(grid))
    assert 0 < seeds.size < 0.4 * len(grid.cells)


@pytest.mark.parametrize("name", FINDERS)
def test_no_tetrahedra(name):
    grid = TetMesh(np.zeros((3, 3)), np.zeros((0, 4), np.int64), np.arange(3.0))
    finder = FINDERS[name].build(CellRanges.of(grid), None)
    assert finder(1.0).size == 0
    assert finder.report.visited == 0


@pytest.mark.parametrize("name", ["octree", "bono"])
def test_tetrahedra_in_a_plane_and_at_no_place(name, rng):
    points = rng.standard_normal((60, 3))
    points[:, 2] = 4
    points[5], points[6, 0] = np.nan, np.inf
    grid = TetMesh(points, rng.integers(0, 60, (200, 4)), rng.standard_normal(60))
    finder = FINDERS[name].build(CellRanges.of(grid), None)
    for level in np.linspace(-2, 2, 9):
        assert np.array_equal(finder(level), active_tetrahedra(grid, level))


@pytest.mark.parametrize("thin", [(1, 1, 1), (1, 1, 1e-9), (1, 1e-9, 1e-12), (0, 1, 0), (0, 0, 0)])
@pytest.mark.parametrize("cube", [False, True])
def test_boxes_of_space_are_about_as_many_as_tetrahedra(thin, cube, rng):
    points = rng.uniform(0, 1, (400, 3)) * thin
    cells = rng.integers(0, 400, (1000, 4))
    boxes = boxes_of(TetMesh(points, cells, np.zeros(400)), cube)
    assert math.prod(boxes.shape) <= 8 * len(cells)
    assert np.array_equal(np.sort(boxes.order), np.arange(len(cells)))
    if min(thin) == 1:
        assert math.prod(boxes.shape) >= len(cells) / 4
        assert np.diff(boxes.starts).max() < 40


@pytest.mark.parametrize("name", TREES)
@pytest.mark.parametrize("dtype", VOLUMES_FOR_DTYPES)
def test_ends_of_the_dtype(name, dtype):
    """Isovalues at and beyond the least and greatest number there is."""
    kind = np.dtype(dtype)
    ends = np.iinfo(kind) if kind.kind in "iu" else np.finfo(kind)
    data = np.zeros((3, 4, 5), kind)
    data[1, 1, 1], data[1, 2, 3] = ends.min, ends.max
    volume = Volume.from_array(data)
    finder = FINDERS[name].build(CellRanges.of(volume), None)
    for level in (float(ends.min), -0.5, 0.0, 0.5, float(ends.max)):
        assert np.array_equal(finder(level), by_hand(volume, level))
    report = finder.report
    assert report.name == name
    assert report.build_seconds > 0
    assert report.nbytes > 0


@pytest.mark.parametrize("name", TREES)
def test_building_and_searching_can_be_cancelled(name, rng):
    volume = Volume.from_array(rng.standard_normal((20, 20, 20)).astype(np.float32))
    stopped = Progress()
    stopped.cancel()
    with pytest.raises(Cancelled):
        FINDERS[name].build(CellRanges.of(volume), stopped)
    finder = FINDERS[name].build(CellRanges.of(volume), None)
    with pytest.raises(Cancelled):
        finder(0.0, stopped)
    assert np.array_equal(finder(0.0), by_hand(volume, 0.0))


def test_two_searches_at_once(rng):
    volume = Volume.from_array(rng.standard_normal((20, 20, 20)).astype(np.float32))
    finder = FINDERS["propagation"].build(CellRanges.of(volume), None)
    levels, found = np.linspace(-2, 2, 8), {}
    workers = [threading.Thread(target=lambda v=v: found.setdefault(v, finder(v))) for v in levels]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    for level in levels:
        assert np.array_equal(found[level], by_hand(volume, level))


def test_only_the_last_tree_is_kept_with_a_volume():
    """A tree is many times as large as its volume; bricks are small and stay."""
    volume = sphere(16)
    assert finder_of(volume, "bricks") is None
    bricks = finder_of(volume, "bricks")
    kept = []
    for name in ("noise", "issue", "bono"):
        finder = finder_of(volume, name)
        assert finder_of(volume, name) is finder
        kept.append(weakref.ref(finder))
        del finder
        gc.collect()
        assert [ref() is not None for ref in kept] == [False] * (len(kept) - 1) + [True]
    assert finder_of(volume, "bricks") is bricks


def test_a_finder_does_not_outlive_its_volume():
    volume = sphere(16)
    samples, finder = weakref.ref(volume.data), weakref.ref(finder_of(volume, "noise"))
    del volume
    gc.collect()
    assert samples() is None
    assert finder() is None
