"""What is drawn over the picture: the orientation cube with its letters, and the bounding box."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.model.camera import Camera
from volviz.model.scene import SceneState, box_corners
from volviz.ui import theme
from volviz.ui.im import ImVec2, imgui

# side of the cube: (direction, letter in a patient, letter otherwise, view there, view otherwise)
SIDES: tuple[tuple[tuple[int, int, int], str, str, str, str], ...] = (
    ((1, 0, 0), "L", "+x", "left", "right"),
    ((-1, 0, 0), "R", "−x", "right", "left"),
    ((0, 1, 0), "P", "+y", "posterior", "bottom"),
    ((0, -1, 0), "A", "−y", "anterior", "top"),
    ((0, 0, 1), "S", "+z", "superior", "back"),
    ((0, 0, -1), "I", "−z", "inferior", "front"),
)
AXIS_COLORS = ((0.87, 0.42, 0.4), (0.5, 0.74, 0.42), (0.42, 0.6, 0.9))
CUBE = 24.0
EDGE_ON = 0.12
"""A side that faces the eye less than this (cosine) has its letter beside the cube."""
EDGES = [(a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit]


def cube(scene: SceneState, center: tuple[float, float], scale: float, mouse: Any) -> str | None:
    """Draw the cube; the view of the side under the mouse, if there is one.

    center: screen pixels. mouse: screen position, or None where something else has it.
    """
    draw = imgui.get_window_draw_list()
    patient = scene.volume.info.space is not None
    right, up, back = scene.camera.axes()
    turn = np.stack([right, -up, back])
    size = CUBE * scale
    under: str | None = None
    _draw_shadow(draw, center, size)
    _beside(draw, turn, center, size, patient)
    for direction, letter, plain, view, other in sorted(
        SIDES, key=lambda side: float(np.dot(side[0], back))
    ):
        facing = float(np.dot(direction, back))
        if facing <= 0.02:
            continue
        corners = _face(np.array(direction, float)) @ turn.T
        points = [ImVec2(center[0] + x * size, center[1] + y * size) for x, y, _ in corners]
        hovered = mouse is not None and _inside((mouse.x, mouse.y), points)
        if hovered:
            under = view if patient else other
        axis = int(np.argmax(np.abs(direction)))
        _draw_face(draw, points, facing, hovered, axis)
        middle = turn @ np.array(direction, float) * size
        at = (center[0] + float(middle[0]), center[1] + float(middle[1]))
        _letter(draw, letter if patient else plain, at, facing)
    return under


def box(scene: SceneState, origin: tuple[float, float], size: tuple[float, float]) -> None:
    """The edges of the volume; those behind it are fainter."""
    draw = imgui.get_window_draw_list()
    corners = box_corners(scene.volume)
    placed, depth = projected(scene.camera, corners, size)
    farthest = int(np.argmax(depth))
    for a, b in EDGES:
        if depth[a] <= 0 or depth[b] <= 0:
            continue
        behind = farthest in (a, b)
        ink = theme.packed((0.8, 0.86, 0.95), 0.16 if behind else 0.5)
        start = ImVec2(origin[0] + placed[a, 0], origin[1] + placed[a, 1])
        end = ImVec2(origin[0] + placed[b, 0], origin[1] + placed[b, 1])
        draw.add_line(start, end, ink, 1.0)


def projected(
    camera: Camera, points: NDArray[np.float64], size: tuple[float, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """float64[n, 2] pixels (y down) of world points, and float64[n] mm in front of the camera."""
    eye = points @ camera.view_matrix()[:3, :3].T + camera.view_matrix()[:3, 3]
    far = max(float(-eye[:, 2].min()), camera.distance) * 2 + 1e-9
    matrix = camera.projection_matrix(size[0] / size[1], far * 1e-4, far)
    clip = np.concatenate([eye, np.ones((len(eye), 1))], axis=1) @ matrix.T
    weight = np.where(np.abs(clip[:, 3:]) < 1e-12, 1e-12, clip[:, 3:])
    ndc = clip[:, :2] / weight
    pixels = np.stack([(ndc[:, 0] + 1) / 2 * size[0], (1 - ndc[:, 1]) / 2 * size[1]], axis=1)
    depth = (
        -eye[:, 2]
        if camera.projection == "perspective"
        else np.full(len(eye), 1.0) - (eye[:, 2] - eye[:, 2].max())
    )
    return pixels, depth


def _draw_face(draw: Any, points: list[Any], facing: float, hovered: bool, axis: int) -> None:
    light = 0.16 + 0.24 * facing
    red, green, blue = AXIS_COLORS[axis]
    tinted = (
        light * (0.7 + 0.56 * red),
        light * (0.72 + 0.56 * green),
        light * (0.76 + 0.56 * blue),
    )
    fill = theme.ACCENT["dark"] if hovered else tinted
    draw.add_quad_filled(*points, theme.packed(fill, 0.94))
    draw.add_quad(*points, theme.packed(AXIS_COLORS[axis], 0.9), max(imgui.get_font_size() / 12, 1))


def _draw_shadow(draw: Any, center: tuple[float, float], size: float) -> None:
    """A dark disc, so that cube and letters can be read on any picture."""
    draw.add_circle_filled(ImVec2(*center), size * 2.1, theme.packed((0.03, 0.035, 0.045), 0.35))


def _beside(
    draw: Any,
    turn: NDArray[np.float64],
    center: tuple[float, float],
    size: float,
    patient: bool,
) -> None:
    """The letters of the sides that are seen edge on, around the cube."""
    for direction, letter, plain, *_ in SIDES:
        x, y, depth = turn @ np.array(direction, float)
        if abs(depth) > EDGE_ON:
            continue
        reach = size * 1.65 / max(np.hypot(x, y), 1e-6)
        at = (center[0] + float(x) * reach, center[1] + float(y) * reach)
        _letter(draw, letter if patient else plain, at, 0.42)


def _letter(draw: Any, text: str, at: tuple[float, float], facing: float) -> None:
    extent = imgui.calc_text_size(text)
    ink = theme.packed((0.96, 0.97, 0.98), min(1.0, facing * 1.6))
    draw.add_text(ImVec2(at[0] - extent.x / 2, at[1] - extent.y / 2), ink, text)


def _face(direction: NDArray[np.float64]) -> NDArray[np.float64]:
    """float64[4, 3]: corners of a side of the cube of half side 1, in order around it."""
    across = np.roll(direction, 1)
    over = np.cross(direction, across)
    return np.stack(
        [direction + a * across + b * over for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
    )


def _inside(point: tuple[float, float], corners: list[Any]) -> bool:
    signs = set()
    for a, b in zip(corners, [*corners[1:], corners[0]], strict=True):
        signs.add((b.x - a.x) * (point[1] - a.y) - (b.y - a.y) * (point[0] - a.x) > 0)
    return len(signs) == 1
