"""The 1D transfer function: control points of colour and opacity over the value axis.

Opacity is physical: what accumulates over `unit_distance` millimetres. Colours are sRGB, the way
people pick them, interpolated as such; `table` gives them in linear light for the ray.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.errors import UsageError

ColorPoint = tuple[float, float, float, float]
OpacityPoint = tuple[float, float]
MIN_TABLE = 1024
MAX_TABLE = 65536


@dataclass(frozen=True)
class TransferFunction:
    """Maps a value to colour and opacity.

    colors: (value, red, green, blue), sRGB in 0..1. opacities: (value, opacity 0..1). Both sorted
    by value; two points at one value make a step. Outside the points the end points hold.
    unit_distance: mm over which the opacity accumulates. name: the preset it came from.
    """

    colors: tuple[ColorPoint, ...]
    opacities: tuple[OpacityPoint, ...]
    unit_distance: float = 1.0
    name: str = ""

    def __post_init__(self) -> None:
        object.__setattr__(self, "colors", _points(self.colors, 4, "colors"))
        object.__setattr__(self, "opacities", _points(self.opacities, 2, "opacities"))
        low, high = self.domain
        if not math.isfinite(high - low):
            raise UsageError("control points are too far apart", field="colors, opacities")
        if not (math.isfinite(self.unit_distance) and self.unit_distance > 0):
            raise UsageError(
                f"{self.unit_distance} is not a distance", field="unit_distance", fix="give mm > 0"
            )

    @property
    def domain(self) -> tuple[float, float]:
        """Lowest and highest value of a control point."""
        values = [p[0] for p in (*self.colors, *self.opacities)]
        return min(values), max(values)

    def opacity_at(self, values: ArrayLike) -> NDArray[np.float64]:
        """Opacity per unit distance at values of any shape."""
        points = np.array(self.opacities)
        return np.interp(np.asarray(values, dtype=np.float64), points[:, 0], points[:, 1])

    def color_at(self, values: ArrayLike) -> NDArray[np.float64]:
        """sRGB colour at values of any shape: float64[..., 3]."""
        points = np.array(self.colors)
        x = np.asarray(values, dtype=np.float64)
        return np.stack([np.interp(x, points[:, 0], points[:, c]) for c in (1, 2, 3)], axis=-1)

    def table_size(self, *, integers: bool) -> int:
        """Entries a lookup table needs: at least 1024, 4096 beyond 8 bits, at most 65536.

        With integer data and integer ends every integer value gets an entry of its own; steep
        slopes get at least four entries.
        """
        low, high = self.domain
        span = high - low
        if span <= 0:
            return MIN_TABLE
        floor = MIN_TABLE if integers and span <= 255 else 4096
        values = np.unique([p[0] for p in (*self.colors, *self.opacities)])
        gaps = np.diff(values)
        least = max(float(gaps.min()), 4 * span / (MAX_TABLE - 1))  # a gap may be nearly nothing
        need = max(floor - 1, 4 * span / least)
        if integers and low == round(low) and high == round(high) and span < MAX_TABLE:
            return int(span * min(math.ceil(need / span), (MAX_TABLE - 1) // span)) + 1
        return math.ceil(need) + 1

    def table(self, size: int) -> NDArray[np.float32]:
        """float32[size, 4]: linear-light colour, not premultiplied, and opacity per unit distance.

        Entry i stands for value low + i (high − low)/(size − 1) of `domain`.
        """
        low, high = self.domain
        values = np.linspace(low, high, size)
        rgb = srgb_to_linear(self.color_at(values))
        return np.concatenate([rgb, self.opacity_at(values)[:, None]], axis=1).astype(np.float32)

    def shifted(self, delta: float) -> TransferFunction:
        """All points moved by delta along the value axis."""
        return self.mapped(lambda v: v + delta)

    def stretched(self, low: float, high: float) -> TransferFunction:
        """All points mapped linearly so that the domain becomes [low, high]."""
        old_low, old_high = self.domain
        factor = (high - low) / (old_high - old_low) if old_high > old_low else 1.0
        return self.mapped(lambda v: low + (v - old_low) * factor)

    def mapped(self, move: object) -> TransferFunction:
        """All values passed through a monotonic function."""
        assert callable(move)
        return replace(
            self,
            colors=tuple((move(v), r, g, b) for v, r, g, b in self.colors),
            opacities=tuple((move(v), a) for v, a in self.opacities),
        )

    def faded(self, factor: float) -> TransferFunction:
        """All opacities times factor, kept within 0..1."""
        return replace(
            self, opacities=tuple((v, min(max(a * factor, 0.0), 1.0)) for v, a in self.opacities)
        )


def corrected_opacity(
    opacity: NDArray[np.floating], step: float, unit_distance: float
) -> NDArray[np.float64]:
    """Opacity over a step, from opacity over the unit distance: 1 − (1 − α)^(step/unit).

    Lacroute 1995, section on opacity correction; exact for a homogeneous medium.
    """
    clear = 1.0 - np.clip(np.asarray(opacity, dtype=np.float64), 0.0, 1.0)
    return 1.0 - clear ** (step / unit_distance)


def srgb_to_linear(color: ArrayLike) -> NDArray[np.float64]:
    """IEC 61966-2-1, display code 0..1 to linear light 0..1."""
    c = np.asarray(color, dtype=np.float64)
    return np.where(c <= 0.04045, c / 12.92, ((np.maximum(c, 0) + 0.055) / 1.055) ** 2.4)


def linear_to_srgb(light: ArrayLike) -> NDArray[np.float64]:
    """IEC 61966-2-1, linear light 0..1 to display code 0..1."""
    v = np.clip(np.asarray(light, dtype=np.float64), 0.0, None)
    edge = 0.04045 / 12.92  # the standard rounds it to 0.0031308, which would not lead back
    return np.where(v <= edge, v * 12.92, 1.055 * v ** (1 / 2.4) - 0.055)


def ramp(
    low: float, high: float, *, opacity: float = 1.0, unit_distance: float = 1.0, name: str = ""
) -> TransferFunction:
    """Black to white and clear to `opacity` over [low, high]; a gap of zero is widened."""
    if not high > low:
        high = low + max(abs(low) * 1e-6, 1e-6)
    return TransferFunction(
        ((low, 0.0, 0.0, 0.0), (high, 1.0, 1.0, 1.0)),
        ((low, 0.0), (high, opacity)),
        unit_distance,
        name,
    )


def _points(
    points: Iterable[Sequence[float]], width: int, name: str
) -> tuple[tuple[float, ...], ...]:
    try:
        rows = tuple(tuple(float(x) for x in point) for point in points)
    except (TypeError, ValueError) as error:
        raise UsageError("control points are lists of numbers", field=name) from error
    if not rows or any(len(row) != width for row in rows):
        raise UsageError(f"needs at least one point of {width} numbers each", field=name)
    if not all(math.isfinite(x) for row in rows for x in row):
        raise UsageError("control points must be finite numbers", field=name)
    if any(not 0 <= x <= 1 for row in rows for x in row[1:]):
        raise UsageError("colours and opacities lie between 0 and 1", field=name)
    if any(a[0] > b[0] for a, b in itertools.pairwise(rows)):
        raise UsageError("values of control points must not decrease", field=name)
    return rows
