"""A hierarchy of resolutions of a surface, and which of them a picture needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import ArrayLike

from volviz.model.camera import Camera
from volviz.model.mesh import Mesh


@dataclass(frozen=True, eq=False)
class Level:
    """One resolution. error: mm to the finest one, two-sided."""

    mesh: Mesh
    error: float


_coarser: WeakKeyDictionary[Mesh, tuple[Level, ...]] = WeakKeyDictionary()


def coarser(mesh: Mesh) -> tuple[Level, ...]:
    """Coarser levels of a mesh, finest first, that someone made; none if nobody did."""
    return _coarser.get(mesh, ())


def keep_coarser(mesh: Mesh, levels: Sequence[Level]) -> None:
    """Remember coarser levels of a mesh for as long as it lives; the mesh is not among them."""
    _coarser[mesh] = tuple(levels)


def pixel_size(camera: Camera, size: tuple[int, int], bounds: ArrayLike) -> float:
    """mm that a pixel spans at the point of a box that is nearest to the camera; 0 if it is in it.

    size: width and height of the picture in pixels. bounds: float[2, 3], low and high corner.
    """
    smaller = min(size)
    if camera.projection != "perspective":
        return camera.height / smaller
    low, high = np.asarray(bounds, dtype=np.float64)
    choice = np.array(np.meshgrid([0, 1], [0, 1], [0, 1])).reshape(3, -1).T
    corners = np.where(choice, high, low)
    _, _, back = camera.axes()
    depth = float(((np.asarray(camera.position) - corners) @ back).min())
    return max(depth, 0.0) * 2 * math.tan(math.radians(camera.fov) / 2) / smaller


def choose(
    levels: Sequence[Level], camera: Camera, size: tuple[int, int], pixels: float = 1.0
) -> int:
    """Index of the coarsest level whose error is at most so many pixels in this picture."""
    allowed = pixels * pixel_size(camera, size, levels[0].mesh.bounds)
    fitting = [i for i, level in enumerate(levels) if level.error <= allowed]
    return max(fitting, default=0)
