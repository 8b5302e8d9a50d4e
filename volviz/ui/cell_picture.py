"""A small picture of one cell and the surface in it, seen from beside where the camera stands."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from volviz.model.camera import Camera
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.ui import edit, painting, theme, tips, widgets
from volviz.ui.im import ImVec2, imgui

FRONT, BACK = (0.93, 0.85, 0.66), (0.45, 0.62, 0.85)
BESIDE = (24.0, 18.0)
"""Degrees to the side and up: along an axis a cell would be no more than a square."""
EDGES = [(a, a | bit) for a in range(8) for bit in (1, 2, 4) if not a & bit]


class View(NamedTuple):
    """Which cell of a volume, by its least sample, at which isovalue, seen by which camera."""

    volume: Volume
    camera: Camera
    start: tuple[int, int, int]
    isovalue: float


def draw(
    id_: str, view: View, mesh: Mesh, rule: str, *, note: str, side: float, active: bool
) -> bool:
    """Draw it where the cursor is; True when clicked. note: below the rule's name."""
    text = imgui.get_text_line_height()
    side = max(side, widgets.em(2))
    clicked = bool(imgui.invisible_button(f"###{id_}", ImVec2(side, side + 2.2 * text)))
    low, hovered = imgui.get_item_rect_min(), imgui.is_item_hovered()
    title = edit.choice_title(rule)
    tips.tip(id_, f"What the rule {rule} makes of this cell. Click: use it for the whole surface.")
    canvas = imgui.get_window_draw_list()
    high = ImVec2(low.x + side, low.y + side)
    rounding = imgui.get_style().frame_rounding
    role = imgui.Col_.frame_bg_hovered if hovered else imgui.Col_.frame_bg
    canvas.add_rect_filled(low, high, imgui.get_color_u32(role), rounding)
    middle = ImVec2(low.x + side / 2, low.y + side / 2)
    _cell(view, mesh, middle, side)
    if active:
        accent = theme.packed(theme.ACCENT[theme.name()])
        canvas.add_rect(low, high, accent, rounding, max(widgets.em(0.12), 1.5))
    canvas.push_clip_rect(low, ImVec2(high.x, high.y + 2.2 * text), True)
    ink = imgui.get_color_u32(imgui.Col_.text)
    canvas.add_text(ImVec2(low.x, high.y + 0.1 * text), ink, title)
    if note:
        level = theme.packed(theme.LEVELS["warning"][theme.name()])
        paint = level if note == "differs" else imgui.get_color_u32(imgui.Col_.text_disabled)
        canvas.add_text(ImVec2(low.x, high.y + 1.1 * text), paint, note)
    canvas.pop_clip_rect()
    return clicked


def projected(view: View, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """float64[n, 3]: world points about the middle of the cell: right, down, towards the viewer,
    so that the whole cell lies within −½..½."""
    affine = view.volume.affine
    middle = affine[:3, :3] @ (np.array(view.start) + 0.5) + affine[:3, 3]
    turn = np.stack(view.camera.orbited(*BESIDE).axes()) * np.array([[1.0], [-1.0], [1.0]])
    corners = (_corners() - 0.5) @ affine[:3, :3].T
    reach = 2.3 * float(np.linalg.norm(corners, axis=1).max())
    return np.asarray((points - middle) @ turn.T / reach)


def _corners() -> NDArray[np.float64]:
    return np.array([(c & 1, c >> 1 & 1, c >> 2 & 1) for c in range(8)], dtype=np.float64)


def _cell(view: View, mesh: Mesh, middle: ImVec2, side: float) -> None:
    """Edges behind, triangles from back to front, edges and corners before."""
    affine = view.volume.affine
    world = (np.array(view.start) + _corners()) @ affine[:3, :3].T + affine[:3, 3]
    corners = projected(view, world)
    hidden = int(np.argmin(corners[:, 2]))
    places = [ImVec2(middle.x + side * x, middle.y + side * y) for x, y, _ in corners.tolist()]
    canvas = imgui.get_window_draw_list()
    faint, ink = (imgui.get_color_u32(imgui.Col_.text, a) for a in (0.3, 0.8))
    for a, b in EDGES:
        if hidden in (a, b):
            canvas.add_line(places[a], places[b], faint, 1.0)
    _triangles(view, mesh, middle, side)
    for a, b in EDGES:
        if hidden not in (a, b):
            canvas.add_line(places[a], places[b], ink, max(widgets.em(0.07), 1.0))
    x, y, z = view.start
    values = view.volume.data[z : z + 2, y : y + 2, x : x + 2].reshape(-1)
    radius = max(0.03 * side, 2.0)
    ground = imgui.get_color_u32(imgui.Col_.window_bg)
    for place, value in zip(places, values.tolist(), strict=True):
        canvas.add_circle_filled(place, radius, ink if value >= view.isovalue else ground)
        canvas.add_circle(place, radius, ink, 0, max(widgets.em(0.07), 1.0))


def _triangles(view: View, mesh: Mesh, middle: ImVec2, side: float) -> None:
    points = projected(view, mesh.vertices.astype(np.float64))
    triangles = points[mesh.faces]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    length = np.maximum(np.linalg.norm(normals, axis=1), 1e-12)
    # y points down, which turns the winding round: the viewer sees the front of negative ones
    facing = -normals[:, 2] / length
    shade = (0.45 + 0.55 * np.abs(facing))[:, None]
    colors = np.where(facing[:, None] >= 0, FRONT, BACK) * shade
    fill, line = painting.packed(colors, 0.92), painting.packed(colors * 0.5, 0.9)
    canvas = imgui.get_window_draw_list()
    for i in np.argsort(triangles[:, :, 2].mean(axis=1)).tolist():
        a, b, c = (
            ImVec2(middle.x + side * x, middle.y + side * y) for x, y, _ in triangles[i].tolist()
        )
        canvas.add_triangle_filled(a, b, c, int(fill[i]))
        canvas.add_triangle(a, b, c, int(line[i]), 1.0)
