"""A hierarchy of resolutions, and which of them a picture needs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from volviz.meshes.decimate import decimate
from volviz.meshes.distance import two_sided
from volviz.model.camera import Camera
from volviz.model.mesh import Mesh
from volviz.progress import Progress, silent

FACTOR = 4
"""Triangles of a level against those of the next coarser one."""
LEAST = 500
"""Triangles below which no coarser level is made."""


@dataclass(frozen=True, eq=False)
class Level:
    """One resolution. error: mm to the finest one, two-sided, sampled (`meshes.distance`)."""

    mesh: Mesh
    error: float


def levels_of(
    mesh: Mesh, most: int = 6, *, boundary: str = "simplified", progress: Progress | None = None
) -> tuple[Level, ...]:
    """The mesh and coarser ones, finest first; the errors grow. At most `most` levels.

    Each is decimated from the one before it, to a quarter of its triangles or as far as topology
    and boundary let it, and measured against the first. Raises Cancelled.
    """
    progress = progress or silent()
    levels = [Level(mesh, 0.0)]
    while len(levels) < most and len(levels[-1].mesh.faces) >= FACTOR * LEAST:
        share = progress.part((len(levels) - 1) / most, len(levels) / most)
        last = levels[-1]
        made = decimate(last.mesh, 1 - 1 / FACTOR, boundary=boundary, progress=share.part(0.0, 0.5))
        if len(made.faces) > 0.8 * len(last.mesh.faces):
            break
        error = two_sided(made, mesh, progress=share.part(0.5, 1.0)).hausdorff
        levels.append(Level(made, max(error, last.error)))
    return tuple(levels)


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
