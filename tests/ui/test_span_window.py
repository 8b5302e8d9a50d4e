"""Report, span space and ambiguous cells in the real window."""

from __future__ import annotations

import pytest

import volviz
from tests.ui.display import check_played, needs_display, play
from volviz.isosurface import built_finder
from volviz.isosurface.ambiguous import ambiguous_cells
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.visits import binned, visits
from volviz.meshes.measure import measure
from volviz.sources import open_volume


@pytest.fixture(scope="module")
def compiled() -> None:
    """The kernels that the window will want: it would take much longer to compile them itself."""
    volume = open_volume("sample:marschner-lobb")
    where = binned(CellRanges.of(volume))
    for finder in ("bricks", "interval-tree", "bono"):
        measure(volviz.extract_surface(volume, 0.5, finder=finder))
        visits(built_finder(volume, finder), where, 0.5)
    ambiguous_cells(volume, 0.5)


@needs_display
@pytest.mark.parametrize("name", ["reported", "spanned", "ambiguous", "colored"])
def test_window(name, tmp_path, compiled):
    check_played(play("scripts_span", name, tmp_path))
