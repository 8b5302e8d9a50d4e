"""What a ray hits: where its opacity has gathered to a half. On the processor, for one ray."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volviz.model.camera import Vec3
from volviz.model.scene import SceneState
from volviz.model.transfer import corrected_opacity

MAX_SAMPLES = 8192


def hit(scene: SceneState, at: tuple[float, float], aspect: float) -> Vec3 | None:
    """The world point (mm) that is seen at `at` (−1..1, y up), None for nothing.

    Maximum projections answer with the place of the maximum.
    """
    points, step = along(scene, at, aspect)
    if len(points) == 0:
        return None
    volume = scene.volume
    index = points @ np.linalg.inv(volume.affine)[:3, :3].T + np.linalg.inv(volume.affine)[:3, 3]
    last = np.array(volume.dims) - 1
    x, y, z = np.clip(np.rint(index), 0, last).astype(np.int64).T
    values = volume.data[z, y, x].astype(np.float64)
    if scene.raycast.mode == "mip":
        return _vec(points[int(np.nanargmax(values))]) if np.isfinite(values).any() else None
    finite = np.isfinite(values)
    opacity = np.where(finite, scene.transfer.opacity_at(np.where(finite, values, 0.0)), 0.0)
    through = np.cumprod(1 - corrected_opacity(opacity, step, scene.transfer.unit_distance))
    hidden = np.flatnonzero(through <= 0.5 * (1 + through[-1]))
    return None if through[-1] > 0.95 or len(hidden) == 0 else _vec(points[int(hidden[0])])


def along(
    scene: SceneState, at: tuple[float, float], aspect: float
) -> tuple[NDArray[np.float64], float]:
    """float64[n, 3] world points inside the volume's box along the ray, and their distance."""
    volume = scene.volume
    here = np.array([1.0, *at])
    origin, direction = (m @ here for m in scene.camera.rays(aspect))
    direction = direction / np.linalg.norm(direction)
    to_index = np.linalg.inv(volume.affine)
    start = to_index[:3, :3] @ origin + to_index[:3, 3] + 0.5
    along = to_index[:3, :3] @ direction
    along = np.where(np.abs(along) < 1e-12, 1e-12, along)
    sides = np.stack([-start / along, (np.array(volume.dims) - start) / along])
    near, far = float(sides.min(axis=0).max()), float(sides.max(axis=0).min())
    if scene.camera.projection == "perspective":
        near = max(near, 0.0)
    if far <= near:
        return np.empty((0, 3)), 1.0
    count = min(int((far - near) / (0.5 * min(volume.spacing))) + 1, MAX_SAMPLES)
    step = (far - near) / count
    return origin + direction * (near + (np.arange(count)[:, None] + 0.5) * step), step


def _vec(point: NDArray[np.float64]) -> Vec3:
    x, y, z = (float(v) for v in point)
    return x, y, z
