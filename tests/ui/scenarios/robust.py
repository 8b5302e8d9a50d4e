"""What goes wrong, and what comes of it."""

from __future__ import annotations

import os
import signal
import time
from dataclasses import replace

from tests.ui.driver import CTRL, Driver, Key, Script
from tests.ui.scenarios.things import ball
from volviz.ui import widgets
from volviz.ui.desktop import Desktop
from volviz.ui.im import ImVec2, glfw, imgui, internal
from volviz.ui.layout import VIEW_SHARE
from volviz.ui.panels import PANELS


def broken_panel(d: Driver) -> Script:
    """Its exception is shown in it; what it left open is closed; the rest lives."""
    good = PANELS["data"]

    def fails(scene, facts):
        # as it is without the test engine, which has mistakes end the program while it clicks
        imgui.get_io().config_error_recovery_enable_assert = False
        imgui.push_style_color(imgui.Col_.text, (1, 0, 0, 1))
        imgui.push_id("lost")
        imgui.begin_group()
        imgui.begin_child("###open", ImVec2(50, 50))
        imgui.begin_disabled(True)
        with widgets.form("lost", ("x",)):
            widgets.label("x")
            raise ZeroDivisionError("planted")

    yield from ball(d)
    PANELS["data"] = replace(good, function=fails)
    try:
        yield
        yield
        assert "planted" in d.shell.host.broken["data"]
        yield from d.drag(d.middle, (40, 0))
        assert d.step == "Turn"
        yield from d.type_in("raycast.step", 0.3)
        assert d.scene.raycast.step == 0.3
        yield from d.panel("data")
        d.screen("broken-panel")
        yield from d.click("//###data/Try again")
        yield
        assert sum("planted" in m.text for m in d.app.messages.all) == 1, "told once"
    finally:
        PANELS["data"] = good
    yield from d.click("//###data/Try again")
    yield
    assert "data" not in d.shell.host.broken
    assert "data.copy" in d.seen.where


def _sides(d: Driver) -> dict[str, bool]:
    """Which panels stand left of the picture."""
    found = {n: internal.find_window_by_name(f"{e.title}###{n}") for n, e in PANELS.items()}
    return {n: w.pos.x < d.shell.place[0] for n, w in found.items()}


def _to_size(d: Driver, size: tuple[int, int]) -> Script:
    glfw.set_window_size(d.shell.window.handle, *size)
    yield from d.until(lambda: d.shell.window.size == size)
    for _ in range(6):
        yield


def resized(d: Driver) -> Script:
    """The picture keeps its part of the width; a large window has the layout it had."""
    yield from ball(d)
    size, sides = d.shell.window.size, _sides(d)
    assert set(sides.values()) == {True, False}
    for smaller in ((1000, 700), (920, 600), (700, 500), (480, 320), (900, 700), (700, 500)):
        yield from _to_size(d, smaller)
        share = d.shell.place[2] / smaller[0]
        assert share >= VIEW_SHARE - 0.01, (smaller, share)
        assert d.shell.viewport.size[0] == round(d.shell.place[2])
    yield from d.rest()
    d.screen("small")
    yield from _to_size(d, size)
    assert _sides(d) == sides, "panels do not come back to their sides"
    assert d.shell.place[2] / size[0] >= VIEW_SHARE - 0.01


def minimised(d: Driver) -> Script:
    """Without a framebuffer nothing is drawn and nothing is lost."""
    yield from ball(d)
    kept, pixels = d.scene, Desktop.pixels
    Desktop.pixels = property(lambda _: (0, 0))  # type: ignore[method-assign,assignment]
    try:
        drawn = len(d.shell.times)
        for _ in range(5):
            d.plain()
        assert len(d.shell.times) == drawn
        assert d.shell._wait() == 0.5
    finally:
        Desktop.pixels = pixels  # type: ignore[method-assign]
    yield from d.drag(d.middle, (30, 0))
    assert d.step == "Turn"
    yield from d.undo()
    assert d.scene == kept


def unsaved(d: Driver) -> Script:
    """Closing asks first; what is saved from there closes the window, once it is written."""
    yield from ball(d)
    yield from d.type_in("raycast.step", 0.7)
    d.shell.window.closing = True
    yield from d.until(lambda: d.shell.dialogs.active == "Unsaved changes")
    yield
    yield
    d.screen("unsaved")
    yield from d.click("unsaved.stay")
    assert d.shell.dialogs.active == ""
    assert not d.shell.window.closing
    yield from d.key(Key.z, CTRL)
    assert not d.app.dirty
    left: list[float] = []
    d.shell.quit = lambda: left.append(d.scene.raycast.step)  # type: ignore[method-assign]
    named = d.folder / "kept.volviz.json"
    for step, file in ((0.8, None), (0.9, named)):  # a name is asked for, then it is known
        d.app.file = file
        yield from d.type_in("raycast.step", step)
        d.shell.window.closing = True
        yield from d.until(lambda: "unsaved.save" in d.seen.where)
        yield from d.click("unsaved.save")
        if file is None:
            yield from d.until(lambda: "dialog.do" in d.seen.where)
            yield from d.do(lambda t: t.key_chars_replace_enter(str(named)))
        yield from d.until(lambda n=step: n in left)
        assert f'"step": {step}' in named.read_text()


def idle(d: Driver) -> Script:
    """At rest no frame is due, and the loop sleeps."""
    yield from ball(d)
    yield from d.silence()
    for _ in range(40):
        if d.shell.window.wait(0.05):
            d.plain()
    d.shell.times.clear()
    used, start = time.process_time(), time.monotonic()
    while time.monotonic() < start + 2:
        if d.shell.window.wait(min(d.shell._wait() or 0.0, 0.5)):
            d.plain()
    share = (time.process_time() - used) / (time.monotonic() - start)
    assert share < 0.02, (share, len(d.shell.times))
    yield


def crash(d: Driver) -> Script:
    """Killed, after the scene saved itself."""
    yield from ball(d)
    yield from d.type_in("raycast.step", 0.77)
    d.app.autosave._when -= 1000  # as if its minute were over
    yield from d.until(d.app.autosave.file.exists)
    print("killed", flush=True)
    os.kill(os.getpid(), signal.SIGKILL)


def recovered(d: Driver) -> Script:
    """The next start offers the scene."""
    yield from d.rest()
    d.screen("recover")
    yield from d.click("//###whole/**/###orphan0")
    yield from d.rest()
    assert d.scene.raycast.step == 0.77
    assert d.scene.volume.dims == (40, 40, 40)
