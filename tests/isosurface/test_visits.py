"""What finders say they look at: never less than the active cells, and as many as they count."""

from __future__ import annotations

import gc
import threading
import weakref

import numpy as np
import pytest

from tests.isosurface.shapes import volumes
from volviz import isosurface
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finders import FINDERS
from volviz.isosurface.span_space import span_space
from volviz.isosurface.trace import Trace
from volviz.isosurface.visits import binned, visits
from volviz.model.grids import TetMesh
from volviz.model.volume import Volume

VOLUMES = {name: (volume, levels) for name, volume, levels in volumes()}


class Noted(Trace):
    """Everything that a finder says."""

    def __init__(self) -> None:
        self.parts: dict[str, list[np.ndarray]] = {"tested": [], "reported": []}
        self.levels: list[tuple] = []

    def tested(self, ids) -> None:
        self.parts["tested"].append(np.array(ids))

    def reported(self, ids) -> None:
        self.parts["reported"].append(np.array(ids))

    def level(self, *told) -> None:
        self.levels.append(told)

    def ids(self, kind: str) -> np.ndarray:
        return np.concatenate([np.empty(0, np.int64), *self.parts[kind]])


@pytest.mark.parametrize("kind", VOLUMES)
@pytest.mark.parametrize("name", FINDERS)
def test_what_is_found_was_tested_or_taken_with_others(name, kind):
    volume, levels = VOLUMES[kind]
    finder = FINDERS[name].build(CellRanges.of(volume), None)
    for level in levels:
        noted = Noted()
        found, report = finder.followed(level, noted)
        np.testing.assert_array_equal(found, finder(level))
        assert (report.visited, report.active) == (finder.report.visited, finder.report.active)
        tested, reported = noted.ids("tested"), noted.ids("reported")
        assert np.isin(reported, found).all(), "what is taken without a test is active"
        assert len(np.unique(reported)) == len(reported)
        assert not np.isin(reported, tested).any()
        assert np.isin(found, np.concatenate([tested, reported])).all()
        assert report.visited >= tested.size + reported.size
        if name == "brute-force":
            assert np.array_equal(tested, np.arange(report.cells))


@pytest.mark.parametrize("name", ["interval-tree", "noise", "issue", "intervals"])
def test_counts_are_those_of_the_report(name, rng):
    """Nodes aside (of the interval tree), the report counts the very cells that are named."""
    volume = Volume.from_array(rng.normal(100, 30, (17, 18, 19)).astype(np.int16))
    finder = FINDERS[name].build(CellRanges.of(volume), None)
    for level in (40, 90.5, 100, 130):
        noted = Noted()
        _, report = finder.followed(level, noted)
        told = noted.ids("tested").size + noted.ids("reported").size
        nodes = report.visited - told
        assert nodes == 0 if name != "interval-tree" else 0 < nodes <= 12


def test_tetrahedra_have_no_boxes(rng):
    values = rng.standard_normal(300).astype(np.float32)
    grid = TetMesh(rng.standard_normal((300, 3)), rng.integers(0, 300, (1000, 4)), values)
    for name, row in FINDERS.items():
        finder, noted = row.build(CellRanges.of(grid), None), Noted()
        found, _ = finder.followed(0.1, noted)
        assert np.isin(found, np.concatenate([noted.ids("tested"), noted.ids("reported")])).all()
        assert noted.levels == [], name


@pytest.mark.parametrize("name", ["octree", "bono", "bricks"])
def test_nodes_are_boxes_round_the_surface(name, rng):
    """Active boxes of a level cover all active cells, each has one; idle ones have none."""
    data = rng.normal(0, 1, (13, 18, 23)).astype(np.float32)
    for axis in range(3):
        data += np.roll(data, 1, axis) + np.roll(data, 2, axis)
    volume, noted = Volume.from_array(data), Noted()
    cells = CellRanges.of(volume)
    finder = FINDERS[name].build(cells, None)
    level = float(np.quantile(data, 0.97))
    found, report = finder.followed(level, noted)
    z, y, x = np.unravel_index(found, cells.shape)
    at = np.stack([x, y, z], axis=1)
    for side, looked_at, (low, high), idle in noted.levels:
        inside = ((at[:, None] >= low[None]) & (at[:, None] < high[None])).all(axis=2)
        assert (inside.sum(axis=1) == 1).all()
        assert (high > low).all()
        assert (high - low <= side).all() or name == "octree"
        for a, b in zip(low, high, strict=True):
            values = data[a[2] : b[2] + 1, a[1] : b[1] + 1, a[0] : b[0] + 1]
            assert values.min() < level <= values.max()
        if idle is not None:
            assert looked_at == len(low) + len(idle[0])
            for a, b in zip(*idle, strict=True):
                values = data[a[2] : b[2] + 1, a[1] : b[1] + 1, a[0] : b[0] + 1]
                assert not values.min() < level <= values.max()
    if name == "bono":
        nodes = sum(told[1] for told in noted.levels)
        assert nodes + noted.ids("tested").size == report.visited


@pytest.mark.parametrize("kind", ["float", "holes", "integers", "padding", "smooth"])
def test_bins(kind):
    volume, levels = VOLUMES[kind]
    cells = CellRanges.of(volume)
    where = binned(cells, 12)
    plain = span_space(cells, 12)
    np.testing.assert_array_equal(where.space.counts, plain.counts)
    np.testing.assert_array_equal(where.space.edges, plain.edges)
    for name, row in FINDERS.items():
        finder = row.build(cells, None)
        for level in levels:
            seen, active = visits(finder, where, level), span_space(cells, 12, finder(level))
            assert (seen.tested + seen.reported >= active.counts).all(), name
            assert (seen.reported <= active.counts).all()
            if name == "brute-force":
                np.testing.assert_array_equal(seen.tested, plain.counts)
            assert seen.report.active == active.counts.sum()


def test_finders_go_with_their_volume(rng):
    volume = Volume.from_array(rng.normal(0, 1, (6, 6, 6)).astype(np.float32))
    finder = isosurface.built_finder(volume, "octree")
    assert isosurface.built_finder(volume, "octree") is finder
    gone = weakref.ref(volume)
    del volume, finder
    gc.collect()
    assert gone() is None


def test_two_threads_build_one_finder(monkeypatch, rng):
    volume = Volume.from_array(rng.normal(0, 1, (9, 9, 9)).astype(np.float32))
    built: list[object] = []
    row, build = isosurface.FINDERS["octree"], isosurface.FINDERS["octree"].build

    def slowly(cells, progress):
        built.append(cells)
        threading.Event().wait(0.2)
        return build(cells, progress)

    monkeypatch.setitem(isosurface.FINDERS, "octree", type(row)(slowly, row.guarantee))
    found: list[object] = []
    threads = [
        threading.Thread(target=lambda: found.append(isosurface.built_finder(volume, "octree")))
        for _ in range(3)
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(built) == 1
    assert len(set(map(id, found))) == 1


@pytest.mark.parametrize(("kind", "span"), [("uint8", (0, 230)), ("int16", (-1000.4, 1700.2))])
def test_bins_of_whole_numbers_have_equally_many(kind, span):
    """Otherwise their counts show stripes that the data does not have."""
    values = np.arange(np.floor(span[0]), np.ceil(span[1]) + 1)
    data = values.astype(kind)[None, None].repeat(2, 0).repeat(2, 1)
    space = binned(CellRanges.of(Volume.from_array(data)), 128, span=span).space
    held = np.diff(np.searchsorted(values, space.edges))
    assert (held[:-1] == held[0]).all()
    assert 64 <= held.size <= 128
    assert space.edges[0] <= span[0]
    assert span[1] <= space.edges[-1]
    assert space.counts.sum() == len(values) - 1
    diagonals = np.diag(space.counts) + np.pad(np.diag(space.counts, -1), (1, 0))
    assert np.ptp(diagonals[1:-1]) <= 0
