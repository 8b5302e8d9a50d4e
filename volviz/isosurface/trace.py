"""Who follows a search: what it tests, what it takes without a test, which nodes it opens."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Ids = NDArray[Any]
Corners = tuple[NDArray[Any], NDArray[Any]]
"""int[n, 3] each: the cells (x, y, z) that nodes begin with, and those they end before."""


class Trace:
    """Told by a finder what it does; this one listens to nothing."""

    def tested(self, ids: Ids) -> None:
        """Cells of which an end (or a sample) was compared with the isovalue."""

    def reported(self, ids: Ids) -> None:
        """Active cells that were taken without a test of their own."""

    def level(self, side: int, looked_at: int, active: Corners, idle: Corners | None) -> None:
        """Nodes of one level of a tree over a volume, which cover about side³ cells.

        looked_at: how many were tested; active: those that the isovalue is in; idle: the others,
        None where they are not listed.
        """


def corners(starts: tuple[NDArray[np.int64], ...], at: tuple[NDArray[Any], ...]) -> Corners:
    """Nodes by their place in a lattice. starts: along z, y, x, each with the end; at: likewise."""
    low = np.stack([s[a] for s, a in zip(starts, at, strict=True)][::-1], axis=-1)
    high = np.stack([s[a + 1] for s, a in zip(starts, at, strict=True)][::-1], axis=-1)
    return low, high
