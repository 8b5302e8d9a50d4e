"""Where the vertices of an adaptive surface are, and their normals between samples."""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.adaptive.dual import middle_of
from volviz.isosurface.adaptive.leaves import valid
from volviz.isosurface.adaptive.ranges import BLOCK, SIDE
from volviz.isosurface.kernel import hot, inline, kernel
from volviz.isosurface.slopes import slopes


@kernel
def on_edges(
    field: Any, bits: Any, state: Any, leaves: Any, operator: int, numbers: Any, first: int,
    last: int, points: Any, gradients: Any,
) -> None:  # fmt: skip
    """Index coordinates and gradients of the vertices with these numbers (`dual`); those inside
    cells, below 0, are left out.

    points: float64[n, 3]. gradients: float64[n, 3] per sample, NaN where a leaf is coarser than a
    sample.
    """
    nz, ny, nx = field.data.shape
    ends, two = np.empty((2, 3)), np.empty((2, 3))
    for n in range(first, last):
        if numbers[n] < 0:
            continue
        start, face = numbers[n] // 6, numbers[n] % 6
        axis, back = face >> 1, face & 1
        x, y, z = start % nx, start // nx % ny, start // (nx * ny)
        level, value = _leaf(field, state, leaves, z, y, x)
        step = -1 if back else 1 << level
        x, y, z = x + step * (axis == 0), y + step * (axis == 1), z + step * (axis == 2)
        other, beyond = _leaf(field, state, leaves, z, y, x)
        there = ((z >> other << other) * ny + (y >> other << other)) * nx + (x >> other << other)
        middle_of(start, level, (nz, ny, nx), ends[0])
        middle_of(there, other, (nz, ny, nx), ends[1])
        t = value / (value - beyond)
        for r in range(3):
            points[n, r] = ends[0, r] + t * (ends[1, r] - ends[0, r])
            gradients[n, r] = np.nan
        if level == 0 and other == 0 and operator >= 0:
            for e in range(2):
                c, b, a = np.int64(ends[e, 2]), np.int64(ends[e, 1]), np.int64(ends[e, 0])
                slopes(field.data, bits, c, b, a, operator, two[e])
            for r in range(3):
                gradients[n, r] = two[0, r] + t * (two[1, r] - two[0, r])


@inline
def _leaf(field: Any, state: Any, leaves: Any, z: int, y: int, x: int) -> Any:
    """(level, value above the isovalue) of the leaf at a sample."""
    slot = state[z >> BLOCK, y >> BLOCK, x >> BLOCK]
    c, b, a = (z & SIDE - 1) >> 1, (y & SIDE - 1) >> 1, (x & SIDE - 1) >> 1
    level = np.int64(leaves.level[slot, c, b, a])
    value = np.float64(field.data[z, y, x]) if level == 0 else leaves.value[slot, c, b, a]
    return level, value - field.isovalue


@kernel
def inside(field: Any, bits: Any, operator: int, places: Any, gradients: Any) -> None:
    """Gradients at the places inside cells, float64[m, 4] (index x, y, z; level of the coarsest
    corner); NaN as above."""
    g = np.empty(3)
    for n in range(len(places)):
        gradients[n] = np.nan
        if places[n, 3] > 0 or operator < 0:
            continue
        gradients[n] = 0.0
        for c in range(8):
            weight = 1.0
            at = np.empty(3, np.int64)
            for r in range(3):
                low = np.floor(places[n, r])
                part = places[n, r] - low
                weight *= part if c >> r & 1 else 1 - part
                at[r] = np.int64(low) + (c >> r & 1)
            if weight > 0 and _there(field, at):
                slopes(field.data, bits, at[2], at[1], at[0], operator, g)
                gradients[n] += weight * g


@hot
def _there(field: Any, at: Any) -> bool:
    nz, ny, nx = field.data.shape
    good = 0 <= at[2] < nz and 0 <= at[1] < ny and 0 <= at[0] < nx
    return good and valid(field, field.data[at[2], at[1], at[0]])
