"""The interval tree: a cell is kept at the highest node whose value lies in its range.

Cignoni, Marino, Montani, Puppo, Scopigno (Optimal isosurface extraction from irregular volume
data, 1996; Speeding up isosurface extraction using interval trees, 1997). The nodes are the ranks
of the h distinct values as a balanced search tree: p with t trailing zero bits has the children
p ± 2ᵗ⁻¹. Each keeps its cells twice, by ascending low and by descending high end, and a query
reports a prefix of one list per node on one way down: O(k + log h).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface.cells import CellRanges
from volviz.isosurface.finder import Finder
from volviz.isosurface.finders.span import Points, Ranks, Search, span_finder
from volviz.isosurface.trace import Trace
from volviz.progress import Progress


def build(cells: CellRanges, progress: Progress | None = None) -> Finder:
    """Sorts all cells that can be active into the nodes, twice."""
    return span_finder("interval-tree", cells, index, progress)


def index(points: Points) -> tuple[Search, int]:
    """The tree of these cells."""
    made = Tree.of(points)
    return made.search, made.nbytes


@dataclass(frozen=True, eq=False)
class Tree:
    """Node p has the cells of `starts[p] : starts[p + 1]` in both lists.

    ascending: ids by ascending low rank, which is in `low`; descending: ids by descending high
    rank, whose negative is in `high`.
    """

    height: int
    starts: NDArray[np.int64]
    ascending: NDArray[Any]
    low: Ranks
    descending: NDArray[Any]
    high: Ranks

    @classmethod
    def of(cls, points: Points) -> Tree:
        """The tree of these cells, every one with low < high."""
        count = points.values.size
        low, high = points.low, points.high
        # the number in low + 1 … high with most trailing zeros: high from their first other bit on
        shift = np.frexp((low ^ high).astype(np.float64))[1] - 1
        node = (high >> shift) << shift
        up, down = np.lexsort((low, node)), np.lexsort((-high, node))
        return cls(
            max(1, (count - 1).bit_length()),
            np.searchsorted(node[up], np.arange(count + 1)),
            points.ids[up],
            low[up],
            points.ids[down],
            -high[down],
        )

    def search(self, rank: int, trace: Trace | None = None) -> tuple[list[NDArray[Any]], int]:
        """Ids of the cells with low < rank ≤ high, one piece per node with any.

        Counted as visited: the nodes, the cells found, and in each list the first cell not found.
        """
        found, visited = [], 0
        node = 1 << (self.height - 1)
        step = node >> 1
        while True:
            visited += 1
            if node < self.starts.size - 1:
                a, b = self.starts[node], self.starts[node + 1]
                if rank < node:
                    ids, end = self.ascending, a + np.searchsorted(self.low[a:b], rank)
                else:
                    ids = self.descending
                    end = a + np.searchsorted(self.high[a:b], -rank, "right")
                found.append(ids[a:end])
                if trace is not None:
                    trace.reported(ids[a:end])
                    trace.tested(ids[end : min(end + 1, b)])
                visited += int(end - a) + int(end < b)
            if rank == node or step == 0:
                return found, visited
            node += step if rank > node else -step
            step >>= 1

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""
        lists = (self.starts, self.ascending, self.low, self.descending, self.high)
        return sum(a.nbytes for a in lists)
