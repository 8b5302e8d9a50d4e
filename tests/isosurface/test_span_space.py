"""Span space as the window shows it: cells per bin, and what a query looks at."""

from __future__ import annotations

import numpy as np
import pytest

from tests.isosurface.shapes import volumes
from volviz.errors import Cancelled
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finders import FINDERS
from volviz.isosurface.span_space import EDGE, INSIDE, OUTSIDE, span_space
from volviz.model.grids import TetMesh
from volviz.model.volume import Volume
from volviz.progress import Progress

VOLUMES = {name: (volume, levels) for name, volume, levels in volumes()}


@pytest.mark.parametrize("kind", VOLUMES)
def test_every_valid_cell_is_counted_once(kind):
    cells = CellRanges.of(VOLUMES[kind][0])
    low, high = cells.arrays()
    space = span_space(cells, 16)
    assert space.counts.sum() == np.count_nonzero(low <= high)
    assert not np.tril(np.ones((16, 16)), -1).T[space.counts > 0].any()  # high is not below low


def test_bins_are_those_of_numpy(rng):
    grid = TetMesh(np.zeros((90, 3)), rng.integers(0, 90, (500, 4)), rng.standard_normal(90))
    corners = grid.values[grid.cells]
    space = span_space(CellRanges.of(grid), 9)
    expected = np.histogram2d(corners.max(1), corners.min(1), bins=[space.edges, space.edges])[0]
    assert np.array_equal(space.counts, expected)
    assert space.edges[0] == corners.min()
    assert space.edges[-1] == corners.max()


@pytest.mark.parametrize("kind", ["float", "holes", "integers", "padding", "smooth"])
def test_what_a_query_looks_at(kind):
    """Active cells lie in visited bins; bins inside have no others; sums bound the count."""
    volume, levels = VOLUMES[kind]
    cells = CellRanges.of(volume)
    finder, space = FINDERS["brute-force"].build(cells, None), span_space(cells, 12)
    for level in (*levels, *space.edges[[0, 3, -1]].tolist()):
        active = span_space(cells, 12, finder(level))
        visited = space.visited(level)
        assert np.array_equal(active.edges, space.edges)
        assert not active.counts[visited == OUTSIDE].any()
        inside = visited == INSIDE
        assert np.array_equal(active.counts[inside], space.counts[inside])
        low, corner, again, high = space.rectangle(level)
        assert low <= corner == again <= high
        assert corner == np.clip(level, space.edges[0], space.edges[-1])


def test_regions_of_a_query():
    data = np.arange(9, dtype=np.float64).reshape(1, 1, 9).repeat(2, 0).repeat(2, 1)
    space = span_space(CellRanges.of(Volume.from_array(data)), 4)
    assert space.edges.tolist() == [0, 2, 4, 6, 8]
    i, e, o = INSIDE, EDGE, OUTSIDE
    # rows: high from 0, 2, 4, 6; columns: low
    assert space.visited(4.0).tolist() == [[o] * 4, [o] * 4, [i, i, o, o], [i, i, o, o]]
    assert space.visited(5.0).tolist() == [[o] * 4, [o] * 4, [e, e, e, o], [i, i, e, o]]
    assert not space.visited(0.0).any()
    assert not space.visited(9.0).any()
    assert space.visited(8.0).tolist() == [[o] * 4, [o] * 4, [o] * 4, [e] * 4]


def test_it_can_be_cancelled():
    progress = Progress()
    progress.cancel()
    with pytest.raises(Cancelled):
        span_space(CellRanges.of(VOLUMES["float"][0]), progress=progress)
