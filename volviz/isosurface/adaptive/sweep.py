"""Blocks from front to back: judged, cut into leaves, and the cells round them contoured.

A cell is made when the last of the blocks that its corners are in is cut; so each is made once,
as early as it can hide something. A block that is outside the frame or hidden is left out, and
with it the cells that reach into it.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from volviz.isosurface.adaptive.dual import LEFT_OUT, READY, cells, gather, workspace
from volviz.isosurface.adaptive.leaves import allowed, cut
from volviz.isosurface.adaptive.occlusion import OUTSIDE, SEEN, judged
from volviz.isosurface.adaptive.ranges import BLOCK, SIDE
from volviz.isosurface.kernel import inline, kernel

ROOM = 32 * (SIDE + 1) ** 3
"""Triangles that a block may have: 25 in a cell at most. Of vertices inside cells, a quarter."""


@kernel
def sweep(
    field: Any, ranges: Any, sight: Any, cases: Any, options: Any, blocks: Any, span: Any,
    state: Any, leaves: Any, depth: Any, out: Any, counts: Any,
) -> int:  # fmt: skip
    """Blocks span[0] to span[1] of int64[n, 3] `blocks` (z, y, x), or as many as there is room for;
    returns the next one.

    state: int32[z, y, x] of all blocks, as in `dual`. counts: int64[6], of triangles and vertices
    inside cells in `out`, of blocks cut, outside and hidden so far, and of leaves.
    """
    space, box = workspace(), np.empty(6)
    for n in range(span[0], span[1]):
        if counts[0] + ROOM > out[0].shape[0] or counts[1] + ROOM // 4 > out[1].shape[0]:
            return n
        block = (blocks[n, 0], blocks[n, 1], blocks[n, 2])
        _box(field, sight, block, box)
        seen = judged(sight, depth, box) if options[2] else SEEN
        if seen != SEEN:
            state[block] = LEFT_OUT
            counts[3 if seen == OUTSIDE else 4] += 1
            continue
        slot = counts[2]
        counts[2] += 1
        cut(field, ranges, sight, block, leaves, slot)
        state[block] = slot
        step = 1 << _least(state, leaves, block)
        gather(field, state, leaves, block, step, space)
        cells(field, sight, cases, options, block, step, space, depth, out, counts)
    return span[1]


@inline
def _box(field: Any, sight: Any, block: Any, box: Any) -> None:
    """Index coordinates of a block and of all cells that would be missing without it."""
    half = 0.5 * (SIDE - 1)
    z, y, x = (block[0] << BLOCK) + half, (block[1] << BLOCK) + half, (block[2] << BLOCK) + half
    most, least = allowed(sight, x, y, z, -2.0 * SIDE * sight.side)
    side = min(max(most, 2 * least) / sight.side, np.float64(SIDE))
    margin = 0.5 + max(0.5 * side, 1.0)
    for r in range(3):
        box[r] = max((block[2 - r] << BLOCK) - margin, 0.0)
        last = min((block[2 - r] + 1) << BLOCK, field.data.shape[2 - r]) - 1
        box[3 + r] = min(last + margin, field.data.shape[2 - r] - 1.0)


@inline
def _least(state: Any, leaves: Any, block: Any) -> int:
    """The least level of the leaves of a block and of those next to it that are cut."""
    least = BLOCK
    for k in range(max(block[0] - 1, 0), min(block[0] + 2, state.shape[0])):
        for j in range(max(block[1] - 1, 0), min(block[1] + 2, state.shape[1])):
            for i in range(max(block[2] - 1, 0), min(block[2] + 2, state.shape[2])):
                slot = state[k, j, i]
                if slot >= READY:
                    least = min(least, int(leaves.least[slot]))
    return least
