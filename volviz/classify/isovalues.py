"""Which isovalues a volume asks for: what people look for in CT, else what the histogram divides.

Threshold: Otsu 1979, by `levels`.
"""

from __future__ import annotations

import numpy as np

from volviz.classify.hounsfield import hounsfield_offset
from volviz.classify.labels import looks_like_labels
from volviz.classify.levels import levels
from volviz.fields.statistics import Statistics
from volviz.model.surface_look import COLORS, SceneSurface
from volviz.model.volume import Volume

CT = (300.0, -300.0, 150.0, 1200.0, -600.0)
"""HU: bone, skin, bone with vessels, teeth and metal, lung."""
PLACES = (0.5, 0.25, 0.75, 0.125, 0.875)
"""Between the threshold and the highest values, where the first ones are taken."""
PROBES, STEEP, NEARLY = 16, 0.1, 0.85
"""Places along each side where values are looked at; how far a rise may be from 1, and where."""
BEHIND = 0.35
"""Opacity of a surface that surrounds those that are there."""


def suggested_isovalue(
    volume: Volume, statistics: Statistics, taken: tuple[float, ...] = ()
) -> float:
    """A value whose surface is worth seeing, other than those taken; any value if all are."""
    if statistics.count == 0:
        return 0.0
    if looks_like_labels(volume, statistics):
        return 0.5 if statistics.low <= 0.5 < statistics.high else statistics.low
    offset = hounsfield_offset(volume, statistics)
    at = levels(statistics)
    spread = at.high - at.low
    candidates = [at.threshold, *(at.threshold + p * (at.high - at.threshold) for p in PLACES)]
    if offset is not None:
        candidates = [hu + offset for hu in CT] + candidates
    if statistics.low < 0 < statistics.high and _is_distance(volume):
        candidates = [0.0, *candidates]
    inside = [c for c in candidates if statistics.low < c <= statistics.high]
    free = [c for c in inside if all(abs(c - t) > 0.01 * spread for t in taken)]
    return float(f"{(free or inside or [statistics.low])[0]:.4g}")


def _is_distance(volume: Volume) -> bool:
    """True if values are distances to a surface: they rise by 1 per mm nearly all over."""
    if volume.data.dtype.kind != "f" or min(volume.dims) < 3:
        return False
    steps = [max((n - 2) // PROBES, 1) for n in volume.data.shape]
    at = [np.arange(1, n - 1, step) for n, step in zip(volume.data.shape, steps, strict=True)]
    slopes = []
    for axis in (2, 1, 0):
        after, before = (
            volume.data[np.ix_(*(a + side * (k == axis) for k, a in enumerate(at)))]
            for side in (1, -1)
        )
        slopes.append((after.astype(np.float64) - before) / 2)
    with np.errstate(all="ignore"):
        rise = np.stack(slopes, axis=-1) @ np.linalg.inv(volume.affine[:3, :3])
        steep = np.linalg.norm(rise, axis=-1)
    return bool(np.mean(np.abs(steep - 1) < STEEP) > NEARLY)


def suggested_surface(
    volume: Volume, statistics: Statistics, there: tuple[SceneSurface, ...]
) -> SceneSurface:
    """One more surface for a volume: see-through where it surrounds those that are there."""
    values = tuple(s.surface.isovalue for s in there)
    isovalue = suggested_isovalue(volume, statistics, values)
    outside = any(v > isovalue for v in values)
    color = COLORS[len(there) % len(COLORS)]
    return SceneSurface.at(isovalue, color=color, opacity=BEHIND if outside else 1.0)
