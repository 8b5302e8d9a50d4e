"""Voxels as the texture gets them, every value kept as exactly as the texture can hold it.

8- and 16-bit integers, and wider ones whose range fits, become 16-bit unsigned; all else becomes
float32 of the difference to an offset. Where voxels don't count (NaN, ±Inf, padding) a second
channel holds validity, so that r/g interpolates over the neighbours that do.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.fields.statistics import Statistics, padding_value, valid_slab
from volviz.model.frame import Voxels
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

MANTISSA = 24  # bits of a float32
COMFORT = (1e-18, 1e18)
"""Within these, 65536 entries of a table over a millionth of the values are still a float32."""

Convert = Callable[[NDArray[Any]], NDArray[Any]]


def encode(
    volume: Volume,
    statistics: Statistics,
    *,
    promote8: bool = True,
    progress: Progress | None = None,
) -> Voxels:
    """The texture of a volume. value = texel·scale + offset (`Voxels`).

    promote8: 8-bit data as 16-bit v·257, since software rasterisers interpolate 8-bit textures
    with 8 bits; twice the memory. uint16 and, with offset 0, float32 data are not copied.
    `offset` and `scale` are float64: apply them together with the table's range in float64, else
    float32 loses again what the offset saved. `note` says where values could not be kept apart.
    """
    report = progress or silent()
    data = volume.data
    if data.dtype.kind in "iu" and data.dtype.itemsize == 1:
        dtype, scale, offset, convert = _bytes(data.dtype, promote8)
        note = None
    elif data.dtype.kind in "iu" and data.dtype.itemsize == 2:
        dtype, scale, offset, convert = _shorts(data.dtype)
        note = None
    elif data.dtype.kind in "iu" and statistics.high - statistics.low < 65536:
        dtype, scale, offset, convert = _narrow(volume, statistics)
        note = None
        if max(abs(statistics.low), abs(statistics.high)) > 2**53:
            note = "values beyond 2^53 differ by too little to be classified apart"
    else:
        dtype, scale, offset, convert = _float(data.dtype, statistics)
        note = _lost(data.dtype, statistics, offset)
    if statistics.invalid_count:
        array = _masked(volume, dtype, convert, report)
    elif dtype == data.dtype and offset == 0 and (dtype.kind == "u" or scale == 1.0):
        array = data
    else:
        array = np.empty(data.shape, dtype=dtype)
        for z in range(len(data)):
            report(z / len(data), "preparing voxels")
            array[z] = convert(data[z])
    array.setflags(write=False)
    return Voxels(array, scale, offset, note)


def texel_bytes(dtype: np.dtype[Any], statistics: Statistics, *, promote8: bool = True) -> int:
    """Bytes that one voxel takes in the texture of `encode`."""
    size = min(dtype.itemsize, 4)
    if dtype.kind in "iu" and size > 2 and statistics.high - statistics.low < 65536:
        size = 2
    if size == 1 and promote8:
        size = 2
    return size * (2 if statistics.invalid_count else 1)


def _bytes(dtype: np.dtype[Any], promote: bool) -> tuple[Any, float, float, Convert]:
    flip = np.uint8(0x80 if dtype.kind == "i" else 0)
    offset = -128.0 if dtype.kind == "i" else 0.0
    if promote:
        return (
            np.dtype(np.uint16),
            255.0,
            offset,
            lambda v: (v.view(np.uint8) ^ flip).astype(np.uint16) * np.uint16(257),
        )
    return np.dtype(np.uint8), 255.0, offset, lambda v: v.view(np.uint8) ^ flip


def _shorts(dtype: np.dtype[Any]) -> tuple[Any, float, float, Convert]:
    if dtype.kind == "u":
        return dtype, 65535.0, 0.0, lambda v: v
    return (
        np.dtype(np.uint16),
        65535.0,
        -32768.0,
        lambda v: v.view(np.uint16) ^ np.uint16(0x8000),
    )


def _narrow(volume: Volume, stats: Statistics) -> tuple[Any, float, float, Convert]:
    """Wide integers in a range of 65536: the difference to the least, exact beyond 2^53 too."""
    low = _exact_low(volume, stats)
    unsigned = np.dtype(f"u{volume.data.dtype.itemsize}").type
    base = unsigned(low % (1 << 8 * volume.data.dtype.itemsize))
    return (
        np.dtype(np.uint16),
        65535.0,
        float(low),
        lambda v: (v.view(unsigned) - base).astype(np.uint16),
    )


def _exact_low(volume: Volume, stats: Statistics) -> int:
    if abs(stats.low) < 2**53:
        return int(stats.low)
    padding = padding_value(volume)
    kept = volume.data if padding is None else volume.data[volume.data != padding]
    return int(kept.min())


def _float(dtype: np.dtype[Any], stats: Statistics) -> tuple[Any, float, float, Convert]:
    """float32 of (v − offset)/scale; scale is 1 unless the numbers are out of float32's comfort."""
    span = stats.high - stats.low
    size = max(abs(stats.low), abs(stats.high))
    offset = stats.low if size > 16 * span else 0.0
    reach = span if offset else size
    scale = 1.0
    if reach and not COMFORT[0] < reach < COMFORT[1]:
        scale = reach if math.isfinite(reach) else float(np.finfo(np.float64).max)
    if dtype == np.float32 and offset == 0 and scale == 1.0:
        return dtype, 1.0, 0.0, lambda v: v

    def convert(values: NDArray[Any]) -> NDArray[Any]:
        with np.errstate(over="ignore", invalid="ignore"):
            return ((values.astype(np.float64) - offset) / scale).astype(np.float32)

    return np.dtype(np.float32), scale, offset, convert


def _lost(dtype: np.dtype[Any], stats: Statistics, offset: float) -> str | None:
    """What to say where neighbouring values fall together in float32."""
    reach = stats.high - stats.low if offset else max(abs(stats.low), abs(stats.high))
    if dtype.kind != "f" and reach > 2**MANTISSA:
        step = 2.0 ** (math.ceil(math.log2(reach)) - MANTISSA)
        return f"integers span {reach:.3g}: as float32, values less than {step:g} apart look alike"
    if dtype == np.float64 and reach > 0:
        ulp = float(np.spacing(max(abs(stats.low), abs(stats.high))))
        if stats.high - stats.low < 256 * ulp:
            return "the values differ by little more than their own rounding"
    return None


def _masked(
    volume: Volume, dtype: np.dtype[Any], convert: Convert, report: Progress
) -> NDArray[Any]:
    data, padding = volume.data, padding_value(volume)
    one = 1 if dtype.kind == "f" else np.iinfo(dtype).max
    array = np.zeros((*data.shape, 2), dtype=dtype)
    for z in range(len(data)):
        report(z / len(data), "preparing voxels")
        valid = valid_slab(data[z], padding)
        kept = np.where(valid, data[z], 0) if data.dtype.kind == "f" else data[z]
        array[z, ..., 0] = np.where(valid, convert(kept), 0)
        array[z, ..., 1] = valid * dtype.type(one)
    return array
