"""The one import of imgui_bundle: what the window uses of it, and its fonts.

imgui_bundle carries GLFW 3.5 and points the `glfw` package at it when it is imported first, so
every file of `ui` takes glfw and imgui from here. Its interface moves between releases: this is
the only place that has to follow.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import imgui_bundle
from imgui_bundle import icons_fontawesome_6 as icons
from imgui_bundle import imgui, implot

from volviz.gpu.contexts_glfw import import_glfw

glfw: Any = import_glfw()
internal = imgui.internal
backends = imgui.backends
ImVec2 = imgui_bundle.ImVec2
ImVec4 = imgui_bundle.ImVec4

_FONTS = Path(imgui_bundle.__file__).parent / "assets" / "fonts"
FONT = _FONTS / "Roboto" / "Roboto-Regular.ttf"  # Apache 2.0, with Greek, µ, °, Å, ×, −, ²
FONT_BOLD = _FONTS / "Roboto" / "Roboto-Bold.ttf"
FONT_ICONS = _FONTS / "Font_Awesome_6_Free-Solid-900.otf"  # SIL OFL 1.1

__all__ = [
    "FONT",
    "FONT_BOLD",
    "FONT_ICONS",
    "ImVec2",
    "ImVec4",
    "backends",
    "glfw",
    "icons",
    "imgui",
    "implot",
    "internal",
]
