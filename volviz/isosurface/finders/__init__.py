"""Which cells to visit: one finder per file, one row here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finder import Finder
from volviz.isosurface.finders import bricks, brute_force
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
}
