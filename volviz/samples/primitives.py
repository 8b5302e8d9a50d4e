"""Sphere and torus as signed distance: the surface at any isovalue is known, and how it curves.

Values are the way to the surface in mm, positive inside. So the isovalue v of the sphere is the
sphere of the radius `RADIUS` − v, that of the torus has a tube of the radius `TUBE` − v.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.samples.closed_form import Field, Floats, Function, sampled

RADIUS = 40.0
RING, TUBE = 36.0, 14.0
"""Radius of the torus' middle line, in the plane z = 0, and of its tube."""
HALF = 60.0
"""The box: |x|, |y|, |z| ≤ 60 mm."""


def sphere(size: int | None, seed: int, progress: Progress) -> Volume:
    """float32[z, y, x] mm; `size` samples along each axis (64). Nothing in it is random."""
    del seed
    return _volume("sphere", sphere_truth(), size, progress)


def torus(size: int | None, seed: int, progress: Progress) -> Volume:
    """float32[z, y, x] mm; `size` samples along each axis (64). Nothing in it is random."""
    del seed
    return _volume("torus", torus_truth(), size, progress)


def _volume(name: str, function: Function, size: int | None, progress: Progress) -> Volume:
    count = 64 if size is None else size
    axis = np.linspace(-HALF, HALF, count)
    data = sampled(function, (axis, axis, axis), progress)
    step = 2 * HALF / (count - 1)
    return Volume.from_array(data, (step,) * 3, (-HALF,) * 3, name=name, value_unit="mm")


def sphere_truth(size: int | None = None) -> Function:
    """The distance (x, y, z) → mm."""
    del size

    def distance(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Floats:
        return np.asarray(RADIUS - np.hypot(np.hypot(x, y), z))

    return distance


def torus_truth(size: int | None = None) -> Function:
    """The distance (x, y, z) → mm."""
    del size

    def distance(x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Floats:
        return np.asarray(TUBE - np.hypot(np.hypot(x, y) - RING, z))

    return distance


def sphere_field(volume: Volume) -> Field:
    """The distance and its gradient."""
    del volume

    def field(points: Floats) -> tuple[Floats, Floats]:
        length = np.linalg.norm(points, axis=1)
        return RADIUS - length, -points / np.maximum(length, 1e-300)[:, None]

    return field


def torus_field(volume: Volume) -> Field:
    """The distance and its gradient."""
    del volume

    def field(points: Floats) -> tuple[Floats, Floats]:
        away = points.copy()
        flat = np.maximum(np.hypot(points[:, 0], points[:, 1]), 1e-300)
        away[:, :2] *= (1 - RING / flat)[:, None]
        length = np.linalg.norm(away, axis=1)
        return TUBE - length, -away / np.maximum(length, 1e-300)[:, None]

    return field
