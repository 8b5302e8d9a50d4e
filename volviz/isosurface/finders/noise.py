"""A kd-tree of span space, without pointers.

Livnat, Shen, Johnson (A near optimal isosurface extraction algorithm using the span space, 1996).
The middle point of a part of the array is its node, those before it are no higher and those after
it no lower along the node's axis; the axes alternate, low ends first. A search looks at
O(√n + k) points. Where one condition is known to hold for all of a part, only the other is tested.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finder import Finder
from volviz.isosurface.finders.span import Points, Ranks, Search, span_finder
from volviz.isosurface.kernel import kernel
from volviz.isosurface.trace import Trace
from volviz.progress import Progress

_DEPTH = 80  # parts that wait on the stack: one per level, and levels halve the part
_UNSEEN = np.empty(0, dtype=np.bool_)
BOTH, LOW, HIGH = 0, 1, 2  # what is to be tested still


def build(cells: CellRanges, progress: Progress | None = None) -> Finder:
    """Sorts all cells that can be active into the tree, once."""
    return span_finder("noise", cells, index, progress)


def index(points: Points) -> tuple[Search, int]:
    """The tree of these cells."""
    order = np.arange(points.ids.size)
    arrange(points.low, points.high, order, np.array([0, order.size]))
    ids, low, high = points.ids[order], points.low[order], points.high[order]

    def search(rank: int, trace: Trace | None = None) -> tuple[list[NDArray[Any]], int]:
        at, visited = places(low, high, rank, 0, ids.size)
        if trace is not None:
            tell(trace, ids, low, high, rank, 0, ids.size)
        return [ids[at]], visited

    return search, ids.nbytes + low.nbytes + high.nbytes


def places(low: Ranks, high: Ranks, rank: int, first: int, last: int) -> tuple[Any, int]:
    """Where in the tree first … last the active cells are, and how many points were looked at."""
    out = np.empty(1024, dtype=np.int64)
    count, visited = search_tree(low, high, rank, first, last, out, _UNSEEN)
    if count > out.size:
        out = np.empty(count, dtype=np.int64)
        search_tree(low, high, rank, first, last, out, _UNSEEN)
    return out[:count], int(visited)


def tell(
    trace: Trace, ids: NDArray[Any], low: Ranks, high: Ranks, rank: int, first: int, last: int
) -> None:
    """Which points of the tree first … last a search tests, which it takes with a whole part."""
    seen, out = np.zeros(last, dtype=np.bool_), np.empty(max(last - first, 1), dtype=np.int64)
    count, _ = search_tree(low, high, rank, first, last, out, seen)
    at = out[:count]
    trace.tested(ids[:last][seen])
    trace.reported(ids[at[~seen[at]]])


@kernel
def arrange(low: Any, high: Any, order: Any, edges: Any) -> None:
    """Permute order so that each of the parts edges[i] … edges[i + 1] is a tree."""
    stack = np.empty((_DEPTH, 3), np.int64)
    for part in range(edges.size - 1):
        stack[0] = edges[part], edges[part + 1], 0
        top = 1
        while top > 0:
            top -= 1
            a, b, axis = stack[top]
            if b - a < 2:
                continue
            key = high if axis else low
            middle = (a + b) // 2
            left, right = a, b - 1
            while left < right:  # Hoare's selection
                pivot = key[order[(left + right) // 2]]
                i, j = left, right
                while i <= j:
                    while key[order[i]] < pivot:
                        i += 1
                    while key[order[j]] > pivot:
                        j -= 1
                    if i <= j:
                        order[i], order[j] = order[j], order[i]
                        i += 1
                        j -= 1
                if middle <= j:
                    right = j
                elif middle >= i:
                    left = i
                else:
                    break
            stack[top] = a, middle, 1 - axis
            stack[top + 1] = middle + 1, b, 1 - axis
            top += 2


@kernel
def search_tree(low: Any, high: Any, rank: int, first: int, last: int, out: Any, seen: Any) -> Any:
    """Places with low < rank ≤ high in the tree first … last, as many as out holds; how many
    there are, and how many points were looked at. seen: bool, set where a point is tested; may be
    empty."""
    stack = np.empty((_DEPTH, 4), np.int64)
    stack[0] = first, last, 0, BOTH
    top, count, visited = 1, 0, 0
    while top > 0:
        top -= 1
        a, b, axis, test = stack[top]
        if a >= b:
            continue
        middle = (a + b) // 2
        visited += 1
        if seen.size:
            seen[middle] = True
        starts, ends = low[middle] < rank, high[middle] >= rank
        if starts and ends:
            if count < out.size:
                out[count] = middle
            count += 1
        before, after = test, test  # what the parts before and after have to be tested for
        if axis == 0 and test != HIGH:
            if starts:
                before = HIGH if test == BOTH else -1
            else:
                after = -2
        elif axis == 1 and test != LOW:
            if ends:
                after = LOW if test == BOTH else -1
            else:
                before = -2
        for part in range(2):
            a1, b1, rest = (a, middle, before) if part == 0 else (middle + 1, b, after)
            if rest == -1:  # all of them are active
                for i in range(a1, b1):
                    if count < out.size:
                        out[count] = i
                    count += 1
                visited += b1 - a1
            elif rest >= 0:
                stack[top] = a1, b1, 1 - axis, rest
                top += 1
    return count, visited
