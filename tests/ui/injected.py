"""Scripts played in a real window by injected events, for what the test engine cannot go through:
a window that is built anew, other processes that look on.

A script is a generator: every `yield` is one frame of the window. Events go in through ImGui's
queue, where GLFW's callbacks put theirs. It ends with asserts; "driven" is printed last.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
from PIL import ImageGrab

from tests.ui.patience import nap, seen, unseen
from volviz.app import App
from volviz.model.volume import Volume
from volviz.ui.im import imgui
from volviz.ui.shell import Shell
from volviz.ui.window import show

SAMPLE = "sample:marschner-lobb"
Script = Iterator[None]


class Driver:
    """A shell, and hands and eyes for it."""

    def __init__(self, shell: Shell, folder: Path) -> None:
        self.shell, self.app, self.folder = shell, shell.app, folder

    def rest(self, seconds: float = 120.0) -> Script:
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

    def key(self, key: imgui.Key, *mods: imgui.Key) -> Script:
        io = imgui.get_io()
        for k in (*mods, key):
            io.add_key_event(k, True)
        yield
        for k in (*mods, key):
            io.add_key_event(k, False)
        yield

    def drag(self, start: tuple[int, int], move: tuple[int, int], button: int = 0) -> Script:
        io = imgui.get_io()
        io.add_mouse_pos_event(*start)
        yield
        yield
        io.add_mouse_button_event(button, True)
        yield
        for i in range(1, 9):
            io.add_mouse_pos_event(start[0] + move[0] * i / 8, start[1] + move[1] * i / 8)
            yield
        io.add_mouse_button_event(button, False)
        yield
        yield

    def click(self, x: float, y: float) -> Script:
        yield from self.drag((round(x), round(y)), (0, 0))

    def screen(self, name: str = "") -> np.ndarray:
        """uint8[h, w, 3] of the X display, kept as an artefact if it has a name."""
        assert seen(), "nothing is shown"
        self.shell.gpu.ctx.finish()
        taken = ImageGrab.grab(xdisplay=os.environ["DISPLAY"]).convert("RGB")
        if name:
            taken.save(self.folder / f"window-{name}.png")
        x, y = self.position()
        return np.asarray(taken)[y:, x:].copy()

    def position(self) -> tuple[int, int]:
        from volviz.ui.im import glfw

        return glfw.get_window_pos(self.shell.window.handle)

    @property
    def middle(self) -> tuple[int, int]:
        x, y, w, h = self.shell.place
        return round(x + w / 2), round(y + h / 2)

    def view(self) -> np.ndarray:
        """The pixels of the 3D view on the screen."""
        x, y, _, _ = (round(n) for n in self.shell.place)
        w, h = self.shell.viewport.size
        return self.screen()[y : y + h, x : x + w]


def run(script_of: Callable[[Driver], Script], folder: Path) -> None:
    volume = np.linspace(0, 1, 20 * 25 * 30, dtype=np.float32).reshape(20, 25, 30)
    np.save(folder / "ramp.npy", volume)
    assert Volume.from_array(volume).dims == (30, 25, 20)

    def started(shell: Shell) -> None:
        driver = Driver(shell, folder)
        script = script_of(driver)
        frame = shell.frame

        def driven() -> None:
            frame()
            if next(script, "end") == "end":
                shell.frame = frame
                print("driven")
                shell.leave()
            nap(shell)
            shell.window.touch()

        shell.frame = driven

    show(app=App(folder=folder / "config"), started=started)
