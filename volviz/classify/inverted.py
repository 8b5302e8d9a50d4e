"""Volumes that are bright round about and dark where things are: brightfield microscopy, distances.

Their histogram is read from the other end, by the same rules.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.classify.levels import HUGE, coarse_histogram, otsu
from volviz.fields.statistics import Statistics, padding_value, valid_slab
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume

DARK = 0.1
"""So much of the border may be dark at most."""
RATHER = 0.25
"""And so much, beside the part of the whole volume that is."""
SIDE = 128
"""Samples along an axis that are enough to tell."""
FEW = 0.02
"""The part of the border's samples that may be darker than the surroundings."""
MUCH = 0.1
"""So much of a volume without a clear threshold is darker than its sides."""
LEAST = 0.001
"""So much of the volume is dark at least, or there is nothing to see."""


def bright_ground(volume: Volume, statistics: Statistics) -> float | None:
    """The value down to which bright surroundings go, where all sides of the volume are bright and
    what is dark lies within; None for other volumes.

    Bright is above the threshold that divides the histogram best (Otsu 1979), or brighter than
    much of the volume, which has little that is brighter still. A porous block has as many dark
    samples on its sides as within, and is none.
    """
    if min(volume.dims) < 3 or max(abs(statistics.low), abs(statistics.high)) > HUGE / 4:
        return None
    data, shape = volume.data, volume.data.shape
    sides = (data[0], data[-1], data[:, 0], data[:, -1], data[:, :, 0], data[:, :, -1])
    border = _values(volume, sides)
    if not border.size or statistics.constant:
        return None
    some = _values(volume, (data[tuple(slice(None, None, -(-n // SIDE)) for n in shape)],))
    counts, low, width = coarse_histogram(statistics)
    threshold = low + otsu(counts) * width
    dark, outside = (some < threshold).mean(), (border < threshold).mean()
    ground, top = np.quantile(border, (FEW, 1 - FEW))
    within, beyond = (some < ground).mean(), (some > top).mean()
    alike = (some > top + max(ground - threshold, 0.0)).mean()  # as far off, on the other side
    divided = dark >= LEAST and outside <= min(DARK, RATHER * dark) and alike <= RATHER * dark
    surrounded = within >= MUCH and beyond <= RATHER * within
    return float(ground) if divided or surrounded else None


def _values(volume: Volume, parts: Iterable[NDArray[Any]]) -> NDArray[np.float64]:
    """float64[n]: samples of some parts of a volume, those that count."""
    padding = padding_value(volume)
    return np.concatenate([p[valid_slab(p, padding)].astype(np.float64) for p in parts])


def mirrored(statistics: Statistics) -> Statistics:
    """The statistics of `low + high − value`."""
    total, s = statistics.low + statistics.high, statistics
    fine = s.fine
    if fine is not None:
        counts, first, width, below = fine
        above = s.count - below - int(counts.sum())
        fine = counts[::-1], total - (first + width * counts.size), width, above
    first = total - (s.first + s.width * s.histogram.size)
    return replace(s, mean=total - s.mean, histogram=s.histogram[::-1], first=first, fine=fine)


def turned(transfer: TransferFunction, statistics: Statistics) -> TransferFunction:
    """A transfer function made for the mirrored values, for the values themselves."""
    total = statistics.low + statistics.high
    colors = tuple((total - v, r, g, b) for v, r, g, b in reversed(transfer.colors))
    opacities = tuple((total - v, opacity) for v, opacity in reversed(transfer.opacities))
    return replace(transfer, colors=colors, opacities=opacities)
