"""Colours: sRGB hex codes, the OKLCH space for even steps, and named ramps.

OKLab: B. Ottosson 2020, "A perceptual color space for image processing".
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError
from volviz.model.transfer import linear_to_srgb

Rgb = tuple[float, float, float]

# each from dark to light; viridis, inferno, magma and plasma after Smith and van der Walt 2015
# (CC0), cividis after Nuñez, Anderton and Renslow 2018 (CC0), the others our own.
# What stands before a dark background begins with a colour, not with black, which would only veil.
RAMPS: dict[str, tuple[str, ...]] = {
    "gray": ("#000000", "#ffffff"),
    "viridis": (
        "#440154", "#482878", "#3e4a89", "#31688e", "#26828e",
        "#1f9e89", "#35b779", "#6ece58", "#b5de2b", "#fde725",
    ),
    "inferno": (
        "#000004", "#1b0c42", "#4b0c6b", "#781c6d", "#a52c60",
        "#cf4446", "#ed6925", "#fb9a06", "#f7d03c", "#fcffa4",
    ),
    "magma": (
        "#000004", "#180f3e", "#451077", "#721f81", "#9f2f7f",
        "#cd4071", "#f1605d", "#fd9567", "#fec98d", "#fcfdbf",
    ),
    "plasma": (
        "#0d0887", "#47039f", "#7301a8", "#9c179e", "#bd3786",
        "#d8576b", "#ed7953", "#fa9e3b", "#fdc926", "#f0f921",
    ),
    "cividis": (
        "#00204d", "#00336f", "#39486b", "#575c6d", "#707173",
        "#8a8779", "#a69d75", "#c4b56c", "#e4cf5b", "#ffea46",
    ),
    "ember": ("#3b2280", "#7a2a8c", "#bb3b74", "#e8643f", "#fba23c", "#fdf1b4"),
    "tissue": ("#7d4a3c", "#b57e66", "#d9ab90", "#efd2b8", "#fdf3e6"),
    "clay": ("#7a5240", "#bb8d68", "#dfc49d", "#f3e7d0", "#ffffff"),
    "ice": ("#1f5f9c", "#4394c4", "#8cc8de", "#dcf2f8"),
}  # fmt: skip


def rgb(code: str) -> Rgb:
    """sRGB 0..1 from "#rrggbb". Raises UsageError for anything else."""
    digits = code[1:]
    if len(code) == 7 and code[0] == "#" and all(c in "0123456789abcdefABCDEF" for c in digits):
        red, green, blue = (int(digits[i : i + 2], 16) / 255 for i in (0, 2, 4))
        return red, green, blue
    raise UsageError(f"'{code}' is not a colour", fix="write it as #rrggbb, e.g. #e8d3a4")


def hex_code(color: Sequence[float]) -> str:
    """ "#rrggbb" of an sRGB colour 0..1."""
    return "#" + "".join(f"{round(255 * min(max(c, 0.0), 1.0)):02x}" for c in color[:3])


def ramp_points(
    name: str, low: float, high: float
) -> tuple[tuple[float, float, float, float], ...]:
    """Colour points of a named ramp, spread evenly over low..high."""
    codes = RAMPS[name]
    values = np.linspace(low, high, len(codes))
    return tuple((float(v), *rgb(c)) for v, c in zip(values, codes, strict=True))


def oklch_to_linear(lightness: float, chroma: float, hue: float) -> NDArray[np.float64]:
    """Linear-light sRGB of an OKLCH colour, outside 0..1 where there is none. hue: degrees."""
    a = chroma * math.cos(math.radians(hue))
    b = chroma * math.sin(math.radians(hue))
    cone = np.array(
        [
            lightness + 0.3963377774 * a + 0.2158037573 * b,
            lightness - 0.1055613458 * a - 0.0638541728 * b,
            lightness - 0.0894841775 * a - 1.2914855480 * b,
        ]
    )
    to_rgb = np.array(
        [
            [4.0767416621, -3.3077115913, 0.2309699292],
            [-1.2684380046, 2.6097574011, -0.3413193965],
            [-0.0041960863, -0.7034186147, 1.7076147010],
        ]
    )
    return np.asarray(to_rgb @ cone**3, dtype=np.float64)


def oklch(lightness: float, chroma: float, hue: float) -> Rgb:
    """sRGB 0..1 of an OKLCH colour; chroma gives way until sRGB can show it."""
    light = oklch_to_linear(lightness, chroma, hue)
    while chroma > 1e-3 and (light.min() < 0 or light.max() > 1):
        chroma *= 0.95
        light = oklch_to_linear(lightness, chroma, hue)
    red, green, blue = (float(c) for c in np.clip(linear_to_srgb(np.clip(light, 0, 1)), 0, 1))
    return red, green, blue
