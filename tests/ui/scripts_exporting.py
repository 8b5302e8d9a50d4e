"""Copying, pasting, pictures of any size, the palette.

`python -m tests.ui.scripts_exporting NAME FOLDER`.

Driven in a real window by injected events.
"""

from __future__ import annotations

import io
import os
import shlex
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

import volviz
from tests.ui import injected
from tests.ui.injected import SAMPLE, Driver, Script
from tests.ui.patience import unseen
from volviz.cli import run as command_line
from volviz.model.surface_look import SceneSurface
from volviz.ui import bars, widgets
from volviz.ui.commands import COMMANDS, MENUS
from volviz.ui.im import imgui

CTRL, SHIFT, ALT = imgui.Key.mod_ctrl, imgui.Key.mod_shift, imgui.Key.mod_alt


def pasted(target: str) -> Script:
    """What another program gets from the clipboard, while the window lives on."""
    reader = [sys.executable, "-m", "tests.ui.x_clipboard", target]
    with subprocess.Popen(reader, stdout=subprocess.PIPE) as other:
        taken = b""
        assert other.stdout is not None
        os.set_blocking(other.stdout.fileno(), False)
        while other.poll() is None:
            taken += other.stdout.read() or b""
            with unseen():
                yield
        taken += other.stdout.read() or b""
    assert other.returncode == 0
    return taken


def ready(d: Driver) -> Script:
    d.app.keep(replace(d.app.settings, axes=False))
    d.shell.open([SAMPLE])
    yield from d.rest()
    d.app.change(d.app.scene.with_knobs(samples=1, seed=4, light_azimuth=-60), "Rendering")
    d.app.settle()
    yield from d.rest()


def copying(d: Driver) -> Script:
    yield from ready(d)
    size = d.shell.viewport.size
    wanted = volviz.render(d.app.scene, size).pixels
    yield from d.key(imgui.Key.c, CTRL, SHIFT)
    yield from d.rest()
    got = np.asarray(Image.open(io.BytesIO((yield from pasted("image/png")))))
    off = np.abs(got.astype(int) - wanted)
    assert got.shape == wanted.shape
    assert off.mean() < 0.05, off.mean()
    assert off.max() <= 3, off.max()
    assert "copied the picture" in d.app.messages.all[-1].text

    yield from d.key(imgui.Key.c, CTRL, ALT)
    yield from d.rest()
    line = (yield from pasted("UTF8_STRING")).decode()
    words = shlex.split(line)
    assert words[:3] == ["volviz", "render", SAMPLE]
    out = d.folder / "by-command.png"
    assert command_line([*words[1:-1], str(out), "-q"]) == 0
    assert np.array_equal(np.asarray(Image.open(out)), wanted)

    yield from d.key(imgui.Key.p, CTRL, ALT)
    yield from d.rest()
    code = (yield from pasted("UTF8_STRING")).decode()
    os.chdir(d.folder)
    exec(compile(code, "copied", "exec"), {})
    assert np.array_equal(np.asarray(Image.open("marschner-lobb.png")), wanted)

    before = d.app.scene
    yield from d.key(imgui.Key.c, CTRL)
    yield
    text = (yield from pasted("UTF8_STRING")).decode()
    assert '"volviz-scene"' in text
    yield from d.key(imgui.Key._7)
    d.app.change(d.app.scene.with_knobs(step=2.0), "Rendering")
    assert d.app.scene != before
    yield from d.key(imgui.Key.v, CTRL)
    yield from d.rest()
    assert d.app.scene == before
    assert d.app.history.present.label == "Paste scene"


def pasting(d: Driver) -> Script:
    """A scene of another volume is opened, a path too; anything else is one message."""
    np.save(d.folder / "ramp 2.npy", np.linspace(0, 1, 720, dtype=np.float32).reshape(8, 9, 10))
    other = volviz.Scene.of(volviz.load(d.folder / "ramp 2.npy")).with_knobs(step=0.7, samples=1)
    yield from ready(d)
    imgui.set_clipboard_text(volviz.model.scenefile.encode(other).decode())
    yield from d.key(imgui.Key.v, CTRL)
    yield from d.rest()
    assert d.app.scene.volume.dims == (10, 9, 8)
    assert d.app.scene.raycast == other.raycast
    imgui.set_clipboard_text("nonsense\nin two lines")
    count = len(d.app.messages.all)
    yield from d.key(imgui.Key.v, CTRL)
    assert len(d.app.messages.all) == count + 1
    assert "no scene to paste" in d.app.messages.all[-1].text
    imgui.set_clipboard_text(str(d.folder / "ramp.npy"))
    yield from d.key(imgui.Key.v, CTRL)
    yield from d.rest()
    assert d.app.scene.volume.dims == (30, 25, 20)


def pictures(d: Driver) -> Script:
    yield from ready(d)
    wanted = volviz.render(d.app.scene, (1100, 330), samples=3).pixels
    path = d.folder / "large.png"
    d.shell.exports.take_picture(path, (1100, 330), samples=3)
    yield from d.rest()
    got = np.asarray(Image.open(path))
    off = np.abs(got.astype(int) - wanted)
    assert got.shape == wanted.shape
    assert off.max() <= 3, off.max()
    assert off.mean() < 0.05
    before = path.read_bytes()
    yield from d.key(imgui.Key.f12, CTRL)
    for _ in range(3):
        yield
    assert d.shell.dialogs.active == "Save Picture"
    d.screen("save-picture")
    form, browser = d.shell.dialogs._picture, d.shell.dialogs._browser
    yield from d.key(imgui.Key.a, CTRL)
    imgui.get_io().add_input_characters_utf8(str(path))
    with widgets.watch() as seen:
        for _ in range(3):
            yield
    assert browser.path == path
    x0, y0, x1, y1 = seen.where["picture.size.1"]
    yield from d.click((x0 + x1) / 2, (y0 + y1) / 2)
    assert form.size == tuple(2 * n for n in d.shell.viewport.size)
    form.samples = 1
    form.transparent = True
    x0, y0, x1, y1 = seen.where["dialog.do"]
    yield from d.click((x0 + x1) / 2, (y0 + y1) / 2)
    yield
    assert d.shell.dialogs.active == "Save Picture", "it must ask before it replaces"
    assert not d.shell.exports.busy
    assert path.read_bytes() == before
    with widgets.watch() as seen:
        yield
        yield
    x0, y0, x1, y1 = seen.where["dialog.do"]
    yield from d.click((x0 + x1) / 2, (y0 + y1) / 2)
    yield from d.rest()
    taken = np.asarray(Image.open(path))
    assert taken.shape[:2] == (form.size[1], form.size[0])
    assert taken[0, 0, 3] == 0


def cancelled(d: Driver) -> Script:
    yield from ready(d)
    d.shell.exports.take_picture(d.folder / "huge.png", (4000, 3000), samples=32)
    slowest, end = 0.0, time.monotonic() + 3
    while time.monotonic() < end:
        start = time.monotonic()
        yield
        slowest = max(slowest, time.monotonic() - start)
    d.screen("drawing")
    assert 0 < d.shell.exports.picture.fraction < 0.5
    assert d.shell.exports.picture.remaining > 3
    with widgets.watch() as seen:
        yield
        yield
    x0, y0, x1, y1 = seen.where["export.cancel"]
    yield from d.click((x0 + x1) / 2, (y0 + y1) / 2)
    yield
    assert not d.shell.exports.busy
    assert not (d.folder / "huge.png").exists()
    print(f"slowest frame {slowest * 1000:.0f} ms")


def palette(d: Driver) -> Script:
    yield from ready(d)
    yield from d.key(imgui.Key.f9)  # all panels away

    def type_in(text: str) -> Script:
        yield from d.key(imgui.Key.p, CTRL, SHIFT)
        for _ in range(3):
            yield
        assert d.shell.dialogs.active == "Find a Command"
        imgui.get_io().add_input_characters_utf8(text)
        for _ in range(3):
            yield

    yield from type_in("hist")
    d.screen("palette")
    yield from d.key(imgui.Key.enter)
    for _ in range(6):
        yield
    assert d.app.settings.panels
    assert d.shell.dialogs.active == ""
    window = imgui.internal.find_window_by_name("History###history")
    assert window.active
    assert not window.hidden
    d.screen("history-in-front")

    yield from type_in("vir")
    yield from d.key(imgui.Key.down_arrow)
    yield from d.key(imgui.Key.up_arrow)
    yield from d.key(imgui.Key.enter)
    for _ in range(3):
        yield
    assert "viridis" in d.app.history.present.label.casefold()
    now = d.app.history.present
    yield from type_in("undo")
    yield from d.key(imgui.Key.escape)
    for _ in range(3):
        yield
    assert d.shell.dialogs.active == ""
    assert d.app.history.present is now
    yield from type_in("undo")
    yield from d.key(imgui.Key.enter)
    for _ in range(3):
        yield
    assert d.app.history.future
    yield from type_in("marsch")
    yield from d.key(imgui.Key.enter)
    while d.app.history.present.label != "Open marschner-lobb":
        yield
    d.app.change(d.app.scene.with_knobs(samples=1), "Rendering")
    yield from d.key(imgui.Key.h)
    for _ in range(4):
        yield
    d.screen("help-sheet")
    volviz.ui.im.glfw.set_window_size(d.shell.window.handle, 560, 400)
    for _ in range(12):
        yield
    d.screen("help-small")
    yield from d.key(imgui.Key.h)
    yield from type_in("")
    d.screen("palette-small")
    assert d.shell.dialogs.active == "Find a Command"


def every_widget(d: Driver) -> Script:
    """Ids and tooltips of all menus, dialogs and panels, and ImGui's own look for equal ids."""
    with unseen():  # it is listed, not looked at
        yield from listed(d)


def listed(d: Driver) -> Script:
    yield from ready(d)
    for menu in MENUS:
        with widgets.watch() as seen:
            seen.ids.clear()
            menu_as_window(d, menu)
            yield
        wanted = {f"menu.{n}" for n, c in COMMANDS.items() if c.menu == menu and not c.series}
        check(menu, seen, wanted)
        if menu == "Window":
            check(menu, seen, {f"panel.{n}" for n in d.shell.panels})
    dialogs = d.shell.dialogs
    openers = {
        dialogs.open_file: {"browser.path", "dialog.do", "dialog.cancel"},
        dialogs.open_folder: {"browser.path", "browser.up"},
        dialogs.save_scene: {"browser.path", "dialog.do"},
        dialogs.save_picture: {"picture.size", "picture.samples", "picture.transparent"},
        dialogs.save_surface: {"surface.file.number", "dialog.do"},
        dialogs.ask_unsaved: {"unsaved.save", "unsaved.close", "unsaved.stay"},
        dialogs.toggle_help: set(),
        dialogs.open_palette: {"palette.query", *(f"command.{n}" for n in COMMANDS)}
        - {"command.palette"},
    }
    hidden = SceneSurface.at(0.5, visible=False)  # nothing is to be made of it
    d.app.change(d.app.scene.with_surfaces([hidden]), "Add surface")
    for opener, wanted in openers.items():
        opener()
        for _ in range(4):
            yield
        yield from watched(opener.__name__, wanted)
        dialogs.close()
        yield
        yield
    yield from no_equal_ids(d)


def watched(what: str, wanted: set[str]) -> Script:
    """One frame's widgets, checked."""
    with widgets.watch() as seen:
        yield
        seen.ids.clear()
        seen.tips.clear()
        yield
    check(what, seen, wanted)
    return seen


def check(what: str, seen: widgets.Watch, wanted: set[str]) -> None:
    names = [name for _, name in seen.ids]
    numbers = [number for number, _ in seen.ids if number]
    assert wanted <= set(names), (what, wanted - set(names))
    assert len(set(names)) == len(names), (what, sorted(n for n in names if names.count(n) > 1))
    assert len(set(numbers)) == len(numbers), what
    for name in names:
        assert len(seen.tips[name]) > 3 or name.startswith("browser.file."), (what, name)


def menu_as_window(d: Driver, menu: str) -> None:
    """The items of a menu in a window, where all can be seen at once, with the next frame."""
    draw = d.shell.dialogs.draw

    def drawn() -> None:
        d.shell.dialogs.draw = draw
        imgui.begin("menu")
        bars._menu(d.shell, menu)
        imgui.end()
        draw()

    d.shell.dialogs.draw = drawn


def no_equal_ids(d: Driver) -> Script:
    """Hover over each widget: ImGui says when another has the same id (a planted one is found)."""
    context = imgui.get_current_context()
    assert imgui.get_io().config_debug_highlight_id_conflicts
    with widgets.watch() as seen:
        yield
        seen.where.clear()
        yield
    assert len(seen.where) > 20, sorted(seen.where)
    for name, (x0, y0, x1, y1) in seen.where.items():
        imgui.get_io().add_mouse_pos_event((x0 + x1) / 2, (y0 + y1) / 2)
        yield
        yield
        assert context.debug_draw_id_conflicts_id == 0, name
    draw = d.shell.dialogs.draw

    def planted() -> None:
        imgui.set_next_window_pos((400, 300))
        imgui.begin("planted")
        imgui.button("first###same")
        imgui.button("second###same")
        imgui.end()
        draw()

    d.shell.dialogs.draw = planted
    imgui.get_io().add_mouse_pos_event(430, 335)
    for _ in range(5):
        yield
    assert context.debug_draw_id_conflicts_id != 0
    d.shell.dialogs.draw = draw
    yield


SCRIPTS = (copying, pasting, pictures, cancelled, palette, every_widget)
LARGE = {"palette", "every_widget"}
"""Those whose pictures are looked at, at the size that most people meet."""


if __name__ == "__main__":
    folder = Path(sys.argv[2])
    if sys.argv[1] not in LARGE:
        (folder / "config").mkdir()
        (folder / "config" / "settings.json").write_text('{"size": [900, 560]}')
    injected.run({s.__name__: s for s in SCRIPTS}[sys.argv[1]], folder)
