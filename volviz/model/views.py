"""Standard cameras for a volume: named views, and the view that suits it without being asked."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from volviz.errors import UnsupportedError, UsageError
from volviz.model.camera import IMAGE_VIEWS, PATIENT_VIEWS, Camera, standard_view
from volviz.model.scene import box_corners
from volviz.model.volume import Volume

THIN = 0.2
"""A volume whose depth is less than this part of its other sides is looked at face on."""


def volume_camera(
    volume: Volume,
    view: str | None = None,
    *,
    azimuth: float | None = None,
    elevation: float | None = None,
    roll: float = 0.0,
    zoom: float = 1.0,
    aspect: float = 1.0,
    **lens: Any,
) -> Camera:
    """A camera that shows the whole volume.

    view: a name (anterior, left, …; front, top, … where no patient is known), by default the one
    that suits. azimuth, elevation, roll: degrees from there. zoom: 2 shows everything twice as
    large. aspect: width / height of the picture. lens: knobs of `Camera` (projection, fov).
    """
    check_drawable(volume)
    for name, angle in (("azimuth", azimuth), ("elevation", elevation), ("roll", roll)):
        _check_number(name, angle or 0.0, -1e9, 1e9)
    _check_number("zoom", zoom, 1e-6, 1e6)
    _check_number("aspect", aspect, 1e-6, 1e6)
    patient = volume.info.space is not None
    suited, turn, rise = default_view(volume)
    if view is not None:
        suited, turn, rise = view, 0.0, 0.0
    if azimuth is not None or elevation is not None:
        turn, rise = azimuth or 0.0, elevation or 0.0
    camera = standard_view(suited, patient=patient)
    if view is None:
        camera = _face_on(volume, camera)
    camera = camera.orbited(turn, rise)
    if roll:
        camera = camera.rolled(roll)
    camera = replace(camera, **lens).fitted(box_corners(volume), aspect)
    return camera.dollied(zoom) if zoom != 1.0 else camera


def check_drawable(volume: Volume) -> None:
    """Raise UnsupportedError for a grid whose shape or place no camera and no GPU can resolve."""
    sides = np.array(volume.spacing) * volume.dims
    # beyond these, float32 on the way to the picture, or float64 in the camera, has no digits left
    if not sides.min() > 1e-100 or not sides.max() < 1e100:
        what = "the sides of the volume are " + " × ".join(f"{s:.3g}" for s in sides) + " mm"
    elif sides.max() > 1e9 * min(volume.spacing):
        what = f"the volume is {sides.max() / min(volume.spacing):.2g} times as long as a voxel"
    elif np.abs(volume.affine[:3, 3]).max() > 1e9 * sides.max():
        what = "the volume lies more than 1e9 times its own size away from the world's origin"
    else:
        return
    raise UnsupportedError(
        f"{what}: this cannot be drawn",
        file=volume.info.source,
        field="spacing and origin",
        fix="give the true spacing (--spacing X,Y,Z)",
    )


def _check_number(name: str, value: float, low: float, high: float) -> None:
    try:
        fits = low <= float(value) <= high
    except (TypeError, ValueError):
        fits = False
    if not fits:
        raise UsageError(f"{value!r} is not a number from {low:g} to {high:g}", field=f"--{name}")


def default_view(volume: Volume) -> tuple[str, float, float]:
    """Name of the view, azimuth and elevation (degrees) for a volume nobody said anything about.

    A patient is met from the front; images without a space as image viewers show them, turned a
    little so that they look solid; thin stacks face on, whatever they are (`volume_camera` turns
    to the face of those that lie askew), and a picture is a picture.
    """
    patient = volume.info.space is not None
    thin = _thin_axis(volume)
    if thin is None:
        return ("anterior", 0.0, 0.0) if patient else ("front", 25.0, 25.0)
    axis = volume.affine[:3, thin]
    world = int(np.argmax(np.abs(axis)))
    if patient:
        return ("left", "anterior", "inferior")[world], 0.0, 0.0
    turned = 12.0 if volume.dims[thin] > 1 else 0.0
    return ("right", "top", "front")[world], turned, turned


def _thin_axis(volume: Volume) -> int | None:
    """0, 1, 2 for x, y, z: the axis along which there is little; None in a block."""
    sides = np.array(volume.spacing) * np.array(volume.dims)
    thin = int(np.argmin(sides))
    return thin if sides[thin] < THIN * np.delete(sides, thin).min() else None


def _face_on(volume: Volume, camera: Camera) -> Camera:
    """Turned to the face of a thin stack that lies askew, a row or a column of it upright."""
    thin = _thin_axis(volume)
    if thin is None:
        return camera
    _, up, back = camera.axes()
    axes = volume.affine[:3, :3] / np.linalg.norm(volume.affine[:3, :3], axis=0)
    one, other = (axes[:, k] for k in range(3) if k != thin)
    normal = np.cross(one, other)
    normal *= np.sign(normal @ back) / np.linalg.norm(normal)
    if normal @ back > 1 - 1e-9:
        return camera
    upright = max((one, -one, other, -other), key=lambda v: float(v @ up))
    position = np.add(camera.target, camera.distance * normal)
    return replace(camera, position=tuple(position.tolist()), up=tuple(upright.tolist()))


def view_names(volume: Volume) -> tuple[str, ...]:
    """Names of the standard views of a volume."""
    return tuple(PATIENT_VIEWS if volume.info.space is not None else IMAGE_VIEWS)
