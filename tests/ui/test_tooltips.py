"""Whatever can be clicked or typed in has a tooltip, and with it an id that tests find it by."""

from __future__ import annotations

import ast

import pytest

from tests.ui.display import ROOT

DRAWS = {
    "arrow_button", "begin_combo", "button", "checkbox", "collapsing_header", "color_button",
    "color_edit3", "color_edit4", "color_picker3", "combo", "drag_float", "drag_float3", "drag_int",
    "image_button", "input_double", "input_int", "input_int2", "input_text",
    "input_text_with_hint", "invisible_button", "menu_item", "menu_item_simple", "radio_button",
    "selectable", "slider_float", "slider_int", "small_button", "tree_node_ex",
}  # fmt: skip
"""Functions of ImGui that draw something to use."""
ALLOWED = {
    ("viewport.py", "draw"): 1,  # the picture itself: the help sheet tells its gestures
    ("widgets.py", "color"): 1,  # either of two
}
FILES = sorted((ROOT / "volviz" / "ui").rglob("*.py"))


def bare(source: str) -> dict[str, int]:
    """Functions that draw more than they give tooltips, and how many more."""
    found = {}
    for function in ast.walk(ast.parse(source)):
        if not isinstance(function, ast.FunctionDef):
            continue
        called = [n.func for n in ast.walk(function) if isinstance(n, ast.Call)]
        drawn = [
            f.attr
            for f in called
            if isinstance(f, ast.Attribute)
            and isinstance(f.value, ast.Name)
            and f.value.id == "imgui"
            and f.attr in DRAWS
        ]
        tips = [f for f in called if getattr(f, "attr", getattr(f, "id", "")) == "tip"]
        if len(drawn) > len(tips):
            found[function.name] = len(drawn) - len(tips)
    return found


@pytest.mark.parametrize("path", FILES, ids=lambda p: p.stem)
def test_everything_that_is_drawn_has_a_tooltip(path):
    left = {n: k for n, k in bare(path.read_text()).items() if ALLOWED.get((path.name, n)) != k}
    assert not left


def test_one_without_is_found():
    lines = ["def f():", "    imgui.button('a')", "    widgets.tip('a', 'about')"]
    assert bare("\n".join(lines)) == {}
    assert bare("\n".join(lines[:2])) == {"f": 1}
    assert bare("\n".join([*lines, "    imgui.selectable('b', False)"])) == {"f": 1}
