"""The lens in the window: its circle, dragging it over the surfaces, and its part of a panel."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from volviz.model.camera import Camera, Vec3
from volviz.model.lens import Lens, reach
from volviz.model.scene import SceneState, box_corners
from volviz.ui import actions, edit, overlay, pick, theme, widgets
from volviz.ui.im import ImVec2, imgui

if TYPE_CHECKING:
    from volviz.resolve_surfaces import Extracted
    from volviz.ui.shell import Shell

GRIP = 0.9
"""Font sizes round the middle within which the lens is taken hold of."""
LABEL, KEY = "Lens", "lens"
TEXT = (
    "Full resolution round a focus only, coarser away from it, and only what this camera sees: "
    "fewer triangles (L). Drag the middle of the circle, or Alt+drag anywhere; Alt+wheel: its size."
)
KNOBS = ("lens_radius", "lens_growth", "lens_pixels")


def shown(scene: SceneState) -> bool:
    """True if there is a lens to be seen."""
    return scene.lens.lens and any(s.look.visible for s in scene.surfaces)


def surface_at(scene: SceneState, at: tuple[float, float], aspect: float) -> Vec3 | None:
    """The world point (mm) of the first visible surface at `at` (−1..1, y up), None for none."""
    points, _ = pick.along(scene, at, aspect)
    if len(points) == 0:
        return None
    inverse = np.linalg.inv(scene.volume.affine)
    index = points @ inverse[:3, :3].T + inverse[:3, 3]
    last = np.array(scene.volume.dims) - 1
    x, y, z = np.clip(np.rint(index), 0, last).astype(np.int64).T
    values = scene.volume.data[z, y, x]
    first = len(points)
    for surface in (s.surface for s in scene.surfaces if s.look.visible):
        inside = values >= surface.isovalue
        crossed = np.flatnonzero(inside[1:] != inside[:-1])
        if len(crossed):
            first = min(first, int(crossed[0]))
    return None if first == len(points) else _vec(points[first])


def moved(scene: SceneState, at: tuple[float, float], aspect: float) -> SceneState:
    """The scene with its focus on the surface there; beside it, as far away as it was."""
    focus = surface_at(scene, at, aspect)
    if focus is None:
        here = np.array([1.0, *at])
        origin, direction = (m @ here for m in scene.camera.rays(aspect))
        _, _, back = scene.camera.axes()
        part = (np.array(scene.lens.focus) - origin) @ back / (direction @ back)
        focus = _vec(origin + part * direction) if part > 0 else scene.lens.focus
    return replace(scene, lens=_at(scene.lens, focus))


def turned(scene: SceneState, at: tuple[float, float], aspect: float) -> SceneState:
    """The lens on, with its focus there or, if nothing is there, in the middle of the volume; or
    off."""
    if scene.lens.lens:
        return replace(scene, lens=replace(scene.lens, lens=False))
    focus = surface_at(scene, at, aspect) or _vec(box_corners(scene.volume).mean(axis=0))
    return replace(scene, lens=replace(_at(scene.lens, focus), lens=True))


def toggle(shell: Shell) -> None:
    """The command: on under the cursor, or in the middle of the view if it is elsewhere."""
    scene, at = shell.app.scene, actions.under_mouse(shell)
    if scene is None or at is None:
        return
    shell.app.change(turned(scene, at, shell.viewport.aspect), LABEL)


class LensTool:
    """The mouse on the lens of one view. dragging: it is held."""

    def __init__(self) -> None:
        self.dragging = False

    def mouse(
        self, scene: SceneState, at: tuple[float, float], corner: Any, extent: Any
    ) -> SceneState | None:
        """The changed scene, the same one while the mouse is the lens's, None if it is not.

        Called for the item that the view is, which ImGui has just seen.
        """
        if not shown(scene):
            self.dragging = False
            return None
        io, aspect = imgui.get_io(), extent.x / extent.y
        if imgui.is_item_hovered() and io.key_alt and io.mouse_wheel:
            radius = min(max(scene.lens.lens_radius, 0.005) * 1.1**io.mouse_wheel, 1.0)
            return replace(scene, lens=edit.changed(scene.lens, lens_radius=radius))
        if imgui.is_item_activated() and imgui.is_mouse_down(0):
            self.dragging = io.key_alt or self.over(scene, corner, extent)
        if not imgui.is_item_active():
            self.dragging = False
        if not self.dragging:
            return None
        dragged = io.mouse_delta.x or io.mouse_delta.y or imgui.is_item_activated()
        return moved(scene, at, aspect) if dragged else scene

    def over(self, scene: SceneState, corner: Any, extent: Any) -> bool:
        """True if the mouse is on the middle of the lens."""
        place = _circle(scene.camera, scene, (extent.x, extent.y))
        if place is None:
            return False
        x, y, _ = place
        mouse = imgui.get_mouse_pos()
        return bool(np.hypot(mouse.x - corner.x - x, mouse.y - corner.y - y) < widgets.em(GRIP))

    def draw(self, scene: SceneState, corner: Any, extent: Any) -> None:
        """The circle within which the resolution is full, and the grip in its middle."""
        place = _circle(scene.camera, scene, (extent.x, extent.y)) if shown(scene) else None
        if place is None:
            return
        x, y, radius = place
        draw, middle = imgui.get_window_draw_list(), ImVec2(corner.x + x, corner.y + y)
        hot = self.dragging or (imgui.is_item_hovered() and self.over(scene, corner, extent))
        accent = theme.ACCENT["dark"] if hot else (0.96, 0.97, 0.98)
        dark, thick = theme.packed((0.03, 0.035, 0.045), 0.55), max(widgets.em(0.1), 1.5)
        grip = widgets.em(0.32)
        for ink, width in ((dark, 2 * thick), (theme.packed(accent, 0.95), thick)):
            if radius > 1.5 * grip:
                draw.add_circle(middle, radius, ink, 96, width)
            draw.add_circle(middle, grip, ink, 24, width)
        if hot:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_all)


def section(scene: SceneState, aspect: float) -> SceneState:
    """The lens among the surfaces: on or off, and its knobs while it is on."""
    on = widgets.toggle("lens.lens", "Lens", TEXT, scene.lens.lens)
    if on != scene.lens.lens:
        return turned(scene, (0.0, 0.0), aspect)
    if not on:
        return scene
    lens = edit.knob_rows(scene.lens, "lens", KNOBS)
    return scene if lens is scene.lens else replace(scene, lens=lens)


def spared(found: Extracted | None) -> str:
    """What a surface under the lens was spared; "" for others."""
    if found is None or found.culled is None:
        return ""
    culled = found.culled
    total = culled.made + culled.outside + culled.hidden
    parts = [f"{culled.made:,} of {total:,} blocks made"]
    if culled.again:
        parts[0] += f" ({culled.again:,} taken over from the last picture)"
    if culled.outside:
        parts.append(f"{culled.outside:,} outside the view")
    if culled.hidden:
        parts.append(f"{culled.hidden:,} hidden")
    return "Lens: " + ", ".join(parts)


def _circle(
    camera: Camera, scene: SceneState, size: tuple[float, float]
) -> tuple[float, float, float] | None:
    """Pixels of the focus in the view, x and y down, and of the radius; None behind the camera."""
    diagonal = float(np.linalg.norm(np.multiply(scene.volume.spacing, scene.volume.dims)))
    focus, radius = np.array(scene.lens.focus), reach(diagonal, scene.lens)
    right, _, _ = camera.axes()
    placed, depth = overlay.projected(camera, np.stack([focus, focus + radius * right]), size)
    if depth.min() <= 0:
        return None
    return float(placed[0, 0]), float(placed[0, 1]), float(np.linalg.norm(placed[1] - placed[0]))


def _at(lens: Lens, focus: Vec3) -> Lens:
    # a hundredth of a micrometre is enough, and short in a command line
    x, y, z = (float(f"{v:.7g}") for v in focus)
    return replace(lens, lens_x=x, lens_y=y, lens_z=z)


def _vec(point: Any) -> Vec3:
    x, y, z = (float(v) for v in point)
    return x, y, z
