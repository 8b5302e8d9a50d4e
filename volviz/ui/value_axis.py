"""The value axis that plot, ruler and colour bar share, and the histogram along it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.fields.statistics import Statistics
from volviz.model.transfer import TransferFunction

Span = tuple[float, float]


@dataclass(frozen=True)
class Axis:
    """Values low..high over `width` pixels from `left`."""

    left: float
    width: float
    low: float
    high: float

    def pixels(self, values: ArrayLike) -> NDArray[np.float64]:
        """Where values stand, in pixels; far outside is kept a screen or two away."""
        share = (np.asarray(values, dtype=np.float64) - self.low) / (self.high - self.low)
        return self.left + self.width * np.clip(share, -2.0, 3.0)

    def value(self, pixel: float) -> float:
        """The value at a pixel."""
        return self.low + (self.high - self.low) * (pixel - self.left) / self.width

    @property
    def per_pixel(self) -> float:
        """Value per pixel."""
        return (self.high - self.low) / self.width

    def seen(self, values: ArrayLike) -> NDArray[np.bool_]:
        """Which values are in view."""
        v = np.asarray(values, dtype=np.float64)
        return np.asarray((v >= self.low) & (v <= self.high))


_cumulated: WeakKeyDictionary[Statistics, tuple[NDArray[np.float64], NDArray[np.float64]]] = (
    WeakKeyDictionary()
)


def cumulated(statistics: Statistics) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """float64[n], float64[n]: values, rising, and how many voxels lie below each.

    Where the statistics have a finer histogram of the middle, that one counts there.
    """
    if statistics not in _cumulated:
        edges = statistics.edges
        below = np.concatenate([[0.0], np.cumsum(statistics.histogram, dtype=np.float64)])
        if statistics.fine is not None:
            counts, first, width, start = statistics.fine
            inner = first + width * np.arange(counts.size + 1, dtype=np.float64)
            inner_below = start + np.concatenate([[0.0], np.cumsum(counts, dtype=np.float64)])
            left, right = edges < inner[0], edges > inner[-1]
            edges = np.concatenate([edges[left], inner, edges[right]])
            below = np.concatenate([below[left], inner_below, below[right]])
        _cumulated[statistics] = edges, below
    return _cumulated[statistics]


def bars(statistics: Statistics, span: Span, count: int) -> NDArray[np.float64]:
    """float64[count]: voxels in `count` even columns of a stretch of the value axis.

    Columns narrower than a bin take their part of it, so that any zoom shows what is known.
    """
    values, below = cumulated(statistics)
    ends = np.linspace(span[0], span[1], count + 1)
    return np.maximum(np.diff(np.interp(ends, values, below)), 0.0)


def share_between(statistics: Statistics, low: float, high: float) -> float:
    """Part of the voxels (0..1) with values between two."""
    values, below = cumulated(statistics)
    a, b = np.interp([low, high], values, below)
    return float(max(b - a, 0.0)) / max(statistics.count, 1)


def heights(counts: NDArray[np.float64], *, log: bool) -> NDArray[np.float64]:
    """Counts as heights 0..1 of the tallest column; logarithmic from one voxel up."""
    tall = np.log1p(counts) if log else counts
    most = float(tall.max(initial=0.0))
    return tall / most if most > 0 else np.zeros_like(tall)


def fitted_span(transfer: TransferFunction, statistics: Statistics | None) -> Span:
    """A stretch that shows all control points and nearly all values, with a little room.

    Values far from the points (outliers, metal) do not squeeze the points together.
    """
    low, high = transfer.domain
    if statistics is not None and statistics.count:
        width = high - low
        far = statistics.percentile(0.1), statistics.percentile(99.9)
        low = min(low, max(far[0], low - width))
        high = max(high, min(far[1], high + width))
    return _roomy(low, high)


def whole_span(transfer: TransferFunction, statistics: Statistics | None) -> Span:
    """A stretch that shows every value and every control point."""
    low, high = transfer.domain
    if statistics is not None and statistics.count:
        low, high = min(low, statistics.low), max(high, statistics.high)
    return _roomy(low, high)


def ticks(low: float, high: float, count: int) -> list[float]:
    """At most `count` + 1 round values (1, 2 or 5 times a power of ten apart) between two."""
    rough = (high - low) / max(count, 1)
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough * (1 - 1e-9))
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    return [i * step for i in range(first, last + 1)]


def _roomy(low: float, high: float) -> Span:
    room = 0.03 * (high - low)
    least = max(abs(low), abs(high)) * 1e-6
    if not high - low > least:
        room = max(abs(low) * 0.1, 1e-30 if low else 1.0)
    return max(low - room, -1e300), min(high + room, 1e300)
