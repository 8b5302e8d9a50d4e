"""What a user does, driven in a real window: `python -m tests.ui.scenarios FOLDER NAME...`.

A scenario is a generator over a `Driver`: every `yield` is one frame, asserts are its checks.
`GROUPS` says which share a process; each has a window and a configuration folder of its own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from tests.ui.driver import Driver, Script
from tests.ui.scenarios import editing, files, looks, mouse, robust


class Scenario(NamedTuple):
    """A script, and the settings its window starts with."""

    script: Callable[[Driver], Script]
    settings: Mapping[str, Any] = {}


BARE = {"size": (640, 480), "panels": False}
"""Where only the picture matters: software draws a small window several times as fast."""

SCENARIOS: dict[str, Scenario] = {
    "dropped": Scenario(files.dropped, BARE),
    "typed_path": Scenario(files.typed_path, BARE),
    "raw": Scenario(files.raw, BARE),
    "saved_and_reopened": Scenario(files.saved_and_reopened),
    "pictures": Scenario(files.pictures, BARE),
    "cancelled": Scenario(files.cancelled, BARE),
    "trackball": Scenario(mouse.trackball, BARE),
    "wheel": Scenario(mouse.wheel, BARE),
    "leveling": Scenario(mouse.leveling, BARE),
    "turntable": Scenario(mouse.turntable, BARE),
    "cube": Scenario(mouse.cube, BARE),
    "keys": Scenario(mouse.keys),
    "focus": Scenario(mouse.focus, BARE),
    "control_point": Scenario(editing.control_point),
    "preset": Scenario(editing.preset),
    "typed_value": Scenario(editing.typed_value),
    "escape": Scenario(editing.escape),
    "broken_panel": Scenario(robust.broken_panel),
    "resized": Scenario(robust.resized, {"size": (1200, 780)}),
    "minimised": Scenario(robust.minimised, BARE),
    "unsaved": Scenario(robust.unsaved),
    "idle": Scenario(robust.idle, BARE),
    "crash": Scenario(robust.crash),
    "recovered": Scenario(robust.recovered),
    "same_as_render": Scenario(looks.same_as_render, {"axes": False}),
    "themes": Scenario(looks.themes),
    "large_text": Scenario(looks.large_text, {"scale": 2.0, "size": (700, 500)}),
    "dense_screen": Scenario(looks.dense_screen, {"size": (640, 480), "axes": False}),
}

GROUPS: dict[str, tuple[str, ...]] = {
    "files": ("dropped", "typed_path", "raw", "saved_and_reopened", "pictures", "cancelled"),
    "mouse": ("trackball", "wheel", "leveling", "turntable", "cube", "keys", "focus"),
    "editing": ("control_point", "preset", "typed_value", "escape"),
    "robust": ("broken_panel", "resized", "minimised", "unsaved", "idle"),
    "looks": ("same_as_render", "themes", "large_text"),
}
