"""Every finder finds what looking at every cell finds; every extractor makes the same of it."""

from __future__ import annotations

import numpy as np
import pytest

from tests.isosurface.shapes import volumes
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.extractors import EXTRACTORS
from volviz.isosurface.finders import FINDERS
from volviz.model.grids import TetMesh
from volviz.model.surface import FINDERS as NAMES
from volviz.model.surface import METHODS
from volviz.model.volume import Volume

VOLUMES = {name: (volume, levels) for name, volume, levels in volumes()}


def by_hand(volume, level):
    """Ids of active cells, straight from the definition."""
    data = volume.data
    if min(data.shape) < 2:
        return np.empty(0, int)
    valid = np.isfinite(data.astype(float))
    if volume.info.padding is not None:
        valid &= data != volume.info.padding
    corners, good = [], []
    for corner in np.ndindex(2, 2, 2):
        at = tuple(slice(c, n - 1 + c) for c, n in zip(corner, data.shape, strict=True))
        corners.append(data[at] >= level)
        good.append(valid[at])
    some, every = np.any(corners, axis=0), np.all(corners, axis=0)
    return np.flatnonzero(some & ~every & np.all(good, axis=0))


@pytest.mark.parametrize("kind", VOLUMES)
@pytest.mark.parametrize("name", FINDERS)
def test_finders_find_the_active_cells(name, kind):
    volume, levels = VOLUMES[kind]
    finder = FINDERS[name].build(CellRanges.of(volume), None)
    for level in levels:
        found = finder(level)
        assert found.dtype == np.int64
        assert np.array_equal(found, by_hand(volume, level))
        assert finder.report.active == found.size
        assert finder.report.cells == np.prod([n - 1 for n in volume.data.shape])


@pytest.mark.parametrize("name", FINDERS)
def test_a_hundred_isovalues(name, rng):
    volume = Volume.from_array(rng.normal(100, 30, (17, 18, 19)).astype(np.int16))
    finder = FINDERS[name].build(CellRanges.of(volume), None)
    for level in np.concatenate([rng.uniform(0, 200, 50), rng.integers(0, 200, 50)]):
        assert np.array_equal(finder(level), by_hand(volume, level))


@pytest.mark.parametrize("name", FINDERS)
def test_real_volume(name, data):
    from volviz.io import load

    volume = load(data / "ct" / "totalseg_torso_sm_ct.nii.gz")
    finder = FINDERS[name].build(CellRanges.of(volume), None)
    for level in (-900, -200.5, 0, 40, 300, 1000):
        assert np.array_equal(finder(level), by_hand(volume, level))


@pytest.mark.parametrize("name", FINDERS)
def test_tetrahedra(name, rng):
    values = rng.standard_normal(300).astype(np.float32)
    values[7] = np.nan
    grid = TetMesh(rng.standard_normal((300, 3)), rng.integers(0, 300, (1000, 4)), values)
    finder = FINDERS[name].build(CellRanges.of(grid), None)
    corners = values[grid.cells]
    good = np.isfinite(corners).all(axis=1)
    for level in (-3, -1, 0, 0.5, values[3], 4):
        inside = corners >= level
        expected = np.flatnonzero(good & inside.any(axis=1) & ~inside.all(axis=1))
        assert np.array_equal(finder(level), expected)


@pytest.mark.parametrize("kind", VOLUMES)
@pytest.mark.parametrize("name", FINDERS)
@pytest.mark.parametrize("method", [name for name, row in EXTRACTORS.items() if row.by_cell])
def test_any_finder_feeds_any_extractor(method, name, kind):
    volume, levels = VOLUMES[kind]
    finder = FINDERS[name].build(CellRanges.of(volume), None)
    for level in levels:
        whole = EXTRACTORS[method].extract(volume, level)
        found = EXTRACTORS[method].extract(volume, level, finder(level))
        for part in ("vertices", "normals", "faces"):
            assert np.array_equal(getattr(whole, part), getattr(found, part))


@pytest.mark.parametrize("kind", ["float", "holes", "padding", "65-wide"])
def test_a_part_of_the_cells_is_a_part_of_the_mesh(kind, rng):
    volume, levels = VOLUMES[kind]
    extract = EXTRACTORS["marching-cubes"].extract
    for level in levels:
        whole, ids = extract(volume, level), by_hand(volume, level)
        every = extract(volume, level, ids, part=True)
        assert np.array_equal(every.vertices, whole.vertices)
        assert np.array_equal(every.faces, whole.faces)
        some = np.sort(rng.choice(ids, ids.size // 2, replace=False))
        rest = np.setdiff1d(ids, some)
        halves = [extract(volume, level, cells, part=True) for cells in (some, rest)]
        assert sum(len(half.faces) for half in halves) == len(whole.faces)
        known = {tuple(v) for v in whole.vertices.tolist()}
        for half in halves:
            assert {tuple(v) for v in half.vertices.tolist()} <= known
            assert np.array_equal(np.unique(half.faces), np.arange(len(half.vertices)))


def test_ranges_of_cells():
    volume, _ = VOLUMES["holes"]
    cells = CellRanges.of(volume)
    low, high = cells.arrays()
    data = volume.data
    z, y, x = (n - 1 for n in data.shape)
    for cell in (0, 5, 777, low.size - 1):
        k, j, i = np.unravel_index(cell, (z, y, x))
        block = data[k : k + 2, j : j + 2, i : i + 2]
        if np.isfinite(block).all():
            assert (low[cell], high[cell]) == (block.min(), block.max())
        else:
            assert low[cell] > high[cell]


def test_names_of_the_knobs_are_those_of_the_registries():
    assert set(METHODS) == set(EXTRACTORS)
    assert set(NAMES) == set(FINDERS)
