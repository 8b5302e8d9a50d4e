"""Colour to one value per pixel: Rec. 709 luma of the encoded R, G, B."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

WEIGHTS = (0.2126, 0.7152, 0.0722)
"""ITU-R BT.709-6, item 3.2: E'Y = 0.2126 E'R + 0.7152 E'G + 0.0722 E'B."""


def luminance(colour: NDArray[Any]) -> NDArray[Any]:
    """Luma of `colour[..., 3 or more]` (R, G, B, further ones ignored), rounded, in its own dtype.

    Integers come back as the same integer type, floats as floats. Works row by row, so that a
    large picture needs no float copy of itself.
    """
    out = np.empty(colour.shape[:-1], dtype=colour.dtype)
    weights = np.asarray(WEIGHTS, dtype=np.float64)
    rows, flat = colour.reshape(-1, *colour.shape[-2:]), out.reshape(-1, out.shape[-1])
    step = max(1, (1 << 20) // max(1, colour.shape[-2]))
    for low in range(0, len(rows), step):
        grey = rows[low : low + step, :, :3] @ weights
        flat[low : low + step] = np.rint(grey) if out.dtype.kind in "iu" else grey
    return out
