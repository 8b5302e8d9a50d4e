"""What the values of a volume are like: range, moments, histogram, and what does not count.

NaN, ±Inf and padding voxels are counted and left out of everything else. One bin per integer
value where the range allows, 65536 even bins otherwise. Memory beyond the volume: one slab.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.model.volume import Volume
from volviz.progress import Progress, silent

BINS = 65536
_SLAB = 1 << 17  # samples at a time: their 64-bit copies stay in the processor's cache

Fine = tuple[NDArray[np.int64], float, float, int]


@dataclass(frozen=True, eq=False)
class Statistics:
    """Facts about the voxels that count.

    low, high: least and greatest finite value that is not padding (0 and 0 if there is none).
    count: voxels that count. histogram: int64[bins], bin i covers `first` + `width`·[i, i + 1);
    for integers `first` is half a unit below `low`, so that a bin's middle is a value (or the
    middle of equally many neighbouring values). fine: (histogram, first, width, voxels below it)
    of the middle 99.9 %, where a few outliers squeeze the rest into few bins.
    """

    low: float
    high: float
    count: int
    nan_count: int
    inf_count: int
    padding_count: int
    mean: float
    std: float
    histogram: NDArray[np.int64]
    first: float
    width: float
    integers: bool
    fine: Fine | None = None

    @property
    def constant(self) -> bool:
        """True if all voxels that count are equal, or none counts."""
        return self.low == self.high

    @property
    def invalid_count(self) -> int:
        """NaN, ±Inf and padding voxels together."""
        return self.nan_count + self.inf_count + self.padding_count

    @property
    def edges(self) -> NDArray[np.float64]:
        """float64[bins + 1]: borders of the bins."""
        return self.first + self.width * np.arange(self.histogram.size + 1, dtype=np.float64)

    @property
    def centers(self) -> NDArray[np.float64]:
        """float64[bins]: middles of the bins."""
        return self.first + self.width * np.arange(0.5, self.histogram.size, dtype=np.float64)

    def percentile(self, p: float) -> float:
        """The value that p percent of the voxels do not exceed, exact to a bin, in low..high."""
        if self.count == 0 or self.constant:
            return self.low
        if p <= 0:
            return self.low
        if p >= 100:
            return self.high
        counts, first, width, below = self.histogram, self.first, self.width, 0
        if self.fine is not None and 0.1 <= p <= 99.9:
            counts, first, width, below = self.fine
        rank = p / 100 * self.count - below
        total = np.cumsum(counts)
        index = min(int(np.searchsorted(total, rank)), counts.size - 1)
        inside = 0.5
        if not self.integers and counts[index]:
            inside = (rank - (total[index] - counts[index])) / counts[index]
        value = first + width * (index + min(max(float(inside), 0.0), 1.0))
        return float(min(max(value, self.low), self.high))


def statistics(volume: Volume, progress: Progress | None = None) -> Statistics:
    """Range, counts, moments and histogram of a volume, in one pass (≤ 16-bit) or two."""
    report = progress or silent()
    kind, size = volume.data.dtype.kind, volume.data.dtype.itemsize
    padding = padding_value(volume)
    if kind in "iu" and size <= 2:
        return _small_integers(volume.data, padding, report)
    if kind in "iu":
        return _wide_integers(volume.data, padding, report)
    return _floats(volume.data, padding, report)


def valid_mask(volume: Volume, statistics: Statistics | None = None) -> NDArray[np.bool_] | None:
    """bool[z, y, x]: voxels that are finite and no padding; None if every voxel is."""
    if statistics is not None and statistics.invalid_count == 0:
        return None
    padding = padding_value(volume)
    if volume.data.dtype.kind != "f" and padding is None:
        return None
    mask = np.empty(volume.info.shape, dtype=bool)
    for z in range(len(mask)):
        mask[z] = valid_slab(volume.data[z], padding)
    return None if mask.all() else mask


def valid_slab(slab: NDArray[Any], padding: Any) -> NDArray[np.bool_]:
    """bool, the shape of `slab`: finite and not equal to `padding` (None: there is none)."""
    valid = np.isfinite(slab) if slab.dtype.kind == "f" else np.ones(slab.shape, dtype=bool)
    if padding is not None:
        valid &= slab != padding
    return valid


def padding_value(volume: Volume) -> Any:
    """The padding as a scalar of the volume's dtype; None if no voxel can hold it."""
    padding, dtype = volume.info.padding, volume.data.dtype
    if padding is None or not math.isfinite(padding):
        return None
    if dtype.kind == "f":
        with np.errstate(over="ignore"):
            return dtype.type(padding)
    limits = np.iinfo(dtype)
    fits = padding == round(padding) and limits.min <= padding <= limits.max
    return dtype.type(int(padding)) if fits else None


def _slabs(
    data: NDArray[Any], report: Progress, share: float, start: float
) -> Iterator[NDArray[Any]]:
    flat = data.reshape(-1)
    for at in range(0, flat.size, _SLAB):
        if (at // _SLAB) % 16 == 0:
            report(start + share * at / flat.size, "counting values")
        yield flat[at : at + _SLAB]


def _small_integers(data: NDArray[Any], padding: Any, report: Progress) -> Statistics:
    """8 and 16 bits: every value has a bin; all else follows from the counts."""
    bits = 8 * data.dtype.itemsize
    unsigned = data.view(f"u{data.dtype.itemsize}")
    counts = np.zeros(1 << bits, dtype=np.int64)
    for slab in _slabs(unsigned, report, 1.0, 0.0):
        part = np.bincount(slab)
        counts[: part.size] += part
    lowest = 0
    if data.dtype.kind == "i":
        counts, lowest = np.roll(counts, 1 << (bits - 1)), -(1 << (bits - 1))
    padded = 0
    if padding is not None:
        padded, counts[int(padding) - lowest] = int(counts[int(padding) - lowest]), 0
    found = np.flatnonzero(counts)
    if found.size == 0:
        return _nothing(0, 0, padded, integers=True)
    first, last = int(found[0]), int(found[-1])
    counts = counts[first : last + 1]
    values = np.arange(first + lowest, last + lowest + 1, dtype=np.float64)
    mean, std = _moments(values, counts)
    return Statistics(
        float(values[0]), float(values[-1]), int(counts.sum()), 0, 0, padded, mean, std,
        counts, float(values[0]) - 0.5, 1.0, True,
    )  # fmt: skip


def _wide_integers(data: NDArray[Any], padding: Any, report: Progress) -> Statistics:
    """32 and 64 bits: range first; then exact differences, modulo 2^64, are grouped."""
    low: int | None = None
    high = padded = 0
    for slab in _slabs(data, report, 0.4, 0.0):
        if padding is not None:
            kept = slab[slab != padding]
            padded += slab.size - kept.size
            slab = kept
        if slab.size:
            least, most = int(slab.min()), int(slab.max())
            low, high = (least, most) if low is None else (min(low, least), max(high, most))
    if low is None:
        return _nothing(0, 0, padded, integers=True)
    group = -(-(high - low + 1) // BINS)
    bins = -(-(high - low + 1) // group)
    unsigned = np.dtype(f"u{data.dtype.itemsize}").type
    base = unsigned(low % (1 << 8 * data.dtype.itemsize))
    counts = np.zeros(bins, dtype=np.int64)
    total = squares = 0.0
    for slab in _slabs(data, report, 0.6, 0.4):
        slab = slab if padding is None else slab[slab != padding]
        above = slab.view(unsigned) - base
        if group > 1:
            offset = above.astype(np.float64)
            total, squares = (
                total + float(offset.sum()),
                squares + float(np.einsum("i,i", offset, offset)),
            )
            above = above // unsigned(group)
        counts += np.bincount(above.astype(np.int64), minlength=bins)
    if group == 1:
        mean, std = _moments(low + np.arange(bins, dtype=np.float64), counts)
    else:
        mean, std = _from_sums(total, squares, int(counts.sum()), float(low))
    return Statistics(
        float(low), float(high), int(counts.sum()), 0, 0, padded, mean, std,
        counts, low - 0.5, float(group), True,
    )  # fmt: skip


def _floats(data: NDArray[Any], padding: Any, report: Progress) -> Statistics:
    low, high = math.inf, -math.inf
    nans = infs = padded = 0
    for slab in _slabs(data, report, 0.3, 0.0):
        with np.errstate(invalid="ignore"):
            least, most = float(slab.min()), float(slab.max())
        if padding is not None or not (math.isfinite(least) and math.isfinite(most)):
            nan = np.isnan(slab)
            kept = slab[valid_slab(slab, padding)]
            nans, infs = nans + int(nan.sum()), infs + int(np.isinf(slab).sum())
            padded += 0 if padding is None else int((slab == padding).sum())
            if kept.size == 0:
                continue
            least, most = float(kept.min()), float(kept.max())
        low, high = min(low, least), max(high, most)
    if low > high:
        return _nothing(nans, infs, padded, integers=False)
    if low == high:
        return _constant(data, low, nans, infs, padded)
    strict = bool(nans or infs or padding is not None)
    counts, total, squares = _count_floats(
        data, padding, strict, (low, high), report.part(0.3, 0.8)
    )
    count = int(counts.sum())
    half = _half(low, high)
    span = high * half - low * half
    mean, std = _from_sums(total, squares, count, 0.0)
    width = span / BINS / half
    fine = _fine(data, padding, (counts, low, width, 0), count, report.part(0.8, 1.0))
    return Statistics(
        low, high, count, nans, infs, padded, (low * half + mean * span) / half, std * span / half,
        counts, low, width, False, fine,
    )  # fmt: skip


def _count_floats(
    data: NDArray[Any],
    padding: Any,
    strict: bool,
    ends: tuple[float, float],
    report: Progress,
) -> tuple[NDArray[np.int64], float, float]:
    """Counts in BINS even bins over `ends`, and Σ t, Σ t² of t = (value − low)/(high − low).

    strict: leave out values outside `ends` and those that don't count; there may be some.
    """
    low, high = ends
    half = _half(low, high)
    span = high * half - low * half
    counts = np.zeros(BINS, dtype=np.int64)
    total = squares = 0.0
    for slab in _slabs(data, report, 1.0, 0.0):
        if strict:
            slab = slab[valid_slab(slab, padding)]
            slab = slab[(slab >= low) & (slab <= high)]
        t = slab.astype(np.float64)
        if half != 1:
            t *= half
        t -= low * half
        if span > 1e-290:
            t *= 1 / span
        else:  # the inverse would be infinite
            t /= span
        total, squares = total + float(t.sum()), squares + float(np.einsum("i,i", t, t))
        t *= BINS
        index = t.astype(np.int64)
        np.minimum(index, BINS - 1, out=index)
        counts += np.bincount(index, minlength=BINS)
    return counts, total, squares


def _half(low: float, high: float) -> float:
    """1, or ½ where the range itself would overflow."""
    return 1.0 if math.isfinite(high - low) else 0.5


def _fine(
    data: NDArray[Any], padding: Any, coarse: Fine, count: int, report: Progress
) -> Fine | None:
    """A histogram of the middle 99.9 %, where that fills under 1/128 of the coarse one."""
    found = None
    for _ in range(4):  # 65536/128 times finer each
        counts, first, width, below = found or coarse
        total = below + np.cumsum(counts)
        a, b = (int(np.searchsorted(total, share * count)) for share in (0.0005, 0.9995))
        low, high = first + width * a, first + width * (b + 1)
        if b - a >= BINS // 128 or not low < high or width * BINS / 128 < 1e-300:
            break
        below += int(counts[:a].sum())
        counts, *_ = _count_floats(data, padding, True, (low, high), report)
        if counts.max() == counts.sum():  # one value with rare others: nothing to resolve
            return None
        found = counts, low, (high - low) / BINS, below
    return found


def _constant(data: NDArray[Any], value: float, nans: int, infs: int, padded: int) -> Statistics:
    count = data.size - nans - infs - padded
    return Statistics(
        value, value, count, nans, infs, padded, value, 0.0,
        np.array([count], dtype=np.int64), value - 0.5, 1.0, False,
    )  # fmt: skip


def _moments(values: NDArray[np.float64], counts: NDArray[np.int64]) -> tuple[float, float]:
    count = int(counts.sum())
    mean = float(values @ counts) / count
    return mean, math.sqrt(float((values - mean) ** 2 @ counts) / count)


def _from_sums(total: float, squares: float, count: int, low: float) -> tuple[float, float]:
    mean = total / count
    return low + mean, math.sqrt(max(squares / count - mean * mean, 0.0))


def _nothing(nans: int, infs: int, padded: int, *, integers: bool) -> Statistics:
    counts = np.zeros(1, dtype=np.int64)
    first = -0.5 if integers else 0.0
    return Statistics(0.0, 0.0, 0, nans, infs, padded, 0.0, 0.0, counts, first, 1.0, integers)
