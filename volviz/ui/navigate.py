"""Mouse to camera, as VTK's trackball does it: left rotates, middle or shift+left pans, wheel and
right dolly, ctrl+left rolls. Pure functions: Camera in, Camera out."""

from __future__ import annotations

import math

from volviz.model.camera import Camera

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
