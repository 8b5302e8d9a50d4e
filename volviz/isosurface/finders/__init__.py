"""Which cells to visit: one finder per file, one row here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finder import Finder
from volviz.isosurface.finders import (
    bono,
    bricks,
    brute_force,
    interval_tree,
    intervals,
    issue,
    noise,
    octree,
    propagation,
)
from volviz.progress import Progress

Build = Callable[[CellRanges, Progress | None], Finder]


@dataclass(frozen=True)
class Row:
    """A way to find the active cells. guarantee: what it promises, for people."""

    build: Build
    guarantee: str


FINDERS: dict[str, Row] = {
    "bricks": Row(
        bricks.build,
        "Exactly the active cells, in order. Looks at the ranges of all bricks of 4×4×4 cells "
        "(64 consecutive ones of tetrahedra) and at the cells of the active ones. Keeps 1/32 of "
        "the memory of the samples.",
    ),
    "brute-force": Row(
        brute_force.build,
        "Exactly the active cells, in order. Looks at every cell, keeps nothing.",
    ),
    "octree": Row(
        octree.build,
        "Exactly the active cells, in order. Looks at the children of active nodes and at the "
        "cells of active leaves, at most 2×2×2 each (boxes of space with tetrahedra). All sides "
        "are halved equally often; keeps the range of every node that has a cell, of (s³ − 1) / 7 "
        "in a full tree of s cells a side.",
    ),
    "bono": Row(
        bono.build,
        "Exactly the active cells, in order. Looks at the children of active nodes and at the "
        "cells of active leaves, at most 2×2×2 each (boxes of space with tetrahedra). Keeps the "
        "ranges of Σ Π ⌈n / 2ˡ⌉ nodes: less than 0.162 of n cells if no side is shorter than 32.",
    ),
    "intervals": Row(
        intervals.build,
        "Exactly the active cells, in order. In each class of spans that differ by less than a "
        "factor of 2, looks at cells with an end within twice the span of the isovalue, in the "
        "better of two sorted lists; of values that occur equally often, a few times the active "
        "cells, otherwise no bound. Keeps each cell twice with both ends.",
    ),
    "interval-tree": Row(
        interval_tree.build,
        "Exactly the active cells, in order. Looks at the k active cells and at most 3 more per "
        "level of a tree of ⌈log₂ h⌉ levels over the h distinct values: O(k + log h), whatever the "
        "data. Keeps each cell that can be active twice with one end.",
    ),
    "noise": Row(
        noise.build,
        "Exactly the active cells, in order. Looks at O(√n + k) of n cells that can be active, "
        "whatever the data. Keeps each of them once with both ends.",
    ),
    "issue": Row(
        issue.build,
        "Exactly the active cells, in order. Beyond the k active cells it looks at no more than "
        "one per row of a lattice of L ≤ 256 rows and at O(√m) of the m cells in one part of its "
        "diagonal. Keeps cells off the diagonal twice with one end, the others once with both.",
    ),
    "propagation": Row(
        propagation.build,
        "Exactly the active cells, in order. Walks over crossed faces from seeds of which every "
        "component of every isovalue has one, and looks at no other cells than active ones and "
        "their neighbours. Keeps the rank of every sample, the seeds with both ends twice, and of "
        "tetrahedra four neighbours each.",
    ),
}
