"""Least and greatest value of nodes of 4³, 8³ and 16³ samples: where a surface may be at all."""

from __future__ import annotations

from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from volviz.fields.statistics import padding_value
from volviz.isosurface.cells import nothing
from volviz.isosurface.kernel import hot, in_slabs, kernel
from volviz.model.volume import Volume
from volviz.progress import Progress

FINEST, BLOCK = 2, 4
"""Levels: nodes of 4³ samples are the finest that are kept, those of 16³ are the blocks."""
SIDE = 1 << BLOCK
WHOLE, MIXED, NONE = 0, 1, 2
"""What a node has of samples that are valid: all, some, none."""


class Ranges(NamedTuple):
    """Of the nodes of levels 2, 3 and 4, arrays [z, y, x]: of the valid samples in the volume's
    own dtype, and WHOLE, MIXED or NONE."""

    low2: NDArray[Any]
    high2: NDArray[Any]
    valid2: NDArray[np.uint8]
    low3: NDArray[Any]
    high3: NDArray[Any]
    valid3: NDArray[np.uint8]
    low4: NDArray[Any]
    high4: NDArray[Any]
    valid4: NDArray[np.uint8]


_known: WeakKeyDictionary[Volume, Ranges] = WeakKeyDictionary()


def ranges_of(volume: Volume, progress: Progress) -> Ranges:
    """The ranges of a volume, in one pass over its samples; kept with it (a sixtieth of it)."""
    if volume not in _known:
        data, padding = volume.data, padding_value(volume)
        blank, padded = data.dtype.type(0) if padding is None else padding, padding is not None
        shape = [-(-n // 4) for n in data.shape]
        low, high = np.empty(shape, data.dtype), np.empty(shape, data.dtype)
        valid = np.empty(shape, np.uint8)
        ends = nothing(data.dtype)

        def measure(a: int, b: int) -> None:
            _measure(data, blank, padded, ends, a, b, low, high, valid)

        in_slabs(measure, shape[0], 4 * data.shape[1] * data.shape[2], progress, "ranges of blocks")
        three = _coarser((low, high, valid))
        _known[volume] = Ranges(low, high, valid, *three, *_coarser(three))
    return _known[volume]


def _coarser(of: tuple[Any, Any, Any]) -> tuple[Any, Any, Any]:
    low, high, valid = of
    for axis in range(3):
        starts = np.arange(0, low.shape[axis], 2)
        low = np.minimum.reduceat(low, starts, axis=axis)
        high = np.maximum.reduceat(high, starts, axis=axis)
        least = np.minimum.reduceat(valid, starts, axis=axis)
        most = np.maximum.reduceat(valid, starts, axis=axis)
        valid = np.where(least == most, least, MIXED).astype(np.uint8)
    return low, high, valid


@kernel
def _measure(
    data: Any, blank: Any, padded: bool, ends: Any, first: int, last: int,
    low: Any, high: Any, valid: Any,
) -> None:  # fmt: skip
    """Of the nodes of layers first..last."""
    nz, ny, nx = data.shape
    for k in range(first, last):
        for j in range(low.shape[1]):
            for i in range(low.shape[2]):
                a, b = ends
                good = bad = 0
                for z in range(4 * k, min(4 * k + 4, nz)):
                    for y in range(4 * j, min(4 * j + 4, ny)):
                        for x in range(4 * i, min(4 * i + 4, nx)):
                            value = data[z, y, x]
                            if (value - value) == 0 and not (padded and value == blank):
                                a, b = min(a, value), max(b, value)
                                good += 1
                            else:
                                bad += 1
                low[k, j, i], high[k, j, i] = a, b
                valid[k, j, i] = WHOLE if bad == 0 else NONE if good == 0 else MIXED


@hot
def near(low: Any, high: Any, limit: Any, k: int, j: int, i: int) -> bool:
    """True if the surface may be in a node or in one of the 26 around it."""
    some = every = False
    for c in range(max(k - 1, 0), min(k + 2, low.shape[0])):
        for b in range(max(j - 1, 0), min(j + 2, low.shape[1])):
            for a in range(max(i - 1, 0), min(i + 2, low.shape[2])):
                if low[c, b, a] <= high[c, b, a]:
                    some = some or high[c, b, a] >= limit
                    every = every or low[c, b, a] < limit
    return some and every


@hot
def holes(valid: Any, k: int, j: int, i: int) -> bool:
    """True if a node has valid samples and some in it or in the 26 around it are not valid."""
    if valid[k, j, i] == NONE:
        return False
    for c in range(max(k - 1, 0), min(k + 2, valid.shape[0])):
        for b in range(max(j - 1, 0), min(j + 2, valid.shape[1])):
            for a in range(max(i - 1, 0), min(i + 2, valid.shape[2])):
                if valid[c, b, a] != WHOLE:
                    return True
    return False


@kernel
def near_blocks(ranges: Any, limit: Any, out: Any) -> None:
    """bool[z, y, x]: the blocks in or next to which the surface may be."""
    for k in range(out.shape[0]):
        for j in range(out.shape[1]):
            for i in range(out.shape[2]):
                out[k, j, i] = near(ranges.low4, ranges.high4, limit, k, j, i)
