"""Control points of a transfer function as a list to edit: pure functions, tuples in and out.

Points are tuples whose first number is the value; they stay sorted by it and finite. Indices are
positions in the list. There is always at least one point.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.model.transfer import ColorPoint, OpacityPoint, TransferFunction

HUGE = 1e300
DECADES = 4.0
"""A logarithmic opacity axis shows so many decades below 1; what is less is at its bottom."""

Points = tuple[Any, ...]
Indices = frozenset[int]


def added(points: Points, point: tuple[float, ...]) -> tuple[Points, int]:
    """The points with one more, and its index."""
    point = (_finite(point[0]), *point[1:])
    at = bisect_right([p[0] for p in points], point[0])
    return (*points[:at], point, *points[at:]), at


def removed(points: Points, indices: Iterable[int]) -> Points:
    """The points without some; the first of all is kept if none would be left."""
    gone = set(indices)
    return tuple(p for i, p in enumerate(points) if i not in gone) or points[:1]


def put(points: Points, index: int, point: tuple[float, ...]) -> tuple[Points, int]:
    """Another point in place of one, and its index: the list is sorted again."""
    point = (_finite(point[0]), *point[1:])
    left = points[index - 1][0] if index > 0 else -math.inf
    right = points[index + 1][0] if index + 1 < len(points) else math.inf
    if left <= point[0] <= right:
        return (*points[:index], point, *points[index + 1 :]), index
    return added((*points[:index], *points[index + 1 :]), point)


def moved(points: Points, indices: Iterable[int], delta: float) -> Points:
    """Some points moved together along the value axis, as far as the others let them."""
    chosen = {i for i in indices if 0 <= i < len(points)}
    if not chosen or not math.isfinite(delta) or delta == 0:
        return points
    value = [p[0] for p in points]
    low = high = None
    for i in chosen:
        if i > 0 and i - 1 not in chosen:
            room = value[i - 1] - value[i]
            low = room if low is None else max(low, room)
        if i + 1 < len(points) and i + 1 not in chosen:
            room = value[i + 1] - value[i]
            high = room if high is None else min(high, room)
    delta = max(delta, low) if low is not None else delta
    delta = min(delta, high) if high is not None else delta
    new = [_finite(v + delta) if i in chosen else v for i, v in enumerate(value)]
    for i in sorted(chosen):  # rounding must not put a point before its neighbour
        new[i] = max(new[i], new[i - 1]) if i > 0 else new[i]
        if i + 1 < len(new) and i + 1 not in chosen:
            new[i] = min(new[i], new[i + 1])
    return tuple((v, *p[1:]) for v, p in zip(new, points, strict=True))


def raised(
    points: tuple[OpacityPoint, ...], indices: Iterable[int], delta: float, *, log: bool
) -> tuple[OpacityPoint, ...]:
    """The opacity of some points moved by a part of the axis' height, kept within 0..1."""
    if delta == 0 or not math.isfinite(delta):
        return points
    chosen = set(indices)
    return tuple(
        (v, opacity_of(float(height_of(a, log=log)) + delta, log=log)) if i in chosen else (v, a)
        for i, (v, a) in enumerate(points)
    )


def height_of(opacity: ArrayLike, *, log: bool) -> NDArray[np.float64]:
    """Where on the opacity axis an opacity stands, 0..1; logarithmic over `DECADES`."""
    alpha = np.clip(np.asarray(opacity, dtype=np.float64), 0.0, 1.0)
    if not log:
        return alpha
    return np.maximum(1 + np.log10(np.maximum(alpha, 10.0**-DECADES)) / DECADES, 0.0)


def opacity_of(height: float, *, log: bool) -> float:
    """The opacity at a height of the axis; the bottom is 0."""
    if not height > 0:
        return 0.0
    height = min(float(height), 1.0)
    opacity = float(10.0 ** (DECADES * (height - 1))) if log else height
    return float(f"{opacity:.3g}") if log else round(opacity, 4)


def neat(value: float, step: float) -> float:
    """A value with no more digits than steps of this size call for."""
    if not (math.isfinite(value) and math.isfinite(step) and step > 0):
        return value
    digits = -math.floor(math.log10(step))
    return round(value, digits) if -300 < digits < 300 else value


def with_opacities(transfer: TransferFunction, points: Points) -> TransferFunction:
    """The same with other opacity points; the same object if they are equal."""
    return transfer if points == transfer.opacities else replace(transfer, opacities=points)


def with_colors(transfer: TransferFunction, points: Points) -> TransferFunction:
    """The same with other colour points; the same object if they are equal."""
    return transfer if points == transfer.colors else replace(transfer, colors=points)


def add_opacity(
    transfer: TransferFunction, value: float, opacity: float | None = None
) -> tuple[TransferFunction, int]:
    """One more opacity point (by default on the curve), and its index."""
    value = _finite(value)
    alpha = float(transfer.opacity_at(value)) if opacity is None else min(max(opacity, 0.0), 1.0)
    points, at = added(transfer.opacities, (value, alpha))
    return with_opacities(transfer, points), at


def add_color(transfer: TransferFunction, value: float) -> tuple[TransferFunction, int]:
    """One more colour point of the colour that is there, and its index."""
    value = _finite(value)
    red, green, blue = (float(c) for c in transfer.color_at(value))
    points, at = added(transfer.colors, (value, red, green, blue))
    return with_colors(transfer, points), at


def painted(
    points: tuple[ColorPoint, ...], indices: Iterable[int], color: Iterable[float]
) -> tuple[ColorPoint, ...]:
    """Some colour points in another colour, sRGB 0..1."""
    red, green, blue = (min(max(float(c), 0.0), 1.0) for c in color)
    chosen = set(indices)
    return tuple((p[0], red, green, blue) if i in chosen else p for i, p in enumerate(points))


def reversed_colors(transfer: TransferFunction) -> TransferFunction:
    """The colours in the opposite order over the same values."""
    first, last = transfer.colors[0][0], transfer.colors[-1][0]
    points = tuple((first + (last - v), *c) for v, *c in reversed(transfer.colors))
    return with_colors(transfer, _sorted(points))


def shifted(transfer: TransferFunction, delta: float) -> TransferFunction:
    """Everything moved along the value axis."""
    return _mapped(transfer, lambda v: v + delta) if math.isfinite(delta) else transfer


def windowed(transfer: TransferFunction, widen: float, raise_level: float) -> TransferFunction:
    """The window gesture: width (highest − lowest value) times `widen`, level + `raise_level`."""
    low, high = transfer.domain
    level = low + (high - low) / 2
    if not (math.isfinite(widen) and widen > 0 and math.isfinite(raise_level)):
        return transfer
    return _mapped(transfer, lambda v: level + raise_level + (v - level) * widen)


def stretched(transfer: TransferFunction, low: float, high: float) -> TransferFunction:
    """Everything mapped so that the lowest and the highest value become these (low < high)."""
    if not (math.isfinite(low) and math.isfinite(high) and low < high):
        return transfer
    old_low, old_high = transfer.domain
    if not old_high - old_low > 0:
        return transfer
    share = lambda v: (v - old_low) / (old_high - old_low)  # noqa: E731
    return _mapped(transfer, lambda v: min(low * (1 - share(v)) + high * share(v), high))


def nearest(
    xs: NDArray[np.float64], ys: NDArray[np.float64], at: tuple[float, float], reach: float
) -> int | None:
    """Index of the point next to a place, not farther than `reach`; the later of equal ones."""
    if xs.size == 0:
        return None
    squares = (xs - at[0]) ** 2 + (ys - at[1]) ** 2
    best = int(squares.size - 1 - np.argmin(squares[::-1]))
    return best if squares[best] <= reach**2 else None


def _mapped(transfer: TransferFunction, move: Callable[[float], float]) -> TransferFunction:
    colors = _sorted(tuple((_finite(move(v)), *c) for v, *c in transfer.colors))
    opacities = _sorted(tuple((_finite(move(v)), a) for v, a in transfer.opacities))
    return replace(transfer, colors=colors, opacities=opacities)


def _sorted(points: Points) -> Points:
    """Points that rounding may have put out of order, each raised to those before it."""
    values = np.maximum.accumulate([p[0] for p in points])
    return tuple((float(v), *p[1:]) for v, p in zip(values, points, strict=True))


def _finite(value: float) -> float:
    return 0.0 if math.isnan(value) else min(max(float(value), -HUGE), HUGE)
