"""What a user does, driven in a real window: `python -m tests.ui.scenarios NAME FOLDER`.

A scenario is a generator: every `yield` is one frame of the window. Events go in through ImGui's
queue, where GLFW's callbacks put theirs. It ends with asserts; "driven" is printed last.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from PIL import Image, ImageGrab

import volviz
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

    def rest(self, seconds: float = 30.0) -> Script:
        """Until nothing is loaded and the picture is whole."""
        end = time.monotonic() + seconds
        for _ in range(3):
            yield
        while time.monotonic() < end:
            still = self.app.job is None and self.shell.picture is None
            if still and (self.app.scene is None or self.shell.viewport.state.done):
                break
            yield
        else:
            raise AssertionError("the window does not come to rest")
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


def same_as_render(d: Driver) -> Script:
    d.app.keep(volviz.app.settings.Settings(axes=False))
    d.shell.open([SAMPLE])
    yield from d.rest()
    for _ in range(3):
        yield
    seen = d.view()
    scene = d.app.scene
    headless = volviz.render(scene, d.shell.viewport.size).pixels[..., :3]
    assert seen.shape == headless.shape, (seen.shape, headless.shape)
    off = np.abs(seen.astype(int) - headless)
    assert off.mean() < 0.3, off.mean()
    assert (off > 16).mean() < 0.01


def mouse_and_keys(d: Driver) -> Script:
    d.shell.open([SAMPLE])
    yield from d.rest()
    first, camera = d.view(), d.app.scene.camera
    kinds = ((0, (), "Turn"), (2, (), "Pan"), (1, (), "Zoom"))
    for button, _, label in kinds:
        before = d.app.history
        yield from d.drag(d.middle, (70, 45), button)
        assert [s.label for s in d.app.history.past[len(before.past) + 1 :]] == []
        assert d.app.history.present.label == label
    yield from d.rest()
    assert np.abs(d.view().astype(int) - first).mean() > 2
    imgui.get_io().add_mouse_wheel_event(0, 2)
    yield
    yield
    assert d.app.history.present.label == "Zoom"
    for _ in range(10):
        yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert d.app.scene.camera == camera
    yield from d.rest()
    assert np.array_equal(d.view(), first), "undo does not bring the pixels back"
    imgui.get_io().add_mouse_pos_event(*d.middle)
    yield
    imgui.get_io().add_mouse_button_event(0, True)
    imgui.get_io().add_mouse_button_event(0, False)
    imgui.get_io().add_mouse_button_event(0, True)
    imgui.get_io().add_mouse_button_event(0, False)
    for _ in range(6):
        yield
    assert d.app.history.present.label == "Focus", [s.label for s in d.app.history.steps]
    yield from d.key(imgui.Key._5)
    assert d.app.scene.camera.projection == "orthographic"
    yield from d.key(imgui.Key._1, imgui.Key.mod_ctrl)
    assert d.app.history.present.label == "View: back"
    yield from d.key(imgui.Key.f9)
    yield from d.rest()
    assert d.shell.viewport.size[0] == d.shell.window.size[0]


def opening(d: Driver) -> Script:
    yield from d.rest()
    d.screen("welcome")
    d.shell.window._dropped(None, [str(d.folder / "none.nrrd")])
    yield from d.rest()
    assert d.app.scene is None
    assert "none.nrrd" in d.app.messages.all[-1].text
    d.shell.window._dropped(None, [str(d.folder / "ramp.npy")])
    yield from d.rest()
    assert d.app.scene.volume.dims == (30, 25, 20)
    kept = d.app.scene
    (d.folder / "broken.nrrd").write_bytes(b"NRRD0004\nsizes: banana\n\n")
    d.shell.window._dropped(None, [str(d.folder / "broken.nrrd")])
    yield from d.rest()
    assert d.app.scene is kept
    yield from d.key(imgui.Key.o, imgui.Key.mod_ctrl)
    yield
    assert d.shell.dialogs.active == "Open"
    d.screen("open")
    yield from d.key(imgui.Key.a, imgui.Key.mod_ctrl)
    imgui.get_io().add_input_characters_utf8(SAMPLE)
    yield
    yield
    yield from d.key(imgui.Key.enter)
    yield from d.rest()
    assert d.app.scene.volume.name == "marschner-lobb", d.app.scene.volume
    assert d.app.settings.recent[0] == SAMPLE
    yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert d.app.scene is kept


def saving(d: Driver) -> Script:
    d.shell.open([str(d.folder / "ramp.npy")])
    yield from d.rest()
    d.app.change(d.app.scene.with_raycast(shading="phong", samples=2), "Rendering")
    assert d.app.dirty
    d.app.save(d.folder / "ramp")
    yield from d.rest()
    assert not d.app.dirty
    saved = d.app.scene
    d.shell.open([str(d.folder / "ramp.volviz.json")])
    yield from d.rest()
    assert d.app.scene.raycast == saved.raycast
    assert d.app.scene.camera == saved.camera
    d.shell.take_picture(d.folder / "ramp.png", (120, 90), True)
    yield from d.rest()
    picture = np.asarray(Image.open(d.folder / "ramp.png"))
    assert picture.shape == (90, 120, 4)
    assert picture[0, 0, 3] == 0
    yield from d.key(imgui.Key.f12)
    yield from d.rest()
    (quick,) = d.folder.glob("ramp-*.png")
    assert Image.open(quick).size == d.shell.viewport.size
    d.app.change(d.app.scene.with_raycast(step=0.7), "Rendering")
    d.shell.window.closing = True
    yield
    yield
    yield
    assert d.shell.dialogs.active == "Unsaved changes"


def broken_panel(d: Driver) -> Script:
    from volviz.ui.panels import PANELS, Entry

    def fails(scene, facts):
        raise ZeroDivisionError("planted")

    PANELS["data"] = Entry("Data", fails, "left")
    d.shell.open([SAMPLE])
    yield from d.rest()
    assert "planted" in d.shell.host.broken["data"]
    assert sum("planted" in m.text for m in d.app.messages.all) == 1
    yield from d.drag(d.middle, (40, 0))
    assert d.app.history.present.label == "Turn"
    d.screen("broken-panel")


def cancel(d: Driver) -> Script:
    stopped = []

    def slow(progress):
        try:
            for i in range(2000):
                progress(i / 2000, "reading")
                time.sleep(0.01)
        except volviz.VolvizError:
            stopped.append(time.monotonic())
            raise

    d.shell.open([SAMPLE])
    yield from d.rest()
    kept = d.app.scene
    d.app.load("slow.nrrd", slow)
    until = time.monotonic() + 1.2
    while time.monotonic() < until:
        yield
    assert d.app.job.remaining is not None
    d.screen("loading")
    d.app.cancel()
    asked = time.monotonic()
    while not stopped and time.monotonic() < asked + 2:
        yield
    assert stopped[0] - asked < 0.5
    assert d.app.scene is kept


def idle(d: Driver) -> Script:
    d.shell.open([SAMPLE])
    yield from d.rest()


def looks(d: Driver) -> Script:
    d.shell.open(["sample:ct-head"])
    yield from d.rest(120)
    d.screen("dark")
    yield from d.key(imgui.Key.h)
    yield
    yield
    d.screen("help")
    yield from d.key(imgui.Key.h)
    assert d.shell.dialogs.active == ""
    yield from d.key(imgui.Key.b)
    yield from d.key(imgui.Key.l, imgui.Key.mod_ctrl)
    yield from d.click(20, 12)
    yield
    yield
    d.screen("light-menu")


def run(name: str, folder: Path) -> None:
    volume = np.linspace(0, 1, 20 * 25 * 30, dtype=np.float32).reshape(20, 25, 30)
    np.save(folder / "ramp.npy", volume)
    assert Volume.from_array(volume).dims == (30, 25, 20)

    def started(shell: Shell) -> None:
        driver = Driver(shell, folder)
        script = globals()[name](driver)
        frame = shell.frame

        def driven() -> None:
            frame()
            if next(script, "end") == "end":
                shell.frame = frame
                if name == "idle":
                    _measure_idle(shell)
                print("driven")
                shell.leave()
            shell.window.touch()

        shell.frame = driven

    show(app=App(folder=folder / "config"), started=started)


def _measure_idle(shell: Shell) -> None:
    for _ in range(40):
        if shell.window.wait(0.05):
            shell.frame()
    used, drawn, start = time.process_time(), len(shell.times), time.monotonic()
    shell.times.clear()
    while time.monotonic() < start + 3:
        if shell.window.wait(min(shell._wait() or 0.0, 0.5)):
            shell.frame()
    share = (time.process_time() - used) / (time.monotonic() - start)
    assert share < 0.02, (share, drawn, len(shell.times))
    print(f"idle: {share:.2%} of a processor, {len(shell.times)} frames")


if __name__ == "__main__":
    run(sys.argv[1], Path(sys.argv[2]))
