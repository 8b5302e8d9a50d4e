"""Mouse to camera, as VTK's trackball does it: left rotates, middle or shift+left pans, wheel and
right dolly, ctrl+left rolls; a turntable keeps the vertical upright. Camera in, Camera out."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from volviz.model.camera import Camera, Vec3

DEGREES_ACROSS = 180.0
"""Turn for a drag across the smaller side of the picture."""


def rotated(camera: Camera, dx: float, dy: float, size: tuple[int, int]) -> Camera:
    """Drag by (dx, dy) pixels, y down: the object follows the mouse."""
    scale = DEGREES_ACROSS / min(size)
    return camera.orbited(-dx * scale, dy * scale)


def panned(camera: Camera, dx: float, dy: float, size: tuple[int, int]) -> Camera:
    """What is at the target's distance stays under the mouse."""
    height = camera.height
    if camera.projection == "perspective":
        height = 2 * camera.distance * math.tan(math.radians(camera.fov) / 2)
    scale = height / min(size)
    return camera.panned(-dx * scale, dy * scale)


def dollied(camera: Camera, clicks: float) -> Camera:
    """Wheel clicks, forward is nearer."""
    return camera.dollied(1.1**clicks)


def rolled(camera: Camera, dx: float, size: tuple[int, int]) -> Camera:
    """Drag sideways to roll."""
    return camera.rolled(dx * DEGREES_ACROSS / min(size))


def turned(camera: Camera, dx: float, dy: float, size: tuple[int, int], up: Vec3) -> Camera:
    """Turntable: about the world's `up` sideways, and no farther than the poles."""
    scale = DEGREES_ACROSS / min(size)
    _, _, back = camera.axes()
    height = math.degrees(math.asin(float(np.clip(np.dot(back, up), -1.0, 1.0))))
    rise = min(max(height + dy * scale, -89.0), 89.0) - height
    upright = replace(camera, up=up) if abs(height) < 89.9 else camera
    return replace(upright.orbited(-dx * scale, rise), up=up)


def dollied_to(camera: Camera, clicks: float, at: tuple[float, float], aspect: float) -> Camera:
    """Wheel clicks; what is under the cursor at the target's distance stays there.

    at: the cursor in −1..1, y up. aspect: width / height of the view.
    """
    factor = 1.1**clicks
    here = np.array([1.0, *at])
    origin, direction = camera.rays(aspect)
    fixed = origin @ here + (direction @ here) * camera.distance
    position, target = (
        fixed + (np.array(p) - fixed) / factor for p in (camera.position, camera.target)
    )
    return replace(
        camera, position=_vec(position), target=_vec(target), height=camera.height / factor
    )


def projected(camera: Camera, projection: str) -> Camera:
    """The other projection; what is at the target's distance keeps its size."""
    slope = 2 * math.tan(math.radians(camera.fov) / 2)
    if projection == camera.projection:
        return camera
    if projection == "orthographic":
        return replace(camera, projection=projection, height=slope * camera.distance)
    offset = np.subtract(camera.position, camera.target)
    position = np.array(camera.target) + offset / camera.distance * (camera.height / slope)
    return replace(camera, projection=projection, position=_vec(position))


def focused(camera: Camera, point: Vec3) -> Camera:
    """The target moves to the point and the camera along with it."""
    move = np.subtract(point, camera.target)
    return replace(camera, position=_vec(np.add(camera.position, move)), target=point)


def _vec(vector: np.ndarray) -> Vec3:
    x, y, z = (float(v) for v in vector)
    return x, y, z
