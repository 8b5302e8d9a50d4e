"""Other words under which people look for commands and panels."""

from __future__ import annotations

from volviz.model.camera import Camera
from volviz.model.knobs import knobs_of
from volviz.model.refining import Refining
from volviz.model.scene import Light, Raycast
from volviz.model.surface import Surface
from volviz.model.surface_look import SurfaceLook
from volviz.ui import edit

COMMAND_WORDS = {
    "open": "load import read file",
    "open-folder": "load import series directory slices",
    "save": "store write",
    "save-as": "store write export",
    "screenshot": "screenshot snapshot export image png",
    "screenshot-as": "screenshot snapshot export image png resolution print",
    "quit": "exit leave end",
    "undo": "back revert",
    "redo": "forward repeat",
    "copy-command": "shell terminal cli recipe",
    "copy-python": "script code recipe",
    "add-surface": "isosurface contour mesh",
    "save-surface": "export mesh stl ply obj glb isosurface print decimate smooth",
    "volume": "raycast hide show",
    "reset": "reset fit home zoom view camera",
    "projection": "parallel perspective camera",
    "focus": "center centre pivot target",
    "turntable": "rotate orbit trackball",
    "axes": "gizmo orientation",
    "box": "outline frame edges",
    "panels": "hide show sidebar",
    "fullscreen": "maximise maximize",
    "theme": "dark mode appearance",
    "larger": "zoom scale font bigger ui",
    "smaller": "zoom scale font ui",
    "reset-layout": "windows docking default",
    "help": "shortcuts keyboard manual hotkeys",
    "play": "film movie animation 4d",
}
PANEL_WORDS = {
    "data": "info metadata header spacing dimensions orientation file",
    "transfer": "histogram opacity colours window level range percentiles",
    "presets": "looks gallery thumbnails",
    "surfaces": "isosurface isovalue contour mesh",
    "rendering": "quality light background projection parallel",
    "view": "camera bookmarks",
    "compare": "benchmark vary wipe error quality",
    "history": "undo steps",
    "log": "messages warnings errors",
    "performance": "speed frames memory fps",
}
KNOBS = {
    "rendering": (Raycast, Light),
    "view": (Camera,),
    "surfaces": (Surface, SurfaceLook, Refining),
}
"""Whose knobs a panel turns: their names find it, too."""


def of_panel(name: str) -> str:
    """All words that find a panel besides its title."""
    turned = (k for owner in KNOBS.get(name, ()) for k in knobs_of(owner))
    knobs = [f"{k.name} {edit.title(k)}" for k in turned]
    return " ".join(["show panel window", PANEL_WORDS.get(name, ""), *knobs])
