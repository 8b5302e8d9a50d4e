"""What a ray hits: where its opacity has gathered to a half. On the processor, for one ray."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from volviz.meshes.ray import crossings
from volviz.model.camera import Vec3
from volviz.model.mesh import Mesh
from volviz.model.scene import SceneState
from volviz.model.transfer import corrected_opacity
from volviz.resolve_surfaces import Extracted

MAX_SAMPLES = 8192
CLEAR = 0.05
"""Opacity of a whole ray that hits nothing."""
TWICE = 1e-4
"""Of the way: crossings nearer to each other are one, on an edge of two triangles."""

Floats = NDArray[np.float64]


def hit(
    scene: SceneState,
    at: tuple[float, float],
    aspect: float,
    surfaces: Sequence[Extracted | None] = (),
) -> Vec3 | None:
    """The world point (mm) that is seen at `at` (−1..1, y up), None for nothing.

    surfaces: the meshes of the scene's, those that are there. Maximum projections answer with the
    place of the maximum, unless a surface hides it.
    """
    origin, direction, near = _ray(scene, at, aspect)
    places, opacities = _surfaces(scene, surfaces, origin, direction, near)
    end = float(places[opacities >= 1.0].min(initial=np.inf))
    ways, step = _along(scene, origin, direction, near)
    ways = ways[ways < end]
    if scene.raycast.show_volume and scene.raycast.mode == "mip":
        ways, opacity = _maximum(scene, origin + ways[:, None] * direction, ways)
    elif scene.raycast.show_volume:
        opacity = _opacity(scene, origin + ways[:, None] * direction, step)
    else:
        ways, opacity = ways[:0], np.empty(0)
    ways, opacity = np.concatenate([places, ways]), np.concatenate([opacities, opacity])
    order = np.argsort(ways, kind="stable")
    ways, through = ways[order], np.cumprod(1 - opacity[order])
    if not len(ways) or through[-1] > 1 - CLEAR:
        return None
    first = int(np.argmax(through <= 0.5 * (1 + through[-1])))
    return _vec(origin + ways[first] * direction)


def along(scene: SceneState, at: tuple[float, float], aspect: float) -> tuple[Floats, float]:
    """float64[n, 3] world points inside the volume's box along the ray, and their distance."""
    origin, direction, near = _ray(scene, at, aspect)
    ways, step = _along(scene, origin, direction, near)
    return origin + ways[:, None] * direction, step


def _ray(scene: SceneState, at: tuple[float, float], aspect: float) -> tuple[Floats, Floats, float]:
    """Where the ray through a place of the picture begins, its direction, and its nearest way."""
    origin, direction = (m @ np.array([1.0, *at]) for m in scene.camera.rays(aspect))
    near = 0.0 if scene.camera.projection == "perspective" else -np.inf
    return origin, direction / np.linalg.norm(direction), near


def _surfaces(
    scene: SceneState,
    found: Sequence[Extracted | None],
    origin: Floats,
    direction: Floats,
    near: float,
) -> tuple[Floats, Floats]:
    """Where the ray meets triangles, and the opacity there."""
    places, opacities = [np.empty(0)], [np.empty(0)]
    for wanted, answer in zip(scene.surfaces, found, strict=False):
        if answer is None or not wanted.look.visible or wanted.look.opacity <= 0.0:
            continue
        if len(answer.mesh.faces):
            met = crossings(answer.mesh, origin, direction)
        else:
            met = _points(answer.mesh, origin, direction, min(scene.volume.spacing))
        met = met[met > near]
        if len(met):
            apart = np.diff(met, prepend=-np.inf) > TWICE * max(float(np.abs(met).max()), 1e-9)
            met = met[apart]
        places.append(met)
        opacities.append(np.full(len(met), wanted.look.opacity))
    return np.concatenate(places), np.concatenate(opacities)


def _points(mesh: Mesh, origin: Floats, direction: Floats, reach: float) -> Floats:
    """Ways to the points of a mesh that the ray passes within reach."""
    off = mesh.vertices.astype(np.float64) - origin
    ways = off @ direction
    return np.sort(ways[(off**2).sum(axis=1) - ways**2 < reach**2])


def _values(scene: SceneState, points: Floats) -> Floats:
    """The nearest samples' values."""
    inverse = np.linalg.inv(scene.volume.affine)
    index = points @ inverse[:3, :3].T + inverse[:3, 3]
    last = np.array(scene.volume.dims) - 1
    x, y, z = np.clip(np.rint(index), 0, last).astype(np.int64).T
    return np.asarray(scene.volume.data[z, y, x], np.float64)


def _maximum(scene: SceneState, points: Floats, ways: Floats) -> tuple[Floats, Floats]:
    """The place of the greatest value, which is all that is seen."""
    values = _values(scene, points)
    if not np.isfinite(values).any():
        return ways[:0], np.empty(0)
    return ways[[int(np.nanargmax(np.where(np.isfinite(values), values, np.nan)))]], np.ones(1)


def _opacity(scene: SceneState, points: Floats, step: float) -> Floats:
    values = _values(scene, points)
    finite = np.isfinite(values)
    opacity = np.where(finite, scene.transfer.opacity_at(np.where(finite, values, 0.0)), 0.0)
    return np.asarray(corrected_opacity(opacity, step, scene.transfer.unit_distance))


def _along(
    scene: SceneState, origin: Floats, direction: Floats, near: float
) -> tuple[Floats, float]:
    """float64[n] ways along the ray inside the volume's box, mm, and their distance."""
    volume = scene.volume
    to_index = np.linalg.inv(volume.affine)
    start = to_index[:3, :3] @ origin + to_index[:3, 3] + 0.5
    along = to_index[:3, :3] @ direction
    along = np.where(np.abs(along) < 1e-12, 1e-12, along)
    sides = np.stack([-start / along, (np.array(volume.dims) - start) / along])
    first, last = float(sides.min(axis=0).max()), float(sides.max(axis=0).min())
    first = max(first, near)
    if last <= first:
        return np.empty(0), 1.0
    count = min(int((last - first) / (0.5 * min(volume.spacing))) + 1, MAX_SAMPLES)
    step = (last - first) / count
    return np.asarray(first + (np.arange(count) + 0.5) * step, np.float64), step


def _vec(point: Floats) -> Vec3:
    x, y, z = (float(v) for v in point)
    return x, y, z
