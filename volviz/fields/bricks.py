"""Minimum and maximum per brick of samples, which bricks a transfer function shows, and how far
the empty ones reach: what a ray needs to leap over what it would not see.

A brick covers the samples j·b … (j+1)·b inclusive: the samples it shares with the next brick are
in both, so that trilinear interpolation inside it never leaves its range and leaping is exact.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.model.frame import ColorTable, Emptiness, Voxels
from volviz.progress import Progress, silent

SIDE = 4
MOST_BRICKS = 1 << 21
"""Larger grids get larger bricks, so that dragging a control point stays quick."""
FAR = 31
MOST_RUNS = 16


@dataclass(frozen=True, eq=False)
class Bricks:
    """low, high: [bz, by, bx], range of the texels in a brick; low > high where none is valid."""

    low: NDArray[Any]
    high: NDArray[Any]
    side: int = SIDE


def side_for(dims: tuple[int, int, int]) -> int:
    """Samples along a brick for a grid of so many samples along x, y, z."""
    side = SIDE
    while math.prod(-(-n // side) for n in dims) > MOST_BRICKS:
        side *= 2
    return side


def bricks(voxels: Voxels, side: int | None = None, progress: Progress | None = None) -> Bricks:
    """Range of every brick, in the units of the texture's array. side: default `side_for`."""
    report = progress or silent()
    side = side or side_for(voxels.dims)
    array = voxels.array
    count = len(array)
    shape = tuple(-(-n // side) for n in array.shape[:3])
    low, high = np.empty(shape, array.dtype), np.empty(shape, array.dtype)
    for j in range(shape[0]):
        report(j / shape[0], "looking for empty space")
        slab = array[j * side : min((j + 1) * side + 1, count)]
        low[j], high[j] = _slab_range(slab, voxels.masked, side)
    return Bricks(low, high, side)


def occupied(found: Bricks, voxels: Voxels, table: ColorTable) -> NDArray[np.bool_]:
    """bool[bz, by, bx]: bricks in which some value may have an opacity above zero.

    The opaque entries of the table are runs; a brick shows one if their ranges meet, an entry more
    on either side, because the shader rounds to the nearest.
    """
    runs = _runs(table.entries[:, 3] > 0)
    if len(runs) > MOST_RUNS:
        return _occupied_by_count(found, voxels, table)
    scale, shift = _to_entry(found, voxels, table)
    last = len(table.entries) - 1
    shown = np.zeros(found.low.shape, np.bool_)
    for first, end in runs:
        # brick's low below the run's end, and its high above the run's beginning
        below, below_all = _texel((end + 2 - shift), scale, found.low.dtype, up=True)
        above, above_all = _texel((first - 2 - shift), scale, found.low.dtype, up=False)
        part = np.ones_like(shown) if end == last or below_all else found.low <= below
        if first > 0 and not above_all:
            part &= found.high >= above
        shown |= part
    shown &= found.low <= found.high
    return shown


def _runs(opaque: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """First and last entry of every run."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], opaque.astype(np.int8), [0]])))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def _to_entry(found: Bricks, voxels: Voxels, table: ColorTable) -> tuple[float, float]:
    """entry = texel · scale + shift."""
    kind = found.low.dtype
    whole = 1.0 if kind.kind == "f" else 1.0 / np.iinfo(kind).max
    shift = (voxels.offset - table.low) * table.per_value
    return voxels.scale * whole * table.per_value, shift


def _texel(entry: float, scale: float, dtype: np.dtype[Any], *, up: bool) -> tuple[Any, bool]:
    """The texel of an entry, rounded outwards; True where every texel has the same entry."""
    if scale <= 0:
        return dtype.type(0), True
    value = entry / scale
    if dtype.kind == "f":
        single = dtype.type(np.clip(value, np.finfo(dtype).min, np.finfo(dtype).max))
        return np.nextafter(single, dtype.type(np.inf if up else -np.inf)), False
    most = np.iinfo(dtype).max
    whole = math.floor(value) + 1 if up else math.ceil(value) - 1
    return min(max(whole, -1), most + 1), False


def _occupied_by_count(found: Bricks, voxels: Voxels, table: ColorTable) -> NDArray[np.bool_]:
    """The same for many runs: one subtraction per brick in the running count of opaque entries."""
    last = len(table.entries) - 1
    scale, shift = _to_entry(found, voxels, table)
    opaque = np.concatenate([[0], np.cumsum(table.entries[:, 3] > 0)]).astype(np.int32)

    def before(texels: NDArray[Any]) -> NDArray[np.int32]:
        first = np.clip(np.floor(texels * scale + shift) - 1, 0, last).astype(np.int64)
        return opaque[first]

    def after(texels: NDArray[Any]) -> NDArray[np.int32]:
        end = np.clip(np.ceil(texels * scale + shift) + 1, 0, last).astype(np.int64)
        return opaque[end + 1]

    if found.low.dtype.kind == "f":
        low, high = before(found.low), after(found.high)
    else:  # once per value instead of once per brick
        every = np.arange(np.iinfo(found.low.dtype).max + 1)
        low, high = before(every)[found.low], after(every)[found.high]
    shown: NDArray[np.bool_] = (high > low) & (found.low <= found.high)
    return shown


def chessboard_distance(shown: NDArray[np.bool_], far: int = FAR) -> NDArray[np.uint8]:
    """uint8, same shape: bricks to the nearest shown one, diagonals counting 1, at most `far`.

    The shown bricks, as bits, grow by one brick in all directions at a time; the bits of the
    distance are set where they arrive. 64 bricks per operation: some ms for 128³.
    """
    if not shown.any():
        return np.full(shown.shape, far, np.uint8)
    nz, ny, nx = shown.shape
    padded = np.zeros((nz, ny, -(-nx // 64) * 64), np.bool_)
    padded[..., :nx] = shown
    grown = np.packbits(padded, axis=-1, bitorder="little").view("<u8")
    planes = [np.zeros_like(grown) for _ in range(far.bit_length())]
    for distance in range(1, far + 1):
        before, grown = grown, _grown(grown)
        arrived = grown & ~before if distance < far else ~before
        if not arrived.any():
            break
        for bit, plane in enumerate(planes):
            if distance >> bit & 1:
                plane |= arrived
    found = np.zeros(shown.shape, np.uint8)
    for bit, plane in enumerate(planes):
        if plane.any():
            bits = np.unpackbits(plane.view(np.uint8), axis=-1, count=nx, bitorder="little")
            found |= bits << np.uint8(bit)
    return found


def _grown(cells: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The set bits and their 26 neighbours; bits lie along the last axis."""
    out = cells | cells << np.uint64(1) | cells >> np.uint64(1)
    out[..., 1:] |= cells[..., :-1] >> np.uint64(63)
    out[..., :-1] |= cells[..., 1:] << np.uint64(63)
    for axis in (0, 1):
        known = out.copy()
        near, ahead = _slice(axis, 3, slice(None, -1)), _slice(axis, 3, slice(1, None))
        out[near] |= known[ahead]
        out[ahead] |= known[near]
    return out


def emptiness(found: Bricks, voxels: Voxels, table: ColorTable) -> Emptiness:
    """How far a ray may leap from each brick under this transfer function."""
    shown = occupied(found, voxels, table)
    return Emptiness(chessboard_distance(shown), found.side, float(shown.mean()))


def _slab_range(slab: NDArray[Any], masked: bool, side: int) -> tuple[NDArray[Any], NDArray[Any]]:
    """[by, bx] least and largest texels of a layer of bricks, from [z, y, x(, 2)]."""
    if not masked:
        return (
            _reduced(slab.min(axis=0), np.minimum, side),
            _reduced(slab.max(axis=0), np.maximum, side),
        )
    value, valid = slab[..., 0], slab[..., 1] > 0
    least, most = _ends(slab.dtype)
    low = np.where(valid, value, most).min(axis=0)
    high = np.where(valid, value, least).max(axis=0)
    return _reduced(low, np.minimum, side), _reduced(high, np.maximum, side)


def _reduced(array: NDArray[Any], best: np.ufunc, side: int) -> NDArray[Any]:
    """[by, bx] of [y, x]: the best of a brick and of the samples it shares with the next."""
    for axis in range(2):
        starts = np.arange(0, array.shape[axis], side)
        parts = best.reduceat(array, starts, axis=axis)
        if len(starts) > 1:
            inner = _slice(axis, 2, slice(None, -1))
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
