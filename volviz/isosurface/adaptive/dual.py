"""Marching cubes on the dual grid of the leaves: no cracks, whatever the sizes of neighbours.

Primal contouring of dual grids (Schaefer and Warren 2004): round every corner of a leaf there are
eight octants, each in some leaf, and these leaves are the corners of a cell. The cells fill the
volume without gaps and share their faces, whatever the leaves' sizes: where a leaf holds several
of the octants, corners of the cell fall together. So marching cubes over these cells closes, as
on a plain grid, with the same cases and the same decisions of ambiguous faces, which neighbours
take from the same four values; triangles whose corners fall together are left out. Between leaves
of one sample the cells are those of the volume, and so is the surface.

The finer one of two leaves that share a face knows the other one by its own face: its first sample
and the face number the vertex between them.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.adaptive.leaves import valid
from volviz.isosurface.adaptive.occlusion import hide, projected
from volviz.isosurface.adaptive.ranges import BLOCK, SIDE
from volviz.isosurface.ambiguity import decide, trilinear
from volviz.isosurface.cases import CENTER, EDGES
from volviz.isosurface.kernel import hot, inline
from volviz.isosurface.marching import tube_size
from volviz.isosurface.tubes import NECK, PLACES, middle, neck, tube_triangles

READY = 0
"""States of blocks below: their number if they are cut, else one of these."""
ABOVE, BELOW, NOTHING = 1, 2, 4
"""What there is of a sample, or of several together."""
EMPTY, WAITING, LEFT_OUT = -1, -2, -3
ACROSS = SIDE + 2
_ENDS = np.array(EDGES)
_AXES = np.array([0] * 4 + [1] * 4 + [2] * 4)


@inline
def workspace() -> Any:
    """Values, levels and signs of the leaves round a block; of a cell its corners' values, places,
    levels and first samples; places of vertices, in the cell and in the volume; their numbers; the
    corners of a triangle; triangles of a tube; saddles."""
    return (
        np.empty((ACROSS, ACROSS, ACROSS)),
        np.empty((ACROSS, ACROSS, ACROSS), np.int64),
        np.empty((ACROSS, ACROSS, ACROSS), np.uint8),
        np.empty(8),
        np.empty((8, 3)),
        np.empty(8, np.int64),
        np.empty(8, np.int64),
        np.empty((PLACES, 3)),
        np.empty((PLACES, 3)),
        np.empty(PLACES, np.int64),
        np.empty((3, 3)),
        np.empty((32, 3), np.uint8),
        np.empty((2, 3)),
    )


@inline
def gather(field: Any, state: Any, leaves: Any, block: Any, step: int, space: Any) -> None:
    """The leaves of a block and of a ring of cells of `step` samples round it; NaN: none there."""
    inner = SIDE // step
    for c in range(-1, 2):
        for b in range(-1, 2):
            for a in range(-1, 2):
                at = (block[0] + c, block[1] + b, block[2] + a)
                there = 0 <= at[0] < state.shape[0] and 0 <= at[1] < state.shape[1]
                there = there and 0 <= at[2] < state.shape[2]
                slot = state[at] if there else EMPTY
                lows = (_low(c, inner), _low(b, inner), _low(a, inner))
                highs = (_high(c, inner), _high(b, inner), _high(a, inner))
                _gather_from(field, leaves, slot, block, step, (lows, highs), space)


@inline
def _low(side: int, inner: int) -> int:
    return 0 if side < 0 else 1 if side == 0 else inner + 1


@inline
def _high(side: int, inner: int) -> int:
    return 1 if side < 0 else inner + 1 if side == 0 else inner + 2


@inline
def _gather_from(
    field: Any, leaves: Any, slot: int, block: Any, step: int, span: Any, space: Any
) -> None:
    """The part of it that is in the block of this number; below READY: in none."""
    values, levels, signs = space[0], space[1], space[2]
    nz, ny, nx = field.data.shape
    for k in range(span[0][0], span[1][0]):
        z = (block[0] << BLOCK) + (k - 1) * step
        for j in range(span[0][1], span[1][1]):
            y = (block[1] << BLOCK) + (j - 1) * step
            for i in range(span[0][2], span[1][2]):
                x = (block[2] << BLOCK) + (i - 1) * step
                value = np.nan
                if slot >= READY and z < nz and y < ny and x < nx:
                    c, b, a = (z & SIDE - 1) >> 1, (y & SIDE - 1) >> 1, (x & SIDE - 1) >> 1
                    level = np.int64(leaves.level[slot, c, b, a])
                    levels[k, j, i] = level
                    if level > 0:
                        value = leaves.value[slot, c, b, a] - field.isovalue
                    elif valid(field, field.data[z, y, x]):
                        value = np.float64(field.data[z, y, x]) - field.isovalue
                values[k, j, i] = value
                signs[k, j, i] = ABOVE if value >= 0 else BELOW if value < 0 else NOTHING


@inline
def cells(
    field: Any, sight: Any, cases: Any, options: Any, block: Any, step: int, space: Any,
    depth: Any, out: Any, counts: Any,
) -> None:  # fmt: skip
    """The triangles of the cells round the corners in and on a block all of whose leaves are known.

    options: rule of ambiguous cells, and whether triangles turn round. out: (numbers of vertices
    int64[n, 3], places inside cells float64[m, 4], places in the picture float32[n, 7]), filled
    from `counts` on, (n, m, n).
    """
    values, levels, signs, at = space[0], space[1], space[2], space[3]
    steps = SIDE // step + 1
    for k in range(steps):
        for j in range(steps):
            after = (
                signs[k, j, 0] | signs[k, j + 1, 0] | signs[k + 1, j, 0] | signs[k + 1, j + 1, 0]
            )
            for i in range(steps):
                before = after
                after = signs[k, j, i + 1] | signs[k, j + 1, i + 1]
                after |= signs[k + 1, j, i + 1] | signs[k + 1, j + 1, i + 1]
                if before | after != ABOVE | BELOW:
                    continue
                case = 0
                corner = False  # of some leaf?
                for c in range(8):
                    at[c] = values[k + (c >> 2), j + (c >> 1 & 1), i + (c & 1)]
                    case |= (at[c] >= 0) << c
                    mask = (1 << levels[k + (c >> 2), j + (c >> 1 & 1), i + (c & 1)]) - 1
                    corner = corner or ((k | j | i) * step) & mask == 0
                if corner:
                    _corners(field, space, block, step, k, j, i)
                    _cell(field, sight, cases, options, case, space, depth, out, counts)


@inline
def _corners(field: Any, space: Any, block: Any, step: int, k: int, j: int, i: int) -> None:
    """Places (index x, y, z), levels and first samples of a cell's corners."""
    levels, places, own, starts = space[1], space[4], space[5], space[6]
    nz, ny, nx = field.data.shape
    for c in range(8):
        level = levels[k + (c >> 2), j + (c >> 1 & 1), i + (c & 1)]
        z = (block[0] << BLOCK) + (k + (c >> 2) - 1) * step
        y = (block[1] << BLOCK) + (j + (c >> 1 & 1) - 1) * step
        x = (block[2] << BLOCK) + (i + (c & 1) - 1) * step
        first = ((z >> level << level) * ny + (y >> level << level)) * nx + (x >> level << level)
        own[c], starts[c] = level, first
        middle_of(first, level, (nz, ny, nx), places[c])


@hot
def middle_of(first: int, level: int, shape: Any, out: Any) -> None:
    """Index x, y, z of the middle of a leaf's samples."""
    nz, ny, nx = shape
    x, y, z, size = first % nx, first // nx % ny, first // (nx * ny), 1 << level
    out[0] = 0.5 * (x + min(x + size, nx) - 1)
    out[1] = 0.5 * (y + min(y + size, ny) - 1)
    out[2] = 0.5 * (z + min(z + size, nz) - 1)


@inline
def _cell(
    field: Any, sight: Any, cases: Any, options: Any, case: int, space: Any,
    depth: Any, out: Any, counts: Any,
) -> None:  # fmt: skip
    """Triangles of one cell."""
    at, local, local_tube, found = space[3], space[7], space[11], space[12]
    entry, tube = np.int64(cases.entry[case, 0]), -1
    if cases.ambiguous[case]:
        entry, tube = decide(at, case, cases, options[0], found)
    _on_edges(case, space)
    if tube >= 0:
        neck(at, found, local)
        _inside(space, NECK, NECK + 6, out, counts)
        tube_triangles(cases.tubes[tube], local, np.empty((2, 3)), local_tube)
        for t in range(tube_size(cases.tubes, tube)):
            _triangle(sight, options, local_tube[t], space, depth, out, counts)
        return
    if cases.center[entry, 0]:
        middle(at, cases.center[entry], local)
        _inside(space, CENTER, CENTER + 1, out, counts)
    for t in range(cases.start[entry], cases.start[entry + 1]):
        _triangle(sight, options, cases.triangles[t], space, depth, out, counts)


@inline
def _on_edges(case: int, space: Any) -> None:
    """Numbers and places of the vertices on the crossed edges."""
    at, corners, own, starts, places, numbers = (
        space[3], space[4], space[5], space[6], space[8], space[9]
    )  # fmt: skip
    for e in range(12):
        a, b = _ENDS[e, 0], _ENDS[e, 1]
        if (case >> a & 1) == (case >> b & 1):
            continue
        if own[a] <= own[b]:
            numbers[e] = 6 * starts[a] + 2 * _AXES[e]
        else:
            numbers[e] = 6 * starts[b] + 2 * _AXES[e] + 1
        t = at[a] / (at[a] - at[b])
        for r in range(3):
            places[e, r] = corners[a, r] + t * (corners[b, r] - corners[a, r])


@inline
def _inside(space: Any, first: int, last: int, out: Any, counts: Any) -> None:
    """The vertices inside a cell; below 0, by their place in the list of them."""
    corners, own, local, places, numbers = space[4], space[5], space[7], space[8], space[9]
    for v in range(first, last):
        for r in range(3):
            places[v, r] = trilinear(corners[:, r], local[v, 0], local[v, 1], local[v, 2])
            out[1][counts[1], r] = places[v, r]
        out[1][counts[1], 3] = own.max()
        numbers[v] = -1 - counts[1]
        counts[1] += 1


@inline
def _triangle(
    sight: Any, options: Any, triangle: Any, space: Any, depth: Any, out: Any, counts: Any
) -> None:
    """One triangle, if its corners are three; it hides what is behind it."""
    places, numbers, corners = space[8], space[9], space[10]
    a, b, c = np.int64(triangle[0]), np.int64(triangle[1]), np.int64(triangle[2])
    if options[1]:
        a, c = c, a
    if numbers[a] == numbers[b] or numbers[b] == numbers[c] or numbers[c] == numbers[a]:
        return
    n = counts[0]
    out[0][n, 0], out[0][n, 1], out[0][n, 2] = numbers[a], numbers[b], numbers[c]
    counts[0] += 1
    if depth.size:
        for r in range(3):
            corners[0, r], corners[1, r], corners[2, r] = places[a, r], places[b, r], places[c, r]
        projected(sight, depth, corners, out[2][n])
        hide(depth, out[2][n])
