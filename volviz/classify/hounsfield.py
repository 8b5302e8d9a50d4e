"""Hounsfield units: what lies where, and whether a volume is measured in them.

The table is the survey's ("Heuristic approach, based on measurements of data sets"): air −1000,
water 0, the rest by comparison. Ranges of soft materials overlap; that is how it is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from volviz.classify.colormaps import Rgb, rgb
from volviz.fields.statistics import Statistics
from volviz.model.volume import Volume


@dataclass(frozen=True)
class Material:
    """A stretch of the Hounsfield scale. low, high: HU, inclusive; color: "#rrggbb"."""

    name: str
    low: float
    high: float
    color: str

    @property
    def middle(self) -> float:
        """HU in the middle of the range; its lower end where it has no upper one."""
        return self.low if math.isinf(self.high) else (self.low + self.high) / 2

    @property
    def rgb(self) -> Rgb:
        """sRGB 0..1."""
        return rgb(self.color)


HOUNSFIELD: tuple[Material, ...] = (
    Material("air", -1024, -976, "#7fb4cf"),
    Material("fat", -75, -55, "#e9c46a"),
    Material("water", 0, 0, "#3f7fc8"),
    Material("tissue", 20, 60, "#c98a77"),
    Material("muscle", 50, 90, "#9f3d36"),
    Material("blood", 70, 90, "#c3181f"),
    Material("spongy bone", 50, 150, "#c7916a"),
    Material("compact bone", 700, 1900, "#f0e3c8"),
    Material("enamel", 2300, 3100, "#ffffff"),
    Material("metal", 4000, math.inf, "#9db9d6"),
)

# raw scanner numbers are HU plus one of these
_OFFSETS = (0.0, 1024.0, 1000.0)


def hounsfield_offset(volume: Volume, statistics: Statistics) -> float | None:
    """What HU have to be raised by to get this volume's values: 0 in HU, None if it is no CT.

    Told by the file (unit "HU") or by the histogram: air near −1000 and soft tissue between −200
    and 150, as CT of bodies has. Files of raw scanner numbers are higher by 1000 or 1024.
    """
    info = volume.info
    if info.kind == "labels" or volume.data.dtype.itemsize < 2:
        return None
    if info.modality not in (None, "CT"):
        return None
    if info.value_unit == "HU" and statistics.low < -100:
        return 0.0
    told = info.modality == "CT"
    offsets = _OFFSETS if told or statistics.integers else (0.0,)
    found = [o for o in offsets if _looks_like_a_body(statistics, o, told)]
    if found:
        return min(found, key=lambda o: abs(_soft_peak(statistics, o) - 40))
    return 0.0 if info.value_unit == "HU" else None


def _looks_like_a_body(stats: Statistics, offset: float, told: bool) -> bool:
    """Air, soft tissue with a peak, and little in between and below. told: the file says CT."""
    if stats.count == 0 or not -4096 <= stats.low - offset <= -850 or stats.high - offset > 40000:
        return False
    if offset and not (stats.low >= 0 and 1200 <= stats.high <= 5000):
        return False
    if stats.percentile(99.9) - offset < 50:
        return False
    air = _share(stats, -1100 + offset, -850 + offset)
    soft = _share(stats, -200 + offset, 150 + offset)
    between = _share(stats, -800 + offset, -250 + offset)
    least = 0.01 if told else 0.03
    if offset and not told:  # many things have values from 0 to 4000: ask for a narrow peak
        around = _share(stats, -400 + offset, 400 + offset)
        if soft < max(0.15, 0.7 * around) or between > 0.5 * soft:
            return False
    return air > least and soft > least and between < max(0.25, 2 * soft)


def _soft_peak(stats: Statistics, offset: float) -> float:
    """HU of the highest count between 0 and 120, counts smoothed over 15 HU."""
    values = np.arange(0, 121.0)
    counts = np.array([_share(stats, v - 7.5 + offset, v + 7.5 + offset) for v in values])
    return float(values[int(np.argmax(counts))])


def _share(stats: Statistics, low: float, high: float) -> float:
    """Part of the voxels with low ≤ value ≤ high, to a bin."""
    ends: NDArray[np.float64] = (np.array([low, high]) - stats.first) / stats.width
    first, last = (int(i) for i in np.clip(np.floor(ends), -1, stats.histogram.size))
    if last < 0 or first >= stats.histogram.size:
        return 0.0
    return float(stats.histogram[max(first, 0) : last + 1].sum()) / max(stats.count, 1)
