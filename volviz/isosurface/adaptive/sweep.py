"""Blocks from front to back: judged, cut into leaves, and the cells round them contoured.

A cell is made when the last of the blocks that its corners are in is cut; so each is made once,
as early as it can hide something. A block that is outside the frame or hidden is left out, and
with it the cells that reach into it. What was found for the picture before, if only the lens has
moved since, is taken from there: leaves that it cuts alike, and the triangles of blocks that have
the same leaves in and round them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.adaptive.dual import LEFT_OUT, READY, cells, gather, workspace
from volviz.isosurface.adaptive.leaves import Leaves, allowed, cut, row, take_over
from volviz.isosurface.adaptive.occlusion import OUTSIDE, SEEN, hide, judged
from volviz.isosurface.adaptive.ranges import BLOCK, SIDE
from volviz.isosurface.kernel import inline, kernel

ROOM = 32 * (SIDE + 1) ** 3
"""Triangles that a block may have: 25 in a cell at most. Of vertices inside cells, a quarter."""
MIXED = -1
"""Code of a block that the lens does not cut alike all over."""


class Run(NamedTuple):
    """Blocks of a picture. state: int32[z, y, x], as in `dual`. Per block, in order: leaves (one
    more, to work in); codes int64[n], how the lens cuts it; spans int64[n, 2], its triangles.
    screen: float32[m, 7], where the triangles are in the picture."""

    state: NDArray[np.int32]
    leaves: Leaves
    codes: NDArray[np.int64]
    spans: NDArray[np.int64]
    screen: NDArray[np.float32]


@kernel
def sweep(
    field: Any, ranges: Any, sight: Any, cases: Any, options: Any, blocks: Any, span: Any,
    run: Any, last: Any, news: Any, depth: Any, out: Any, counts: Any,
) -> int:  # fmt: skip
    """Blocks span[0] to span[1] of int64[n, 3] `blocks` (z, y, x), or as many as there is room for;
    returns the next one.

    run: of this picture, its leaves those of the last; last: of the one before (no blocks: none).
    news: (leaves changed bool[n], triangles as in the last run from there on int64[n], or −1).
    counts: int64[5], of triangles and vertices inside cells in `out`, of blocks cut, outside and
    hidden so far.
    """
    space, box = workspace(), np.empty(6)
    for n in range(span[0], span[1]):
        if counts[0] + ROOM > out[0].shape[0] or counts[1] + ROOM // 4 > out[1].shape[0]:
            return n
        block = (blocks[n, 0], blocks[n, 1], blocks[n, 2])
        run.spans[n], news[1][n] = counts[0], -1
        _box(field, sight, block, box)
        seen = judged(sight, depth, box) if options[2] else SEEN
        if seen != SEEN:
            run.state[block] = LEFT_OUT
            counts[3 if seen == OUTSIDE else 4] += 1
            continue
        counts[2] += 1
        run.state[block] = n
        news[0][n] = _leaves(field, ranges, sight, block, n, run, last)
        if not news[0][n] and _as_before(run.state, last.state, news[0], block):
            news[1][n] = last.spans[n, 0]
            _again(last, n, depth, out, counts)
        else:
            step = 1 << _least(run.state, run.leaves, block)
            gather(field, run.state, run.leaves, block, step, space)
            cells(field, sight, cases, options, block, step, space, depth, out, counts)
        run.spans[n, 1] = counts[0]
    return span[1]


@inline
def _leaves(field: Any, ranges: Any, sight: Any, block: Any, n: int, run: Any, last: Any) -> bool:
    """Cut a block; True if its leaves are not those that it had in the run before."""
    run.codes[n] = _code(field, sight, block)
    had = last.state.size > 0 and last.state[block] == n
    if had and run.codes[n] != MIXED and run.codes[n] == last.codes[n]:
        return False
    spare, leaves = run.leaves.least.size - 1, run.leaves
    cut(field, ranges, sight, block, leaves, spare, n)
    changed = take_over(leaves, n, spare)
    return changed or not had


@inline
def _code(field: Any, sight: Any, block: Any) -> int:
    """Which levels of nodes the lens cuts, by a bit each, if that is the same all over a block."""
    half = 0.5 * (SIDE - 1)
    z, y, x = (block[0] << BLOCK) + half, (block[1] << BLOCK) + half, (block[2] << BLOCK) + half
    away = 0.0
    for r in range(3):
        off = row(sight.world, r, x, y, z) - sight.focus[r]
        away += off * off
    away, reach, code = np.sqrt(away), sight.reach, 0
    for n in range(BLOCK, 0, -1):
        side = sight.side * (1 << n)
        inner = away - reach - 0.87 * side - sight.radius
        outer = inner + 2 * reach
        if side <= sight.growth * max(inner, 0.0):
            continue
        if side <= sight.growth * max(outer, 0.0):
            return MIXED
        code |= 1 << n
    return code


@inline
def _as_before(state: Any, before: Any, changed: Any, block: Any) -> bool:
    """True if all that the cells of a block are made of is as it was in the run before."""
    for k in range(max(block[0] - 1, 0), min(block[0] + 2, state.shape[0])):
        for j in range(max(block[1] - 1, 0), min(block[1] + 2, state.shape[1])):
            for i in range(max(block[2] - 1, 0), min(block[2] + 2, state.shape[2])):
                now = state[k, j, i]
                if now >= READY and (before[k, j, i] != now or changed[now]):
                    return False
                if now == LEFT_OUT and before[k, j, i] != LEFT_OUT:
                    return False
    return True


@inline
def _again(last: Any, n: int, depth: Any, out: Any, counts: Any) -> None:
    """The triangles of a block of the run before hide what is behind them."""
    first, past = last.spans[n, 0], last.spans[n, 1]
    if depth.size:
        for t in range(first, past):
            for k in range(last.screen.shape[1]):
                out[2][counts[0] + t - first, k] = last.screen[t, k]
            hide(depth, last.screen[t])
    counts[0] += past - first


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
