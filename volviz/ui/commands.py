"""Everything a menu, a key or a button can do, once. Keys are written as people read them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from volviz.app.choosing import may_have_parts
from volviz.ui import actions, bookmarks, lens_tool

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

MENUS = ("File", "Edit", "View", "Window", "Help")


def _always(_: Any) -> bool:
    return True


def _open_scene(shell: Shell) -> bool:
    return shell.app.scene is not None


def _film(shell: Shell) -> bool:
    scene = shell.app.scene
    return scene is not None and scene.source is not None and scene.volume.info.times > 1


@dataclass(frozen=True)
class Command:
    """One thing that can be done. keys: chords, the first is shown; enabled, checked: of a shell.

    group: a change of group within a menu draws a line. series: one of many alike, left out of
    the menus and the help.
    """

    title: str
    menu: str
    keys: tuple[str, ...]
    action: Callable[[Shell], None]
    help: str = ""
    enabled: Callable[[Shell], bool] = _always
    checked: Callable[[Shell], bool] | None = None
    group: int = 0
    series: bool = False


def _view(*names: str) -> Callable[[Shell], None]:
    """Look from the first of these views that the volume has."""
    return lambda shell: shell.viewport.look_from(names)


def _view_command(title: str, keys: tuple[str, ...], *names: str) -> Command:
    text = f"Look at the volume from this side ({' or '.join(names)})"
    return Command(title, "View", keys, _view(*names), text, _open_scene, group=1)


def _bookmark_commands() -> dict[str, Command]:
    """Two for each of the first bookmarks: go there, and set it."""
    made: dict[str, Command] = {}
    for n in range(1, bookmarks.KEYS + 1):
        go, there = bookmarks.going(n - 1), bookmarks.has(n - 1)
        title, text = f"Go to Bookmark {n}", "Look from where this bookmark was set"
        made[f"go-{n}"] = Command(title, "View", (f"alt+{n}",), go, text, there, series=True)
        keep, title = bookmarks.setting(n - 1), f"Set Bookmark {n}"
        keys, text = (f"alt+shift+{n}",), "Keep the present view as this bookmark"
        made[f"set-{n}"] = Command(title, "View", keys, keep, text, _open_scene, series=True)
    return made


COMMANDS: dict[str, Command] = {
    "open": Command(
        "Open…", "File", ("ctrl+o",), lambda s: s.dialogs.open_file(), "A volume or a scene file"
    ),
    "open-folder": Command(
        "Open Folder…",
        "File",
        ("ctrl+shift+o",),
        lambda s: s.dialogs.open_folder(),
        "A folder of DICOM files or of image slices",
    ),
    "choose-part": Command(
        "Choose Series or Part…",
        "File",
        ("ctrl+shift+d",),
        lambda s: s.app.choosing.list_parts(),
        "Another series of the open folder; another array, time or channel of the open file",
        lambda s: may_have_parts(s.app.scene),
    ),
    "save": Command(
        "Save Scene",
        "File",
        ("ctrl+s",),
        lambda s: s.save(),
        "Write the scene to its file: all settings, and where the volume is",
        _open_scene,
        group=1,
    ),
    "save-as": Command(
        "Save Scene As…",
        "File",
        ("ctrl+shift+s",),
        lambda s: s.dialogs.save_scene(),
        "Write the scene to another file",
        _open_scene,
        group=1,
    ),
    "screenshot": Command(
        "Save Picture",
        "File",
        ("f12",),
        lambda s: s.exports.quick_picture(),
        "Write the picture at full quality, as large as it is shown, without asking",
        _open_scene,
        group=2,
    ),
    "screenshot-as": Command(
        "Save Picture As…",
        "File",
        ("ctrl+f12",),
        lambda s: s.dialogs.save_picture(),
        "Write a picture of any size, on request with a transparent background",
        _open_scene,
        group=2,
    ),
    "save-surface": Command(
        "Save Surface As…",
        "File",
        ("ctrl+e",),
        lambda s: s.dialogs.save_surface(),
        "Write a surface as STL, PLY, OBJ or GLB; smoothed or decimated first, if you like",
        lambda s: bool(s.app.scene and s.app.scene.surfaces),
        group=2,
    ),
    "quit": Command("Quit", "File", ("ctrl+q",), lambda s: s.quit(), "Close volviz", group=3),
    "undo": Command(
        "Undo",
        "Edit",
        ("ctrl+z",),
        lambda s: s.app.undo(),
        "Take the last change back",
        lambda s: bool(s.app.history and s.app.history.past),
    ),
    "redo": Command(
        "Redo",
        "Edit",
        ("ctrl+y", "ctrl+shift+z"),
        lambda s: s.app.redo(),
        "Make the change again that was undone",
        lambda s: bool(s.app.history and s.app.history.future),
    ),
    "copy-picture": Command(
        "Copy Picture",
        "Edit",
        ("ctrl+shift+c",),
        lambda s: s.exports.copy_picture(),
        "Copy the picture at full quality, as large as it is shown",
        _open_scene,
        group=1,
    ),
    "copy-scene": Command(
        "Copy Scene as JSON",
        "Edit",
        ("ctrl+c",),
        lambda s: s.exports.copy_scene(),
        "Copy the scene file's text: all settings, and where the volume is",
        _open_scene,
        group=1,
    ),
    "copy-command": Command(
        "Copy Command Line",
        "Edit",
        ("ctrl+alt+c",),
        lambda s: s.exports.copy_command(),
        "Copy the 'volviz render' line that makes this picture",
        _open_scene,
        group=1,
    ),
    "copy-python": Command(
        "Copy Python Code",
        "Edit",
        ("ctrl+alt+p",),
        lambda s: s.exports.copy_python(),
        "Copy the Python code that makes this picture",
        _open_scene,
        group=1,
    ),
    "paste": Command(
        "Paste Scene",
        "Edit",
        ("ctrl+v",),
        lambda s: s.exports.paste(),
        "Take over a scene that was copied as JSON, or open the file whose path was copied",
        group=1,
    ),
    "add-surface": Command(
        "Add Surface",
        "Edit",
        ("i",),
        actions.add_surface,
        "An isosurface in the volume, at a value worth seeing",
        _open_scene,
        group=2,
    ),
    "reset": Command(
        "Show All",
        "View",
        ("r", "home"),
        lambda s: s.viewport.reset(),
        "Back to the view in which the volume was opened",
        _open_scene,
    ),
    "projection": Command(
        "Orthographic",
        "View",
        ("5", "o"),
        lambda s: s.viewport.toggle_projection(),
        "Parallel rays instead of perspective",
        _open_scene,
        lambda s: bool(s.app.scene and s.app.scene.camera.projection == "orthographic"),
    ),
    "view-1": _view_command("Front", ("1", "keypad1"), "anterior", "front"),
    "view-ctrl-1": _view_command("Back", ("ctrl+1", "ctrl+keypad1"), "posterior", "back"),
    "view-3": _view_command("Right", ("3", "keypad3"), "right"),
    "view-ctrl-3": _view_command("Left", ("ctrl+3", "ctrl+keypad3"), "left"),
    "view-7": _view_command("Top", ("7", "keypad7"), "superior", "top"),
    "view-ctrl-7": _view_command("Bottom", ("ctrl+7", "ctrl+keypad7"), "inferior", "bottom"),
    "view-9": Command(
        "Corner",
        "View",
        ("9", "keypad9"),
        actions.look_from_corner,
        "Look from a corner at three sides alike (isometric)",
        _open_scene,
        group=1,
    ),
    "focus": Command(
        "Turn About the Cursor",
        "View",
        ("f",),
        actions.focus,
        "Turn from now on about what is under the cursor, as a double click does",
        _open_scene,
        group=1,
    ),
    "bookmark": Command(
        "Add Bookmark",
        "View",
        ("ctrl+d",),
        bookmarks.add,
        "Keep this view with the scene; Alt+1 … Alt+9 go to the first ones, with Shift set them",
        _open_scene,
        group=1,
    ),
    **_bookmark_commands(),
    "play": Command(
        "Play through Time",
        "View",
        ("space",),
        lambda s: s.app.choosing.play(not s.app.choosing.playing),
        "Show one time of the open file after the other",
        _film,
        lambda s: s.app.choosing.playing,
        group=3,
    ),
    "time-next": Command(
        "Next Time",
        "View",
        (".",),
        lambda s: s.app.choosing.step(1),
        "The next time of the open file",
        _film,
        group=3,
    ),
    "time-back": Command(
        "Previous Time",
        "View",
        (",",),
        lambda s: s.app.choosing.step(-1),
        "The time before",
        _film,
        group=3,
    ),
    "axes": Command(
        "Orientation Cube",
        "View",
        ("x",),
        lambda s: s.toggle("axes"),
        "Show the cube that tells the sides; click a side to look from there",
        checked=lambda s: s.app.settings.axes,
        group=2,
    ),
    "box": Command(
        "Bounding Box",
        "View",
        ("b",),
        lambda s: s.toggle("box"),
        "Show the edges of the volume",
        checked=lambda s: s.app.settings.box,
        group=2,
    ),
    "volume": Command(
        "Volume",
        "View",
        ("v",),
        actions.toggle_volume,
        "Draw the volume around its surfaces, or leave them alone",
        _open_scene,
        lambda s: bool(s.app.scene and s.app.scene.raycast.show_volume),
        group=2,
    ),
    "lens": Command(
        "Lens",
        "View",
        ("l",),
        lens_tool.toggle,
        "Surfaces at full resolution round a focus only, which the mouse drags",
        lambda s: bool(s.app.scene and s.app.scene.surfaces),
        lambda s: bool(s.app.scene and s.app.scene.lens.lens),
        group=2,
    ),
    "turntable": Command(
        "Turntable",
        "View",
        ("t",),
        lambda s: s.toggle("turntable"),
        "Keep the vertical upright while turning, instead of a free trackball",
        checked=lambda s: s.app.settings.turntable,
        group=2,
    ),
    "panels": Command(
        "Panels",
        "Window",
        ("f9", "tab"),
        lambda s: s.toggle("panels"),
        "Show or hide all panels",
        checked=lambda s: s.app.settings.panels,
    ),
    "fullscreen": Command(
        "Full Screen",
        "Window",
        ("f11",),
        lambda s: s.window.toggle_full_screen(),
        "Fill the screen, and back",
        checked=lambda s: s.window.full_screen,
    ),
    "theme": Command(
        "Light Theme",
        "Window",
        ("ctrl+l",),
        lambda s: s.toggle_theme(),
        "Light instead of dark",
        checked=lambda s: s.app.settings.theme == "light",
    ),
    "larger": Command(
        "Larger Text", "Window", ("ctrl+=",), lambda s: s.zoom_text(1.1), "Everything larger"
    ),
    "smaller": Command(
        "Smaller Text", "Window", ("ctrl+-",), lambda s: s.zoom_text(1 / 1.1), "Everything smaller"
    ),
    "reset-layout": Command(
        "Reset Layout",
        "Window",
        ("ctrl+shift+l",),
        lambda s: s.reset_layout(),
        "All panels back to where they were at first",
        group=1,
    ),
    "help": Command(
        "Keys and Mouse",
        "Help",
        ("h", "f1"),
        lambda s: s.dialogs.toggle_help(),
        "What the mouse and the keys do",
    ),
    "palette": Command(
        "Find a Command…",
        "Help",
        ("ctrl+shift+p",),
        lambda s: s.dialogs.open_palette(),
        "Type a few letters of what you want to do",
    ),
}


def shown_keys(command: Command) -> str:
    """All chords of a command for people; the keypad's are those of the digits."""
    return ", ".join(shown_key(k) for k in command.keys if "keypad" not in k)


def shown_key(chord: str) -> str:
    """A chord for menus: "ctrl+shift+o" is "Ctrl+Shift+O"."""
    parts = chord.split("+") if not chord.endswith("++") else [*chord[:-2].split("+"), "+"]
    words = ("ctrl", "shift", "alt", "tab")
    return "+".join(p.upper() if len(p) <= 3 and p not in words else p.capitalize() for p in parts)
