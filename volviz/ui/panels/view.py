"""View: standard views, bookmarks, and the camera's numbers."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from volviz.model.camera import Camera
from volviz.model.scene import SceneState, box_corners
from volviz.model.views import view_names, volume_camera
from volviz.model.volume import VolumeInfo
from volviz.ui import bookmarks, edit, lengths, widgets
from volviz.ui.facts import Facts
from volviz.ui.im import imgui

Vec3 = tuple[float, float, float]
WIDEST = ("Field of view",)
"""The longest label: all forms stand in line."""
NARROW = 17
"""Font sizes of width below which the views stand in two columns instead of three."""


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """Where the picture is seen from."""
    imgui.separator_text("Standard views")
    camera = _standard_views(scene, facts)
    imgui.separator_text("Bookmarks")
    kept = bookmarks.section(scene, facts)
    if kept is not scene:
        return kept
    imgui.separator_text("Camera")
    camera = edit.knob_rows(camera, "camera", ["fov"], beside=WIDEST)
    camera = _numbers(camera, scene.volume.info)
    return scene if camera == scene.camera else replace(scene, camera=camera)


def _standard_views(scene: SceneState, facts: Facts) -> Camera:
    camera = scene.camera
    lens: dict[str, Any] = {"projection": camera.projection, "fov": camera.fov}
    gap = imgui.get_style().item_spacing.x
    room = imgui.get_content_region_avail().x
    columns = 3 if room > widgets.em(NARROW) else 2
    width = (room - (columns - 1) * gap) / columns
    for i, name in enumerate(view_names(scene.volume)):
        if i % columns:
            imgui.same_line()
        text = f"Look from here ({name}), the whole volume in view."
        if widgets.button(f"view.{name}", name.capitalize(), text, width=width):
            camera = volume_camera(scene.volume, name, aspect=facts.aspect, **lens)
    half = (room - gap) / 2
    if widgets.button("view.fit", "Fit", "Same direction, the whole volume in view.", width=half):
        camera = camera.fitted(box_corners(scene.volume), facts.aspect)
    imgui.same_line()
    if widgets.button("view.reset", "Reset", "The view this volume began with.", width=half):
        camera = volume_camera(scene.volume, aspect=facts.aspect)
    return camera


def _numbers(camera: Camera, info: VolumeInfo) -> Camera:
    """Position, target, up, distance and height."""
    reach = max(camera.distance, 1e-6)
    word = f"{lengths.word(info)}."
    drag = "Drag to change; double click or Ctrl+click to type."
    with widgets.form("camera.numbers", WIDEST) as shown:
        if not shown:
            return camera
        for name, text, speed in (
            ("position", "Where the camera is: x, y, z in the world" + word, reach / 300),
            ("target", "What it looks at: x, y, z in the world" + word, reach / 300),
            ("up", "Which direction is up in the picture: x, y, z.", 0.005),
        ):
            widgets.label(name.capitalize())
            now: Vec3 = getattr(camera, name)
            new = widgets.vector(f"camera.{name}", f"{text}\n{drag}", now, speed=speed)
            camera = edit.changed(camera, **{name: new}) if new != now else camera
        widgets.label("Distance")
        distance = widgets.drag(
            "camera.distance",
            f"From the camera to what it looks at{word}\n{drag}",
            camera.distance,
            speed=reach / 300,
            low=reach * 1e-3,
            high=reach * 1e3,
            form=lengths.form(info, "%.5g"),
        )
        if distance != camera.distance:
            camera = camera.dollied(camera.distance / distance)
        widgets.label("Height")
        height = widgets.drag(
            "camera.height",
            f"Across the smaller side of an orthographic picture{word}\n{drag}",
            camera.height,
            speed=camera.height / 300,
            low=camera.height * 1e-3,
            high=camera.height * 1e3,
            form=lengths.form(info, "%.5g"),
        )
        return edit.changed(camera, height=height) if height != camera.height else camera
