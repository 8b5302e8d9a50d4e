"""What commands do that takes more than a call."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from volviz.classify.isovalues import suggested_surface
from volviz.model.knobs import knobs_of
from volviz.model.surface_look import MAX_SURFACES
from volviz.model.views import volume_camera
from volviz.resolve import statistics_at_hand
from volviz.ui import navigate, pick
from volviz.ui.im import imgui

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

ISOMETRIC = (45.0, 35.264389682754654)
"""Azimuth and elevation at which three sides of a cube look alike, degrees."""


def look_from_corner(shell: Shell) -> None:
    """The isometric view: from the front, turned and raised to a corner."""
    scene = shell.app.scene
    if scene is None:
        return
    lens: dict[str, Any] = {
        k.name: getattr(scene.camera, k.name) for k in knobs_of(type(scene.camera))
    }
    name = "anterior" if scene.volume.info.space is not None else "front"
    azimuth, elevation = ISOMETRIC
    camera = volume_camera(
        scene.volume,
        name,
        azimuth=azimuth,
        elevation=elevation,
        aspect=shell.viewport.aspect,
        **lens,
    )
    shell.app.change(scene.with_camera(camera), "View: corner")


def under_mouse(shell: Shell) -> tuple[float, float] | None:
    """Where the mouse is in the view (−1..1, y up), its middle if it is elsewhere; None where
    there is no view."""
    x, y, w, h = shell.place
    if min(w, h) < 1:
        return None
    mouse = imgui.get_mouse_pos()
    at = (2 * (mouse.x - x) / w - 1, 1 - 2 * (mouse.y - y) / h)
    return (0.0, 0.0) if max(map(abs, at)) > 1 else at


def focus(shell: Shell) -> None:
    """Turn about what is under the cursor; about what is in the middle if it is elsewhere."""
    scene, at = shell.app.scene, under_mouse(shell)
    if scene is None or at is None:
        return
    point = pick.hit(scene, at, shell.viewport.aspect, shell.viewport.frames.surfaces)
    if point is not None:
        shell.app.change(scene.with_camera(navigate.focused(scene.camera, point)), "Focus")


def toggle_volume(shell: Shell) -> None:
    """Draw the volume, or only its surfaces."""
    scene = shell.app.scene
    if scene is not None:
        shown = not scene.raycast.show_volume
        label = "Show volume" if shown else "Hide volume"
        shell.app.change(scene.with_raycast(show_volume=shown), label)


def add_surface(shell: Shell) -> None:
    """One more isosurface, and the panel that turns it."""
    scene = shell.app.scene
    if scene is None or len(scene.surfaces) >= MAX_SURFACES:
        return
    facts = statistics_at_hand(scene.volume)
    if facts is None:
        return
    more = suggested_surface(scene.volume, facts, scene.surfaces)
    shell.app.change(scene.with_surfaces((*scene.surfaces, more)), "Add surface")
    shell.show_panel("surfaces", True)
    imgui.set_window_focus("Surfaces###surfaces")
