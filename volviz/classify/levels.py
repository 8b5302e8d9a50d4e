"""Where the background of a volume ends and where its contents lie, read off the histogram."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volviz.fields.statistics import Statistics
from volviz.model.volume import Volume

BINS = 512
HUGE, TINY = 1e300, 1e-290  # beyond and below, differences are lost


@dataclass(frozen=True)
class Levels:
    """Values that divide a histogram, low ≤ background ≤ threshold ≤ high, low < high.

    low, high: ends of the robust range (0.5 and 99.5 percent; of what is above the background).
    background: where the peak of empty space ends; `low` if there is none. threshold: divides
    background from contents best (Otsu 1979). tissue: most frequent value above the threshold.
    share: part of the voxels above `threshold`. empty: part of the voxels up to `background`.
    bimodality: 0..1, the part of the variance that Otsu's classes explain (normal curve: 0.64).
    """

    low: float
    background: float
    threshold: float
    tissue: float
    high: float
    share: float
    empty: float
    bimodality: float

    def at(self, relative: float) -> float:
        """The value at a relative position: 0 is the background's end, 1 is high."""
        return self.background + relative * (self.high - self.background)


def levels(statistics: Statistics) -> Levels:
    """The levels of a histogram; defined for constant and empty data too."""
    if statistics.count == 0 or statistics.high / 2 - statistics.low / 2 < TINY:
        low = statistics.low
        step = max(abs(low) * 1e-3, 1e-6)
        return Levels(low - step, low - step, low, low, low + step, 1.0, 0.0, 0.0)
    if max(abs(statistics.low), abs(statistics.high)) > HUGE:
        low, high = max(statistics.low, -HUGE), min(statistics.high, HUGE)
        return Levels(low, low, (low + high) / 2, (low + high) / 2, high, 1.0, 0.0, 0.0)
    counts, low, width = coarse_histogram(statistics)
    total = float(counts.sum())
    edge = _background_end(counts)
    empty = float(counts[:edge].sum()) / total
    # a peak of few voxels, or of nearly all values, is no background
    if empty < 0.1:
        edge, empty = 0, 0.0
    background = low + edge * width
    high = statistics.percentile(100 - 0.5 * (1 - empty)) if edge else statistics.percentile(99.5)
    if not high > background:
        high = statistics.high if statistics.high > background else background + width
    threshold = low + otsu(counts) * width
    if edge and threshold < background + 2 * width:  # a wide background: divide the rest
        threshold = low + otsu(np.where(np.arange(counts.size) < edge, 0, counts)) * width
    threshold = min(max(threshold, background), high)
    cut = min(max(round((threshold - low) / width), 0), counts.size - 1)
    share = float(counts[cut:].sum()) / total
    smooth = smoothed(_without_gaps(counts), max(counts.size // 80, 1))
    tissue = low + (cut + int(np.argmax(smooth[cut:])) + 0.5) * width
    start = background if edge else statistics.percentile(0.5)
    start = start if start < high else low
    return Levels(low, start, threshold, min(tissue, high), high, share, empty, _bimodality(counts))


def coarse_histogram(statistics: Statistics) -> tuple[NDArray[np.float64], float, float]:
    """float64[≤ 512] counts over the middle of the values, its lower end, and the bins' width.

    Integers in a small range get a bin each. What lies beyond the ends is in the end bins.
    """
    low, high = statistics.percentile(0.05), statistics.percentile(99.9)
    counts, first, step = statistics.histogram, statistics.first, statistics.width
    if statistics.fine is not None:
        counts, first, step, _ = statistics.fine
    if not high - low > (0 if statistics.integers else step):  # one bin holds almost all
        low, high = statistics.low, statistics.high
    bins = BINS
    if statistics.integers and (high - low) / step < BINS:
        low, high = low - 0.5 * step, high + 0.5 * step
        bins = max(round((high - low) / step), 2)
    width = high / bins - low / bins
    index = (first - low) / width + (step / width) * np.arange(0.5, counts.size)
    index = np.clip(index, 0, bins - 1).astype(np.int64)
    weights = np.bincount(index, weights=counts, minlength=bins)
    return weights.astype(np.float64), low, width


def otsu(counts: NDArray[np.float64]) -> int:
    """The bin at which two classes differ most between and least within (Otsu 1979)."""
    between = _between(counts)
    best = np.flatnonzero(between >= between.max() * (1 - 1e-9))
    return round(float(best.mean())) + 1


def _bimodality(counts: NDArray[np.float64]) -> float:
    bins = np.arange(counts.size)
    total = counts.sum()
    mean = float((counts @ bins) / total)
    variance = float(counts @ (bins - mean) ** 2) / total
    return float(_between(counts).max() / total**2 / variance) if variance > 0 else 0.0


def _between(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance between the classes up to a bin and after it, times the squared total."""
    bins = np.arange(counts.size)
    below = np.cumsum(counts)
    above = below[-1] - below
    sums = np.cumsum(counts * bins)
    with np.errstate(divide="ignore", invalid="ignore"):
        gap = sums / below - (sums[-1] - sums) / above
        return np.asarray(np.where((below > 0) & (above > 0), below * above * gap**2, 0.0))


def smoothed(counts: NDArray[np.float64], radius: int) -> NDArray[np.float64]:
    """Two passes of a running mean of 2·radius + 1 bins, ends repeated."""
    kernel = np.ones(2 * radius + 1) / (2 * radius + 1)
    for _ in range(2):
        counts = np.convolve(np.pad(counts, radius, mode="edge"), kernel, mode="valid")
    return counts


def _background_end(counts: NDArray[np.float64]) -> int:
    """The bin after the peak of the background; 0 if the highest peak is not at the low end."""
    filled = _without_gaps(counts)
    peak = int(np.argmax(filled))
    if peak > 0.35 * counts.size or filled[peak] < 3 * np.mean(filled):
        return 0
    smooth = smoothed(filled, 2)
    end, least = peak + 1, smooth[peak]
    floor = 0.02 * smooth[peak]
    while end < counts.size - 1 and smooth[end] > floor and smooth[end] <= least * 1.02:
        least = min(least, smooth[end])
        end += 1
    return end if end < 0.6 * counts.size else 0


def _without_gaps(counts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Bins between the few values of coarse integers take their neighbours' mean."""
    filled = np.flatnonzero(counts)
    if filled.size < 8 or filled.size > counts.size // 2:  # masks have two or three: no curve
        return counts
    return np.interp(np.arange(counts.size), filled, counts[filled])


def extent(volume: Volume) -> float:
    """A length in mm that tells how large the volume is to a ray: the mean of its sides.

    The geometric mean, at most four times the thinnest side, so that thin stacks stay visible.
    """
    sides = [s * n for s, n in zip(volume.spacing, volume.dims, strict=True)]
    sides = [s if math.isfinite(s) and s > 0 else 1.0 for s in sides]
    mean = math.exp(sum(math.log(s) for s in sides) / 3)
    return min(mean, 4 * max(min(sides), mean * 1e-6))
