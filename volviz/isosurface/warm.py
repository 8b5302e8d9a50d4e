"""Compile the kernels ahead, so that the first surface does not wait for it.

Run it on a thread when a volume is opened (`app/jobs`): compiled code is kept on disk, so that
this takes seconds once after an install and some tenths of a second in each later process.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.extractors import EXTRACTORS
from volviz.isosurface.finders import FINDERS
from volviz.isosurface.finders.bricks import Bricks
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

_MESSAGE = "compiling (once after an install)"


def warm(dtype: Any, progress: Progress | None = None) -> None:
    """Make every finder and extractor ready for volumes of this dtype. Raises Cancelled."""
    report = progress or silent()
    data = np.zeros((4, 4, 4), dtype=dtype)
    data[1:3, 1:3, 1:3] = 1
    volume = Volume.from_array(data)
    usual = EXTRACTORS["marching-cubes"]
    jobs = 1 + len(FINDERS) + len(EXTRACTORS)
    report(0, _MESSAGE)
    # what a surface takes first, and then its second isovalue
    usual.extract(volume, 0.5, None, progress=report.part(0, 0))
    bricks = FINDERS["bricks"].build(CellRanges.of(volume), report.part(0, 0))
    assert isinstance(bricks, Bricks)
    usual.extract(volume, 0.5, None, rows=bricks.rows, progress=report.part(0, 0))
    for i, row in enumerate(FINDERS.values(), 1):
        report(i / jobs, _MESSAGE)
        ids = row.build(CellRanges.of(volume), report.part(0, 0))(0.5, report.part(0, 0))
    for i, kind in enumerate(EXTRACTORS.values(), 1 + len(FINDERS)):
        report(i / jobs, _MESSAGE)
        kind.extract(volume, 0.5, None, progress=report.part(i / jobs, i / jobs))
        kind.extract(volume, 0.5, ids, progress=report.part(i / jobs, i / jobs))
