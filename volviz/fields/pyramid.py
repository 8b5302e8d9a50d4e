"""A pyramid of ever coarser volumes: each sample is the mean of 2 × 2 × 2 of the level below.

A coarser sample stands in the middle of its eight, so that the place of nothing moves. Where an
axis has an odd number of samples, the one that is missing at its end is continued linearly: a
linear field stays the same field on every level. Samples that are not valid do not count; eight
of them make one. Levels are floats, for a mean of whole numbers is none. An axis of two samples
or one is not halved any more.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from volviz.fields.statistics import padding_value, valid_slab
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

Floats = NDArray[np.float64]
_known: WeakKeyDictionary[Volume, list[Volume]] = WeakKeyDictionary()


def level_of(volume: Volume, level: int, progress: Progress | None = None) -> Volume:
    """The volume, halved `level` times or as often as it can be; kept for as long as it lives.

    float32[z, y, x] (float64 of wider numbers); not valid is NaN. All levels together take a
    seventh of the volume's samples. Raises Cancelled.
    """
    report = progress or silent()
    made = _known.setdefault(volume, [])
    while len(made) < level:
        last = made[-1] if made else volume
        if max(last.dims) < 3:
            break
        part = len(made) / level
        made.append(halved(last, report.part(part, part + 1 / level)))
    return volume if level == 0 or not made else made[min(level, len(made)) - 1]


def depth(volume: Volume) -> int:
    """How often the volume can be halved until no axis has more than two samples."""
    return max(0, int(np.ceil(np.log2(max(volume.dims)))) - 1)


def halved(volume: Volume, progress: Progress | None = None) -> Volume:
    """The next coarser level."""
    report = progress or silent()
    data, padding = volume.data, padding_value(volume)
    steps = tuple(2 if n > 2 else 1 for n in data.shape)
    shape = tuple(-(-n // s) for n, s in zip(data.shape, steps, strict=True))
    wide = data.dtype.itemsize > (4 if data.dtype.kind == "f" else 2)
    out = np.empty(shape, np.float64 if wide else np.float32)
    for z in range(shape[0]):
        report(z / shape[0], "a coarser level")
        out[z] = _means(_slices(data, padding, z, steps[0]), steps)
    place = np.eye(4)
    place[:3, :3] = np.diag(steps[::-1])
    place[:3, 3] = (np.array(steps[::-1]) - 1) / 2
    info = replace(volume.info, affine=volume.affine @ place, padding=None, kind="scalar")
    return Volume(out, info)


def _slices(data: NDArray[Any], padding: Any, z: int, step: int) -> Floats:
    """float64[step, y, x]: the slices of a coarser one; the last may have to be continued."""
    found = [_floats(data[i], padding) for i in range(z * step, min(z * step + step, len(data)))]
    if len(found) < step:
        found.append(_continued(_floats(data[-2], padding), found[0]))
    return np.stack(found)


def _floats(slab: NDArray[Any], padding: Any) -> Floats:
    valid = valid_slab(slab, padding)
    return slab.astype(np.float64) if valid.all() else np.where(valid, slab, np.nan)


def _continued(before: Floats, last: Floats) -> Floats:
    """What comes after two samples in a row; the last one again where the one before is not
    valid."""
    return np.where(np.isnan(before), last, last + (last - before))


def _means(slab: Floats, steps: tuple[int, ...]) -> Floats:
    """float64[y, x] of float64[1 or 2, y, x]: over the samples that are valid."""
    for axis in (1, 2):
        if steps[axis] == 2 and slab.shape[axis] % 2:
            before, last = (np.take(slab, [i], axis=axis) for i in (-2, -1))
            slab = np.concatenate([slab, _continued(before, last)], axis=axis)
    blocks = slab.reshape(
        len(slab), slab.shape[1] // steps[1], steps[1], slab.shape[2] // steps[2], steps[2]
    )
    size = float(steps[0] * steps[1] * steps[2])
    blocks = blocks / size  # before the sum, which might overflow
    total = blocks.sum(axis=(0, 2, 4))
    holes = np.isnan(total)
    if holes.any():
        counts = np.isfinite(blocks).sum(axis=(0, 2, 4))
        rest = np.nansum(blocks, axis=(0, 2, 4)) * (size / np.maximum(counts, 1))
        total[holes] = np.where(counts > 0, rest, np.nan)[holes]
    return total
