"""The camera: where from, where to, which way is up, and how it projects. World LPS mm.

`fov` and `height` measure the smaller side of the picture, so that what fits into a square fits
into any picture. Azimuth turns about the vertical axis (positive: the camera moves to its own
right), elevation raises the camera; both start from a standard view.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pyrr import Matrix44, matrix44

from volviz.errors import UsageError, did_you_mean
from volviz.model.knobs import check_knobs, exact, knob

Vec3 = tuple[float, float, float]
PROJECTIONS = ("perspective", "orthographic")

# view name: (from where the camera looks, up), as world directions
PATIENT_VIEWS: dict[str, tuple[Vec3, Vec3]] = {
    "anterior": ((0, -1, 0), (0, 0, 1)),
    "posterior": ((0, 1, 0), (0, 0, 1)),
    "left": ((1, 0, 0), (0, 0, 1)),
    "right": ((-1, 0, 0), (0, 0, 1)),
    "superior": ((0, 0, 1), (0, -1, 0)),
    "inferior": ((0, 0, -1), (0, -1, 0)),
}
# without a patient: pictures as image viewers show them, x to the right, y down, slice 0 in front
IMAGE_VIEWS: dict[str, tuple[Vec3, Vec3]] = {
    "front": ((0, 0, -1), (0, -1, 0)),
    "back": ((0, 0, 1), (0, -1, 0)),
    "left": ((-1, 0, 0), (0, -1, 0)),
    "right": ((1, 0, 0), (0, -1, 0)),
    "top": ((0, -1, 0), (0, 0, 1)),
    "bottom": ((0, 1, 0), (0, 0, -1)),
}
VIEWS: dict[str, tuple[Vec3, Vec3]] = {**IMAGE_VIEWS, **PATIENT_VIEWS}


@dataclass(frozen=True)
class Camera:
    """position, target: world mm. up: any direction not along the view. height: mm across the
    smaller side of the picture, for the orthographic projection."""

    position: Vec3 = exact("where the camera is: x,y,z in world mm")
    target: Vec3 = exact("what the camera looks at: x,y,z in world mm", (0.0, 0.0, 0.0))
    up: Vec3 = exact("which direction is up in the picture: x,y,z", (0.0, 0.0, 1.0))
    projection: str = knob("perspective", "how the picture is projected", choices=PROJECTIONS)
    fov: float = knob(
        30.0, "angle of view across the smaller side of the picture", low=1, high=150, unit="°"
    )
    height: float = exact("mm across the smaller side of an orthographic picture", 1.0)

    def __post_init__(self) -> None:
        check_knobs(self)
        for name in ("position", "target", "up"):
            try:
                vector = tuple(float(x) for x in getattr(self, name))
            except (TypeError, ValueError):
                vector = ()
            if len(vector) != 3 or not all(math.isfinite(x) for x in vector):
                raise UsageError("must be three finite numbers", field=f"camera.{name}")
            object.__setattr__(self, name, vector)
        if not (math.isfinite(self.height) and self.height > 0):
            raise UsageError("must be a length in mm greater than 0", field="camera.height")
        if self.position == self.target:
            raise UsageError("position and target are the same point", field="camera.position")

    @property
    def distance(self) -> float:
        """mm from position to target."""
        return float(np.linalg.norm(np.subtract(self.position, self.target)))

    def axes(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """World unit vectors: right, up and back (against the view)."""
        back = _unit(np.subtract(self.position, self.target))
        right = np.cross(_unit(self.up), back)
        if np.linalg.norm(right) < 1e-9:  # up along the view: any other axis will do
            right = np.cross(np.eye(3)[int(np.argmin(np.abs(back)))], back)
        right = _unit(right)
        return right, np.cross(back, right), back

    def view_matrix(self) -> NDArray[np.float64]:
        """float64[4, 4], world to eye, for column vectors."""
        right, up, back = self.axes()
        matrix = np.eye(4)
        matrix[:3, :3] = (right, up, back)
        matrix[:3, 3] = -matrix[:3, :3] @ np.array(self.position)
        return matrix

    def projection_matrix(self, aspect: float, near: float, far: float) -> NDArray[np.float64]:
        """float64[4, 4], eye to clip (OpenGL), for column vectors. aspect: width / height."""
        x, y = self.half(aspect)
        if self.projection == "perspective":
            box = matrix44.create_perspective_projection_from_bounds
            return np.array(Matrix44(box(-x * near, x * near, -y * near, y * near, near, far))).T
        box = matrix44.create_orthogonal_projection
        return np.array(Matrix44(box(-x, x, -y, y, near, far))).T

    def rays(self, aspect: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Origin and direction of the ray at (x, y) in −1..1: float64[3, 3] each.

        Columns are for 1, x, y: origin(x, y) = O @ (1, x, y), direction likewise, world mm;
        directions are not normalised.
        """
        right, up, back = self.axes()
        x, y = self.half(aspect)
        across = np.stack([np.zeros(3), right * x, up * y], axis=1)
        base = np.zeros((3, 3))
        if self.projection == "perspective":
            base[:, 0] = -back
            origin = np.zeros((3, 3))
            origin[:, 0] = self.position
            return origin, base + across
        origin = across.copy()
        origin[:, 0] = self.position
        base[:, 0] = -back
        return origin, base

    def half(self, aspect: float) -> tuple[float, float]:
        """Half of the picture, across and up: at distance 1, or in mm where it is orthographic."""
        half = (
            math.tan(math.radians(self.fov) / 2)
            if self.projection == "perspective"
            else self.height / 2
        )
        return half * max(aspect, 1.0), half * max(1 / aspect, 1.0)

    def orbited(self, azimuth: float, elevation: float = 0.0) -> Camera:
        """Turned about the target, degrees. Poles are passed: up tips over with the camera."""
        right, _, _ = self.axes()
        axis = _unit(self.up)
        spin = _rotation(axis, azimuth)
        tilt = _rotation(spin @ right, -elevation)
        turn = tilt @ spin
        offset = turn @ np.subtract(self.position, self.target)
        up = tilt @ axis
        return replace(self, position=_vec(np.add(self.target, offset)), up=_vec(up))

    def rolled(self, angle: float) -> Camera:
        """Turned about the line of view, degrees; positive: the picture turns clockwise."""
        _, up, back = self.axes()
        return replace(self, up=_vec(_rotation(back, angle) @ up))

    def panned(self, right: float, up: float) -> Camera:
        """Moved along its own axes, mm, target too."""
        x, y, _ = self.axes()
        move = x * right + y * up
        return replace(
            self,
            position=_vec(np.add(self.position, move)),
            target=_vec(np.add(self.target, move)),
        )

    def dollied(self, factor: float) -> Camera:
        """Nearer (factor > 1) or farther by that factor; the orthographic height follows."""
        offset = np.subtract(self.position, self.target) / factor
        return replace(
            self, position=_vec(np.add(self.target, offset)), height=self.height / factor
        )

    def fitted(self, corners: ArrayLike, aspect: float = 1.0, margin: float = 1.04) -> Camera:
        """Same direction, at the least distance that shows all corners (float[n, 3], world mm).

        The target moves to the middle of what is seen; margin: 1.04 leaves 2 % on each side.
        """
        points = np.asarray(corners, dtype=np.float64)
        axes = np.stack(self.axes(), axis=1)
        local = points @ axes
        middle = (local.min(axis=0) + local.max(axis=0)) / 2
        size = max(float(np.ptp(local, axis=0).max()), 1e-300)
        wide = np.array([max(aspect, 1.0), max(1 / aspect, 1.0)]) / margin
        height = float(max((2 * np.abs((local - middle)[:, :2]) / wide).max(), size * 1e-6))
        slope = math.tan(math.radians(self.fov) / 2) * wide
        near = float(local[:, 2].max()) + size * 1e-3
        distance = size
        for _ in range(8 if self.projection == "perspective" else 1):
            off = local - middle
            # each corner asks for a distance at which it is just inside the frustum
            distance = float((np.abs(off[:, :2]) / slope + off[:, 2:3]).max())
            distance = max(distance, near - middle[2])
            seen = off[:, :2] / np.maximum(distance - off[:, 2:3], size * 1e-9)
            shift = (seen.min(axis=0) + seen.max(axis=0)) / 2 * distance
            if self.projection == "perspective":
                middle = middle + np.append(shift, 0.0)
        target = axes @ middle
        return replace(
            self,
            position=_vec(target + axes[:, 2] * distance),
            target=_vec(target),
            height=height,
        )


def standard_view(
    name: str, azimuth: float = 0.0, elevation: float = 0.0, *, patient: bool = True
) -> Camera:
    """A camera at distance 1 from the origin in a named view, turned by so many degrees."""
    table = {**VIEWS, **(PATIENT_VIEWS if patient else IMAGE_VIEWS)}
    if name not in table:
        near = did_you_mean(str(name), table)
        raise UsageError(f"unknown view '{name}'", field="--view", fix=near)
    direction, up = table[name]
    camera = Camera(position=_vec(direction), up=_vec(up))
    return camera.orbited(azimuth, elevation)


def _rotation(axis: NDArray[np.float64], degrees: float) -> NDArray[np.float64]:
    """Rodrigues: right-handed rotation about a unit axis, float64[3, 3]."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = math.radians(degrees)
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def _unit(vector: ArrayLike) -> NDArray[np.float64]:
    v = np.asarray(vector, dtype=np.float64)
    v = v / max(float(np.abs(v).max()), 1e-300)  # first to a safe size: 1e-200 squared is 0
    return v / max(float(np.linalg.norm(v)), 1e-300)


def _vec(vector: Sequence[float] | NDArray[np.float64]) -> Vec3:
    x, y, z = (float(v) for v in vector)
    return x, y, z
