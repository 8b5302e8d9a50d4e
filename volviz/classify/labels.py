"""Label volumes: telling them from measurements, and giving every label a colour of its own."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.classify.colormaps import Rgb, oklch
from volviz.fields.statistics import Statistics
from volviz.model.transfer import MAX_TABLE, ColorPoint, OpacityPoint, TransferFunction
from volviz.model.volume import Volume

GOLDEN_ANGLE = 137.50776405003785  # degrees; hues of neighbouring ids lie far apart
_TONES = ((0.74, 0.135), (0.61, 0.15), (0.83, 0.10))  # lightness and chroma, in turn
_SLICES = 48


def looks_like_labels(volume: Volume, statistics: Statistics) -> bool:
    """True if the values are names of things rather than measurements.

    As the file says, else by the voxels: whole numbers, none negative, at least three of them,
    not all multiples of a step; neighbours mostly equal or, where not, different by any amount.
    """
    if volume.info.kind == "labels":
        return True
    if volume.info.modality is not None or volume.info.value_unit is not None:
        return False
    if not statistics.integers or statistics.low < 0 or min(volume.dims) < 2:
        return False
    values = label_values(statistics)
    if len(values) < 3 or (statistics.width == 1 and math.gcd(*values) >= 10):
        return False
    same, near = _neighbours(volume.data, statistics)
    return same >= 0.85 or (same >= 0.6 and near < 0.35)


def label_values(statistics: Statistics) -> list[int]:
    """The labels that occur, rising; beyond 65536 ids the middles of groups of them."""
    return [int(v) for v in np.rint(statistics.centers[statistics.histogram > 0])]


def label_color(label: int) -> Rgb:
    """sRGB of a label, always the same for the same id: golden-angle hues, lightness in turn."""
    lightness, chroma = _TONES[label % len(_TONES)]
    return oklch(lightness, chroma, (label * GOLDEN_ANGLE + 20) % 360)


def label_transfer(volume: Volume, statistics: Statistics) -> TransferFunction:
    """A step of its own colour for every label that occurs; 0 is transparent, the rest opaque.

    The ends of the domain are whole numbers, so that every label hits an entry of the table. Of
    ids that span more than 65536, neighbours share an entry and those next to 0 vanish with it.
    """
    labels = label_values(statistics)
    low, high = statistics.low, statistics.high
    if high <= low:
        low, high = low - 1.0, low + 1.0
    reach = max(0.5, 0.5 * (high - low) / MAX_TABLE)
    colors: list[ColorPoint] = []
    opacities: list[OpacityPoint] = []
    for label in labels:
        start, end = max(label - reach, low), min(label + reach, high)
        if colors:  # rounded middles of groups may lie closer than their reach
            start = max(start, colors[-1][0])
            end = max(start, end)
        color = label_color(label)
        opacity = 0.0 if abs(label) <= statistics.width / 2 else 1.0
        colors += [(start, *color), (end, *color)]
        opacities += [(start, opacity), (end, opacity)]
    size = min(s for s in volume.spacing)
    return TransferFunction(tuple(colors), tuple(opacities), max(size, 1e-9), "labels")


def _neighbours(data: NDArray[Any], statistics: Statistics) -> tuple[float, float]:
    """Of neighbours in x and y of which neither is background: the part that is equal.

    And of all that differ: the part that differs by at most twice the smallest step of values.
    """
    background = round(float(statistics.centers[int(np.argmax(statistics.histogram))]))
    pairs = equal = unequal = close = 0
    for z in np.unique(np.linspace(0, len(data) - 1, _SLICES).astype(int)):
        plane = data[z]
        for a, b in ((plane[1:], plane[:-1]), (plane[:, 1:], plane[:, :-1])):
            same = a == b
            inside = (a != background) & (b != background)
            pairs += int(np.count_nonzero(inside))
            equal += int(np.count_nonzero(same & inside))
            differ = ~same
            first, second = a[differ].astype(np.float64), b[differ].astype(np.float64)
            unequal += first.size
            close += int(np.count_nonzero(np.abs(first - second) <= 2))
    return equal / max(pairs, 1), close / max(unequal, 1)
