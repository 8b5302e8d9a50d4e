"""The octree of even subdivision: what the branch-on-need octree is compared with.

Each node is halved along every axis until no leaf is wider than 2 cells (Wilhelms and Van Gelder,
Octrees for faster isosurface generation, 1992). A full tree has (s³ − 1) / 7 nodes, s being the
least power of two that is at least the longest side; nodes that hold no cell are not kept.
"""

from __future__ import annotations

import numpy as np

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finder import Finder
from volviz.isosurface.finders.pyramid import Shape, Starts, tree
from volviz.progress import Progress


def build(cells: CellRanges, progress: Progress | None = None) -> Finder:
    """Ranges of all nodes that hold a cell, in one pass over the samples."""
    return tree("octree", cells, divide, True, progress)


def nodes(shape: Shape) -> int:
    """Nodes of the full tree over so many cells along each axis, the empty ones counted."""
    return int((8 ** _depth(shape) - 1) // 7)


def divide(shape: Shape) -> list[Starts]:
    """Node a of 2ⁱ along an axis of n cells starts at cell ⌊a·n / 2ⁱ⌋."""
    return [
        tuple(np.unique(np.arange(1 << i, dtype=np.int64) * n >> i) for n in shape)
        for i in reversed(range(_depth(shape)))
    ]


def _depth(shape: Shape) -> int:
    return max(1, (max(shape) - 1).bit_length())
