"""Commands: all can be reached, no key is bound twice, and typing finds what people mean."""

from __future__ import annotations

import ast
from types import SimpleNamespace

import pytest

from tests.ui.display import ROOT, check_played, needs_display, play
from tests.ui.test_panels import DRAWS
from volviz.app import App
from volviz.ui import help_overlay, palette, picture_dialog
from volviz.ui.commands import COMMANDS, MENUS, shown_key, shown_keys
from volviz.ui.palette import Entry, found, score
from volviz.ui.shortcuts import chord

SCRIPTS = ("copying", "pasting", "pictures", "cancelled", "palette", "every_widget")

# function: keys by which people know it from other viewers, and the command that does it here
EXPECTED = {
    "reset camera": (("r", "home"), "reset"),
    "fly to, focus": (("f",), "focus"),
    "quit": (("ctrl+q",), "quit"),
    "orthographic or perspective": (("5", "o"), "projection"),
    "front": (("1", "keypad1"), "view-1"),
    "back": (("ctrl+1", "ctrl+keypad1"), "view-ctrl-1"),
    "right": (("3", "keypad3"), "view-3"),
    "left": (("ctrl+3", "ctrl+keypad3"), "view-ctrl-3"),
    "top": (("7", "keypad7"), "view-7"),
    "bottom": (("ctrl+7", "ctrl+keypad7"), "view-ctrl-7"),
    "isometric": (("9", "keypad9"), "view-9"),
    "screenshot": (("f12",), "screenshot"),
    "axes": (("x",), "axes"),
    "bounding box": (("b",), "box"),
    "help": (("h", "f1"), "help"),
    "command palette": (("ctrl+shift+p",), "palette"),
    "undo": (("ctrl+z",), "undo"),
    "redo": (("ctrl+y", "ctrl+shift+z"), "redo"),
    "copy state": (("ctrl+c",), "copy-scene"),
    "paste state": (("ctrl+v",), "paste"),
    "open": (("ctrl+o",), "open"),
    "save": (("ctrl+s",), "save"),
    "full screen": (("f11",), "fullscreen"),
    "hide panels": (("f9", "tab"), "panels"),
    "volume on and off": (("v",), "volume"),
}


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_says_what_it_is_and_can_be_reached(name):
    command = COMMANDS[name]
    assert command.title
    assert command.help
    assert command.menu in MENUS
    shell = SimpleNamespace(
        app=SimpleNamespace(scene=None, history=None), panels={}, window=None, viewport=None
    )
    named = {e.id for e in palette._commands(shell)}  # type: ignore[arg-type]
    assert f"command.{name}" in named or (name == "palette" and command.keys)


def test_titles_are_their_own():
    titles = [(c.menu, c.title) for c in COMMANDS.values()]
    assert len(titles) == len(set(titles))


def test_no_key_is_bound_twice():
    """As ImGui numbers them, so that "ctrl+shift+z" and "shift+ctrl+z" are one."""
    chords = [chord(k) for c in COMMANDS.values() for k in c.keys]
    assert len(chords) == len(set(chords))


@pytest.mark.parametrize("function", EXPECTED)
def test_keys_are_those_of_other_viewers(function):
    keys, name = EXPECTED[function]
    assert set(keys) <= set(COMMANDS[name].keys)


def test_titles_and_what_is_done_agree():
    """The picture was once called a command line."""
    assert COMMANDS["copy-picture"].title == "Copy Picture"
    assert COMMANDS["copy-command"].title == "Copy Command Line"
    assert shown_key("ctrl+alt+shift+o") == "Ctrl+Alt+Shift+O"
    assert [shown_key(k) for k in ("f12", "tab", "home")] == ["F12", "Tab", "Home"]
    assert shown_keys(COMMANDS["view-1"]) == "1"


def test_the_help_lists_every_command_and_fits():
    groups = help_overlay.groups()
    listed = {(heading, what) for heading, rows in groups for _, what in rows}
    assert {(c.menu, c.title) for c in COMMANDS.values() if not c.series} <= listed
    for count in (1, 2, 3, 4):
        sheet = help_overlay.columns(groups, count)
        assert len(sheet) <= count
        assert [g for column in sheet for g in column] == groups


def test_the_volume_is_hidden_and_shown_in_a_step_each(scene, tmp_path):
    shell = SimpleNamespace(app=App(folder=tmp_path))
    shell.app.show(scene, "Open")
    toggle = COMMANDS["volume"]
    for shown in (False, True):
        toggle.action(shell)
        assert shell.app.scene.raycast.show_volume is shown
        assert toggle.checked(shell) is shown
        shell.app.settle()
    assert [s.label for s in shell.app.history.steps] == ["Open", "Hide volume", "Show volume"]
    shell.app.close()


def names(query: str, *titles: str) -> list[str]:
    entries = [Entry(t, t, lambda: None, "", more=f"menu {t[::-1]}") for t in titles]
    return [e.title for e in found(entries, query)]


def test_prefixes_come_first():
    assert names("sa", "Unsaved", "Reset all", "Save") == ["Save", "Unsaved"]
    assert names("co", "Full Screen Copy", "Show Colours", "Copy") == [
        "Copy",
        "Show Colours",
        "Full Screen Copy",
    ]
    assert names("cc", "Accept", "Copy Command Line", "Collect coins") == [
        "Collect coins",
        "Copy Command Line",
        "Accept",
    ]
    assert names("cpy", "Crisp yellow", "Copy") == ["Copy", "Crisp yellow"]
    assert names("copy sc", "Copy Python", "Copy Scene as JSON") == ["Copy Scene as JSON"]
    assert names("COPY  scene ", "Copy Scene as JSON") == ["Copy Scene as JSON"]
    assert names("menu", "Copy") == ["Copy"]
    assert names("qqq", "Copy") == []
    assert names("", "B", "A") == ["B", "A"]


def test_what_cannot_be_done_comes_last():
    entries = [
        Entry("a", "Undo", lambda: None, "", enabled=False),
        Entry("b", "Unusual", lambda: None, ""),
    ]
    assert [e.id for e in found(entries, "un")] == ["b", "a"]


@pytest.mark.parametrize("name", COMMANDS)
def test_a_title_finds_its_command_first(name):
    title = COMMANDS[name].title
    scores = {c.title: score(title, c.title, c.help) for c in COMMANDS.values()}
    assert min((s, t) for t, s in scores.items() if s is not None)[1] == title


@pytest.mark.parametrize(
    "file",
    ["dialogs", "palette", "picture_dialog", "surface_dialog", "help_overlay", "panel_host"],
)
def test_dialogs_draw_widgets_only_through_those_with_tooltips(file):
    path = ROOT / "volviz" / "ui" / f"{file}.py"
    allowed = {"panel_host": {"button"}}.get(file, set())
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            bare = node.value.id == "imgui" and node.attr in DRAWS - allowed
            assert not bare, f"{file}: {node.attr}"


def test_estimates_are_for_people():
    assert [picture_dialog.duration(s) for s in (0.1, 42.4, 100, 7200)] == [
        "1 s",
        "42 s",
        "2 min",
        "2.0 h",
    ]


@needs_display
@pytest.mark.parametrize("name", SCRIPTS)
def test_window(name, tmp_path):
    check_played(play("scripts_exporting", name, tmp_path))
