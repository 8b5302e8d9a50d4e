"""The branch-on-need octree: nodes of 2, 4, 8 … cells, none where there are no cells.

Wilhelms and Van Gelder, Octrees for faster isosurface generation, 1992. It has
Σ Π ⌈n / 2ˡ⌉ nodes over the levels l = 1, 2, … until one is left; that is less than 0.162 of the
cells if no side is shorter than 32.
"""

from __future__ import annotations

from math import prod

import numpy as np

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finder import Finder
from volviz.isosurface.finders.pyramid import Shape, Starts, tree
from volviz.progress import Progress


def build(cells: CellRanges, progress: Progress | None = None) -> Finder:
    """Ranges of all nodes, in one pass over the samples."""
    return tree("bono", cells, divide, False, progress)


def nodes(shape: Shape) -> int:
    """Nodes of the tree over so many cells along each axis."""
    return sum(prod(s.size for s in level) for level in divide(shape))


def divide(shape: Shape) -> list[Starts]:
    """A node of level l starts at each multiple of 2ˡ cells."""
    levels = max(1, (max(shape) - 1).bit_length())
    return [
        tuple(np.arange(0, n, 1 << level, dtype=np.int64) for n in shape)
        for level in range(1, levels + 1)
    ]
