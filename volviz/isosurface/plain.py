"""The cases that are not ambiguous, as tables that a loop without branches can follow.

Vertices are numbered along each row of edges, so that of the twelve edges of a cell eight have a
counter (four rows along x, two along y, two along z), and what a cell adds to them follows from
its case. Rows of 16 numbers, one per edge and then zeros, are what a processor adds in one go.
"""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.cases import EDGES, cases, inside

AMBIGUOUS = 255
MOST = 5
"""Triangles of a case that is not ambiguous, at most."""


class Plain(NamedTuple):
    """size: uint8[256], triangles, or `AMBIGUOUS`. The others are uint8[256 · 16], 16 per case.

    rows: edges of the triangles, three each; turned: the same, wound the other way. own: what to
    add to the counter of an edge's row for its number; step: what the cell adds to the counter.
    """

    size: NDArray[np.uint8]
    rows: NDArray[np.uint8]
    turned: NDArray[np.uint8]
    own: NDArray[np.uint8]
    step: NDArray[np.uint8]


@cache
def plain() -> Plain:
    """The tables, from those of `cases`."""
    table = cases()
    size = np.full(256, AMBIGUOUS, dtype=np.uint8)
    rows, turned, own, step = (np.zeros((256, 16), dtype=np.uint8) for _ in range(4))
    for case in range(256):
        crossed = [inside(case, a) != inside(case, b) for a, b in EDGES]
        for edge in range(12):
            along_x, far = edge < 4, edge >= 4 and edge % 2 == 1
            own[case, edge] = far and crossed[edge - 1]
            step[case, edge] = crossed[edge] if along_x or not far else crossed[edge - 1]
        if table.ambiguous[case]:
            continue
        first, last = table.start[table.entry[case, 0] :][:2]
        size[case] = last - first
        rows[case, : 3 * (last - first)] = table.triangles[first:last].reshape(-1)
        turned[case, : 3 * (last - first)] = table.turned[first:last].reshape(-1)
    flat = (a.reshape(-1) for a in (rows, turned, own, step))
    return Plain(size, *flat)
