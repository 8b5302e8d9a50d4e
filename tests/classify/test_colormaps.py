"""Colours against numbers published elsewhere."""

from __future__ import annotations

import numpy as np
import pytest

from volviz.classify.colormaps import RAMPS, hex_code, oklch, oklch_to_linear, rgb
from volviz.errors import UsageError


def test_hex() -> None:
    assert rgb("#ff8000") == (1.0, 128 / 255, 0.0)
    assert hex_code(rgb("#12abef")) == "#12abef"
    for wrong in ("red", "#fff", "#gggggg", "112233", "#1122334"):
        with pytest.raises(UsageError):
            rgb(wrong)


@pytest.mark.parametrize(
    ("lightness", "chroma", "hue", "linear"),
    [
        # sRGB primaries in OKLCH, from the CSS Color 4 specification
        (1.0, 0.0, 0.0, (1, 1, 1)),
        (0.62796, 0.25768, 29.234, (1, 0, 0)),
        (0.86644, 0.29483, 142.495, (0, 1, 0)),
        (0.45201, 0.31321, 264.052, (0, 0, 1)),
    ],
)
def test_oklch(
    lightness: float, chroma: float, hue: float, linear: tuple[float, float, float]
) -> None:
    np.testing.assert_allclose(oklch_to_linear(lightness, chroma, hue), linear, atol=2e-3)


def test_oklch_stays_in_gamut() -> None:
    for hue in range(0, 360, 15):
        color = oklch(0.8, 0.4, hue)
        assert all(0 <= c <= 1 for c in color)


def test_ramps_are_colors() -> None:
    for codes in RAMPS.values():
        assert len(codes) > 1
        assert all(len(rgb(c)) == 3 for c in codes)
