"""A volume with fewer samples, for textures and memory that cannot hold all of them.

Block means (labels: the block's middle sample), a factor per axis. The affine stays exact: a new
sample stands at the centre of its block. Voxels that don't count are left out of the means.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError
from volviz.fields.statistics import padding_value, valid_slab
from volviz.model.volume import Dims, Volume
from volviz.progress import Progress, silent

Factors = tuple[int, int, int]


def reduction(dims: Dims, nbytes_per_voxel: int, max_dim: int, max_bytes: int) -> Factors:
    """Integer factors (x, y, z) by which a volume has to shrink.

    First every axis longer than `max_dim` samples; then, until the bytes fit, the axis with the
    most samples left (of equals, x before y before z). (1, 1, 1) if all fits.
    """
    factors = [math.ceil(n / max(max_dim, 1)) for n in dims]
    while True:
        left = [math.ceil(n / f) for n, f in zip(dims, factors, strict=True)]
        if math.prod(left) * nbytes_per_voxel <= max_bytes or max(left) == 1:
            return factors[0], factors[1], factors[2]
        axis = left.index(max(left))
        # the next factor that takes samples away: 5 → 4 of 16 leaves 4 both times
        while math.ceil(dims[axis] / factors[axis]) == left[axis]:
            factors[axis] += 1


def reduced(volume: Volume, factors: Factors, progress: Progress | None = None) -> Volume:
    """The volume with block means over `factors` (x, y, z) samples, same dtype, ints rounded.

    The last block of an axis takes what is left there. Labels get the middle sample of each
    block. Blocks without a voxel that counts become padding or NaN. `info` gets a warning.
    """
    if min(factors) < 1:
        raise UsageError(f"factors must be at least 1, not {factors}", field="factors")
    if factors == (1, 1, 1):
        return volume
    report = progress or silent()
    shape = tuple(math.ceil(n / f) for n, f in zip(volume.dims, factors, strict=True))[::-1]
    data = np.empty(shape, dtype=volume.data.dtype)
    step = factors[2]
    for z in range(shape[0]):
        report(z / shape[0], "reducing resolution")
        slab = volume.data[z * step : (z + 1) * step]
        if volume.info.kind == "labels":
            data[z] = _middles(slab, factors)
        else:
            data[z] = _means(slab, factors, padding_value(volume))
    info = replace(volume.info, affine=_affine(volume.affine, factors))
    return Volume(data, info.warn(_sentence(volume.dims, shape[::-1], factors)))


def _affine(affine: NDArray[np.float64], factors: Factors) -> NDArray[np.float64]:
    blocks = np.eye(4)
    blocks[:3, :3] = np.diag(factors)
    blocks[:3, 3] = (np.array(factors) - 1) / 2
    return affine @ blocks


def _middles(slab: NDArray[Any], factors: Factors) -> NDArray[Any]:
    y, x = (_middle_indices(n, f) for n, f in zip(slab.shape[1:], factors[1::-1], strict=True))
    return slab[(len(slab) - 1) // 2][np.ix_(y, x)]


def _middle_indices(count: int, factor: int) -> NDArray[np.int64]:
    starts = np.arange(0, count, factor)
    ends = np.minimum(starts + factor, count)
    return (starts + ends - 1) // 2


def _means(slab: NDArray[Any], factors: Factors, padding: Any) -> NDArray[Any]:
    """[y, x] means of a slab that is one block high."""
    valid = valid_slab(slab, padding)
    if not valid.any():
        return _filled(slab, factors, padding)
    counts = _sums(valid.astype(np.int64), factors)
    share = np.maximum(counts, 1)
    if slab.dtype.kind == "f":
        # divided before the sum, which might overflow
        size = math.prod(factors)
        total = _sums(np.where(valid, slab, 0).astype(np.float64) / size, factors)
        means = (total * (size / share)).astype(slab.dtype)
    else:
        means = _whole_means(slab, valid, factors, share)
    empty = counts == 0
    if empty.any():
        means[empty] = np.nan if padding is None else padding
    return means


def _whole_means(
    slab: NDArray[Any], valid: NDArray[np.bool_], factors: Factors, share: NDArray[np.int64]
) -> NDArray[Any]:
    """Rounded means of integers; differences to the least, modulo 2^64, are exact for any size."""
    base = np.uint64(int(slab[valid].min()) % (1 << 64))
    wide = slab.astype(np.int64 if slab.dtype.kind == "i" else np.uint64).view(np.uint64)
    above: NDArray[Any] = np.where(valid, wide - base, 0)
    if int(above.max()) * math.prod(factors) >= 1 << 63:
        above = np.minimum(above.astype(np.float64), np.nextafter(2.0**64, 0))
    means = np.rint(_sums(above, factors) / share).astype(np.uint64)
    return (means + base).astype(slab.dtype)


def _sums(values: NDArray[Any], factors: Factors) -> NDArray[Any]:
    """[y, x] sums over blocks of a slab; the last blocks may be partial."""
    flat = values.sum(axis=0)
    for axis, factor in ((0, factors[1]), (1, factors[0])):
        if factor > 1:
            flat = np.add.reduceat(flat, np.arange(0, flat.shape[axis], factor), axis=axis)
    return flat


def _filled(slab: NDArray[Any], factors: Factors, padding: Any) -> NDArray[Any]:
    shape = [math.ceil(n / f) for n, f in zip(slab.shape[1:], factors[1::-1], strict=True)]
    return np.full(shape, np.nan if padding is None else padding, dtype=slab.dtype)


def _sentence(before: Dims, after: tuple[int, ...], factors: Factors) -> str:
    parts = " × ".join("1" if f == 1 else f"1/{f}" for f in factors)
    counts = [" × ".join(str(n) for n in dims) for dims in (after, before)]
    return f"shown at {parts} resolution ({counts[0]} of {counts[1]} samples)"
