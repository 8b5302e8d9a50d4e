"""Minimum and maximum per brick of samples, which bricks a transfer function shows, and how far
the empty ones reach: what a ray needs to leap over what it would not see.

A brick covers the samples j·b … (j+1)·b inclusive: the samples it shares with the next brick are
in both, so that trilinear interpolation inside it never leaves its range and leaping is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.model.frame import ColorTable, Emptiness, Voxels

SIDE = 4
FAR = 31


@dataclass(frozen=True, eq=False)
class Bricks:
    """low, high: [bz, by, bx], range of the texels in a brick; low > high where none is valid."""

    low: NDArray[Any]
    high: NDArray[Any]
    side: int = SIDE


def bricks(voxels: Voxels, side: int = SIDE) -> Bricks:
    """Range of every brick, in the units of the texture's array."""
    array = voxels.array
    if not voxels.masked:
        return Bricks(_reduced(array, np.minimum, side), _reduced(array, np.maximum, side), side)
    value, valid = array[..., 0], array[..., 1] > 0
    least, most = _ends(array.dtype)
    low = _reduced(np.where(valid, value, most), np.minimum, side)
    high = _reduced(np.where(valid, value, least), np.maximum, side)
    return Bricks(low, high, side)


def occupied(found: Bricks, voxels: Voxels, table: ColorTable) -> NDArray[np.bool_]:
    """bool[bz, by, bx]: bricks in which some value may have an opacity above zero.

    One subtraction per brick in the running count of opaque table entries; an entry more on
    either side, because the shader rounds to the nearest.
    """
    last = len(table.entries) - 1
    per_value = table.per_value
    whole = 1.0 if found.low.dtype.kind == "f" else 1.0 / np.iinfo(found.low.dtype).max
    scale = voxels.scale * whole * per_value
    shift = (voxels.offset - table.low) * per_value
    first = np.clip(np.floor(found.low * scale + shift) - 1, 0, last).astype(np.int64)
    end = np.clip(np.ceil(found.high * scale + shift) + 1, 0, last).astype(np.int64)
    opaque = np.concatenate([[0], np.cumsum(table.entries[:, 3] > 0)])
    shown: NDArray[np.bool_] = (opaque[end + 1] > opaque[first]) & (found.low <= found.high)
    return shown


def chessboard_distance(shown: NDArray[np.bool_], far: int = FAR) -> NDArray[np.uint8]:
    """uint8, same shape: bricks to the nearest shown one, diagonals counting 1, at most `far`.

    Separable, exact up to `far`: D(x, y) = min over y' of max(|y − y'|, D(x, y')), axis by axis.
    """
    distance = np.where(shown, 0, far).astype(np.uint8)
    for axis in range(distance.ndim):
        before = distance.copy()
        for n in range(1, min(far, distance.shape[axis])):
            reach = np.maximum(before, np.uint8(n))
            near = _slice(axis, distance.ndim, slice(None, -n))
            ahead = _slice(axis, distance.ndim, slice(n, None))
            np.minimum(distance[near], reach[ahead], out=distance[near])
            np.minimum(distance[ahead], reach[near], out=distance[ahead])
    return distance


def emptiness(found: Bricks, voxels: Voxels, table: ColorTable) -> Emptiness:
    """How far a ray may leap from each brick under this transfer function."""
    shown = occupied(found, voxels, table)
    return Emptiness(chessboard_distance(shown), found.side, float(shown.mean()))


def _reduced(array: NDArray[Any], best: np.ufunc, side: int) -> NDArray[Any]:
    for axis in range(3):
        starts = np.arange(0, array.shape[axis], side)
        parts = best.reduceat(array, starts, axis=axis)
        if len(starts) > 1:
            inner = _slice(axis, 3, slice(None, -1))
            shared = np.take(array, starts[1:], axis=axis)
            parts[inner] = best(parts[inner], shared)
        array = parts
    return array


def _slice(axis: int, dims: int, part: slice) -> tuple[slice, ...]:
    return tuple(part if i == axis else slice(None) for i in range(dims))


def _ends(dtype: np.dtype[Any]) -> tuple[Any, Any]:
    if dtype.kind == "f":
        return dtype.type(-np.inf), dtype.type(np.inf)
    return dtype.type(np.iinfo(dtype).min), dtype.type(np.iinfo(dtype).max)
