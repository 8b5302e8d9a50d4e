"""Rendering: every knob of the rays and the light, as the knobs describe themselves."""

from __future__ import annotations

from dataclasses import replace

from volviz.model.knobs import knobs_of
from volviz.model.scene import Light, Raycast, SceneState
from volviz.ui import edit
from volviz.ui.facts import Facts
from volviz.ui.im import imgui


def panel(scene: SceneState, facts: Facts) -> SceneState:
    """How rays gather, how finely, and how surfaces are lit."""
    labels = [edit.title(k) for part in (Raycast, Light) for k in knobs_of(part)]
    imgui.separator_text("Rays")
    raycast = edit.knob_rows(scene.raycast, "raycast", beside=labels)
    imgui.separator_text("Light")
    light = scene.light
    imgui.begin_disabled(scene.raycast.shading == "none" or scene.raycast.mode == "mip")
    light = edit.knob_rows(light, "light", beside=labels)
    imgui.end_disabled()
    if raycast is scene.raycast and light is scene.light:
        return scene
    return replace(scene, raycast=raycast, light=light)
