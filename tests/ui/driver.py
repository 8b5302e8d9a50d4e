"""Hands and eyes for a real window: mouse, keys, items by path, the pixels on the screen."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from PIL import ImageGrab

from tests.ui.engine import Act, Engine
from tests.ui.patience import nap, seen, unseen
from volviz.app import App
from volviz.model.scene import SceneState
from volviz.ui import overlay, painting, widgets
from volviz.ui.commands import COMMANDS
from volviz.ui.im import ImVec2, glfw, imgui
from volviz.ui.shell import Shell
from volviz.ui.window import show

Script = Iterator[None]
Key = imgui.Key
LEFT, RIGHT, MIDDLE = 0, 1, 2
CTRL, SHIFT = Key.mod_ctrl, Key.mod_shift


class Driver:
    """A shell, and hands and eyes for it. Every `yield` is one frame."""

    def __init__(self, shell: Shell, folder: Path) -> None:
        self.shell, self.app, self.folder = shell, shell.app, folder
        self.engine = Engine()
        self.seen = widgets.Watch()
        self.points: list[np.ndarray] = []
        """Pixels of the control points: of the opacity, of the colours."""
        self.cube = ((0.0, 0.0), 1.0)
        """Middle and scale of the orientation cube."""
        self.plain: Callable[[], None] = shell.frame
        """One frame without the script."""

    @property
    def scene(self) -> SceneState:
        assert self.app.scene is not None
        return self.app.scene

    @property
    def step(self) -> str:
        """What the latest step of undo is called."""
        assert self.app.history is not None
        return self.app.history.present.label

    def rest(self, seconds: float = 200.0) -> Script:
        """Until nothing is loaded and the picture is whole."""
        end = time.monotonic() + seconds
        for _ in range(3):
            yield
        while time.monotonic() < end:
            still = self.app.job is None and not self.shell.exports.busy
            if still and (self.app.scene is None or self.shell.viewport.state.done):
                break
            with unseen():
                yield
        else:
            raise AssertionError("the window does not come to rest")
        yield
        yield

    def silence(self) -> Script:
        """At rest, without messages over the picture, and the mouse out of the way."""
        yield from self.rest()
        for message in self.app.messages.all:
            self.app.messages.hide(message)
        yield from self.do(lambda t: t.mouse_move_to_pos(ImVec2(*self.middle)))
        yield
        yield

    def until(self, what: Callable[[], bool], seconds: float = 120.0) -> Script:
        """Until something is so."""
        end = time.monotonic() + seconds
        while not what():
            assert time.monotonic() < end, "it does not happen"
            with unseen():
                yield
        yield

    def open(self, *names: str) -> Script:
        """Drop files, and wait."""
        self.drop(*names)
        yield from self.rest()

    def drop(self, *names: str) -> None:
        """As GLFW tells it."""
        self.shell.window._dropped(None, list(names))

    # --- items by path ---------------------------------------------------------------------------

    def do(self, act: Act) -> Script:
        """Let the test engine do something."""
        yield from self.engine.do(act)
        self.shell.themed = None  # the engine puts ImGui's style back to what it was before

    def ref(self, name: str) -> Any:
        """What the engine finds an item by: a path "//window/…/item", or the id of a widget."""
        if name.startswith("//"):
            return name
        numbers = [number for number, known in self.seen.ids if known == name]
        assert numbers, f"{name} is not drawn; drawn are {sorted(self.seen.where)}"
        return imgui.test_engine.TestRef(numbers[0])

    def panel(self, name: str) -> Script:
        """Bring a panel in front of its neighbours."""
        yield from self.do(lambda t: t.window_focus(f"//###{name}"))

    def click(self, name: str) -> Script:
        """Click an item: a path, or the id of one of our widgets, e.g. "raycast.step"."""
        yield from self.do(lambda t: t.item_click(self.ref(name)))

    def menu(self, *path: str) -> Script:
        """Choose from the menu bar."""

        named = {c.title: f"###menu.{name}" for name, c in COMMANDS.items()}
        *menus, title = path
        places = [p.replace("/", "\\/") for p in (*menus, named.get(title, title))]

        def act(t: Any) -> None:
            t.set_ref("##MainMenuBar")
            t.menu_click("/".join(places))

        yield from self.do(act)

    def type_in(self, name: str, value: float | str) -> Script:
        """Into a field."""
        yield from self.do(lambda t: t.item_input_value(self.ref(name), value))

    def choose(self, name: str, item: str) -> Script:
        """Open a list and pick an item of it: "raycast.shading", "none"."""
        yield from self.click(name)
        yield
        yield from self.click(f"{name}.{item}")

    # --- mouse and keys --------------------------------------------------------------------------

    def key(self, key: Key, *mods: Key) -> Script:
        chord = int(key)
        for mod in mods:
            chord |= int(mod)
        yield from self.do(lambda t: t.key_press(chord))
        yield

    def drag(
        self, at: tuple[float, float], move: tuple[float, float], button: int = LEFT, *mods: Key
    ) -> Script:
        """Press, move in eight parts, release."""

        def act(t):
            t.mouse_move_to_pos(ImVec2(*at))
            for mod in mods:
                t.key_down(int(mod))
            t.yield_()
            t.mouse_down(button)
            for i in range(1, 9):
                t.mouse_move_to_pos(ImVec2(at[0] + move[0] * i / 8, at[1] + move[1] * i / 8))
            t.mouse_up(button)
            for mod in mods:
                t.key_up(int(mod))

        yield from self.do(act)
        yield

    def press(self, x: float, y: float, button: int = LEFT, times: int = 1) -> Script:
        """Click at a place, which may be nothing of ImGui's."""

        def act(t):
            t.mouse_move_to_pos(ImVec2(x, y))
            if times == 2:
                t.mouse_double_click(button)
            else:
                t.mouse_click(button)

        yield from self.do(act)
        yield

    def wheel(self, x: float, y: float, clicks: float) -> Script:
        def act(t):
            t.mouse_move_to_pos(ImVec2(x, y))
            t.mouse_wheel_y(clicks)

        yield from self.do(act)
        yield

    def undo(self, times: int = 1) -> Script:
        for _ in range(times):
            yield from self.key(Key.z, CTRL)

    def redo(self, times: int = 1) -> Script:
        for _ in range(times):
            yield from self.key(Key.y, CTRL)

    # --- what is seen ----------------------------------------------------------------------------

    @property
    def middle(self) -> tuple[int, int]:
        """Of the 3D view."""
        x, y, w, h = self.shell.place
        return round(x + w / 2), round(y + h / 2)

    def where(self, id_: str) -> tuple[float, float, float, float]:
        """Left, top, right, bottom of one of our widgets."""
        return self.seen.where[id_]

    def screen(self, name: str = "") -> np.ndarray:
        """uint8[h, w, 3] of the window on the X display, kept as an artefact if it has a name."""
        assert seen(), "nothing is shown"
        self.shell.gpu.ctx.finish()
        x, y = glfw.get_window_pos(self.shell.window.handle)
        w, h = self.shell.window.size
        taken = ImageGrab.grab(xdisplay=os.environ["DISPLAY"]).convert("RGB")
        taken = taken.crop((x, y, x + w, y + h))
        if name:
            taken.save(self.folder / f"window-{name}.png")
        return np.array(taken)

    def view(self) -> np.ndarray:
        """The pixels of the 3D view on the screen."""
        x, y, _, _ = (round(n) for n in self.shell.place)
        w, h = self.shell.viewport.size
        return self.screen()[y : y + h, x : x + w]


def drive(script: Callable[[Driver], Script], folder: Path, **settings: object) -> None:
    """Open a window with settings of its own, in `folder`, and play a script in it."""
    app = App(folder=folder / "config")
    app.keep(replace(app.settings, **{"size": (920, 580), **settings}))  # type: ignore[arg-type]

    def started(shell: Shell) -> None:
        driver = Driver(shell, folder)
        frame, end, played = shell.frame, shell.window.close, script(driver)

        def plain() -> None:
            driver.points.clear()
            with widgets.watch() as driver.seen:
                frame()
            driver.engine.swapped()

        def driven() -> None:
            plain()
            if next(played, "end") == "end":
                shell.leave()
            nap(shell)
            shell.window.touch()

        driver.plain = plain
        shell.frame = driven  # type: ignore[method-assign]
        shell.window.close = lambda: driver.engine.close(end)  # type: ignore[method-assign]
        _record(driver)

    points, cube = painting.points, overlay.cube
    try:
        show(app=app, started=started)
    finally:
        painting.points, overlay.cube = points, cube


def _record(driver: Driver) -> None:
    """Let the driver know where drawn things are that are no items of ImGui."""
    points, cube = painting.points, overlay.cube

    def noted_points(draw: Any, places: np.ndarray, *rest: Any) -> None:
        driver.points.append(np.array(places))
        points(draw, places, *rest)

    def noted_cube(scene: Any, center: Any, scale: float, mouse: Any) -> str | None:
        driver.cube = (center, scale)
        return cube(scene, center, scale, mouse)

    painting.points, overlay.cube = noted_points, noted_cube
