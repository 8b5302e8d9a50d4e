"""Rendering: every knob of the rays and the light, projection and background."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from volviz.model.camera import Camera
from volviz.model.knobs import knobs_of
from volviz.model.scene import Background, Light, Raycast, SceneState
from volviz.ui import edit, widgets
from volviz.ui.facts import Facts
from volviz.ui.im import imgui

PLAIN: dict[str, Background] = {
    "Dark": Background(),
    "Black": Background.plain((0, 0, 0)),
    "White": Background.plain((1, 1, 1)),
    "Clear": Background.plain((0, 0, 0, 0)),
}


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """How rays gather, how finely, how surfaces are lit, and what is behind them."""
    labels = [edit.title(k) for part in (Raycast, Light, Camera) for k in knobs_of(part)]
    imgui.separator_text("Rays")
    raycast = edit.knob_rows(scene.raycast, "raycast", beside=labels)
    imgui.separator_text("Light")
    light = scene.light
    imgui.begin_disabled(scene.raycast.shading == "none" or scene.raycast.mode == "mip")
    light = edit.knob_rows(light, "light", beside=labels)
    imgui.end_disabled()
    imgui.separator_text("Picture")
    camera = edit.knob_rows(scene.camera, "camera", ["projection"], beside=labels)
    imgui.separator_text("Background")
    background = _background(scene.background, labels)
    if (raycast, light, camera) == (scene.raycast, scene.light, scene.camera):
        return scene if background == scene.background else replace(scene, background=background)
    return replace(scene, raycast=raycast, light=light, camera=camera, background=background)


def _background(background: Background, labels: Sequence[str]) -> Background:
    with widgets.form("background", labels) as shown:
        if shown:
            for name in ("top", "bottom"):
                widgets.label(name.capitalize())
                now = getattr(background, name)
                text = f"Colour and opacity at the {name} of the picture; click to pick."
                new = widgets.color(f"background.{name}", text, now)
                background = edit.changed(background, **{name: new}) if new != now else background
    for i, (name, plain) in enumerate(PLAIN.items()):
        if i:
            widgets.beside(name)
        text = "Transparent, for pictures with alpha." if name == "Clear" else f"{name} background."
        if widgets.button(f"background.{name.lower()}", name, text):
            background = plain
    return background
