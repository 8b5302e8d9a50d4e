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
# (CC0), cividis after Nuñez, Anderton and Renslow 2018 (CC0), coolwarm after Moreland 2009 (for
# values on both sides of zero: light in its middle), the others our own.
# What stands before a dark background begins with a colour, not with black, which would only veil.
RAMPS: dict[str, tuple[str, ...]] = {
    "gray": ("#000000", "#ffffff"),
    "viridis": (
        "#440154", "#48186a", "#472d7b", "#424086", "#3b528b",
        "#33638d", "#2c728e", "#26828e", "#21918c", "#1fa088",
        "#28ae80", "#3fbc73", "#5ec962", "#84d44b", "#addc30",
        "#d8e219", "#fde725",
    ),
    "inferno": (
        "#000004", "#0b0724", "#210c4a", "#3d0965", "#57106e",
        "#71196e", "#8a226a", "#a32c61", "#bc3754", "#d24644",
        "#e45a31", "#f1731d", "#f98e09", "#fcac11", "#f9cb35",
        "#f2ea69", "#fcffa4",
    ),
    "magma": (
        "#000004", "#0a0822", "#1d1147", "#36106b", "#51127c",
        "#6a1c81", "#832681", "#9c2e7f", "#b73779", "#d0416f",
        "#e75263", "#f56b5c", "#fc8961", "#fea772", "#fec488",
        "#fde2a3", "#fcfdbf",
    ),
    "plasma": (
        "#0d0887", "#310597", "#4c02a1", "#6600a7", "#7e03a8",
        "#9511a1", "#aa2395", "#bc3587", "#cc4778", "#da5a6a",
        "#e66c5c", "#f0804e", "#f89540", "#fdac33", "#fdc527",
        "#f8df25", "#f0f921",
    ),
    "cividis": (
        "#00224e", "#002e6a", "#1a386f", "#32436d", "#434e6c",
        "#535a6d", "#61656f", "#6f7073", "#7d7c78", "#8c8878",
        "#9b9476", "#aba072", "#bcae6c", "#cdbb63", "#dec958",
        "#f0d846", "#fee838",
    ),
    "ember": ("#3b2280", "#7a2a8c", "#bb3b74", "#e8643f", "#fba23c", "#fdf1b4"),
    "tissue": ("#7d4a3c", "#b57e66", "#d9ab90", "#efd2b8", "#fdf3e6"),
    "clay": ("#7a5240", "#bb8d68", "#dfc49d", "#f3e7d0", "#ffffff"),
    "ice": ("#1f5f9c", "#4394c4", "#8cc8de", "#dcf2f8"),
    "coolwarm": (
        "#3b4cc0", "#6282ea", "#8db0fe", "#b8d0f9", "#dddddd",
        "#f5c4ad", "#f49a7b", "#de604d", "#b40426",
    ),
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
