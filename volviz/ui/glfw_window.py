"""The one GLFW: imgui-bundle's 3.5, which must be chosen before `glfw` is imported."""

import imgui_bundle  # noqa: F401  (sets the library that glfw loads)

import glfw  # isort: skip

__all__ = ["glfw"]
