"""Opening, saving, pictures, cancel."""

from __future__ import annotations

import time

import numpy as np
from PIL import Image

from tests.ui.driver import CTRL, Driver, Key, Script
from tests.ui.scenarios.things import BROKEN, RAMP, ball, given
from volviz.errors import Cancelled


def dropped(d: Driver) -> Script:
    """Files on the window: good ones open, others are told and change nothing."""
    yield from d.open(given(d, "none.nrrd"))
    assert d.app.scene is None
    assert "none.nrrd" in d.app.messages.all[-1].text
    yield from d.open(given(d, RAMP))
    assert d.scene.volume.dims == (30, 25, 20)
    yield from d.silence()
    kept, shown = d.scene, d.view()
    yield from d.open(given(d, BROKEN))
    assert d.scene is kept
    assert BROKEN in d.app.messages.all[-1].text
    yield from d.silence()
    assert np.array_equal(d.view(), shown)
    yield from d.open(*[given(d, RAMP)] * 10)
    assert any("10 files" in m.text for m in d.app.messages.all)
    assert d.scene.volume.dims == (30, 25, 20)


def typed_path(d: Driver) -> Script:
    """Ctrl+O, a path, Enter; and undo brings back what was open."""
    yield from ball(d)
    kept = d.scene
    yield from d.key(Key.o, CTRL)
    assert d.shell.dialogs.active == "Open"
    yield from d.do(lambda t: t.key_chars_replace_enter(given(d, RAMP)))
    yield from d.rest()
    assert d.scene.volume.dims == (30, 25, 20)
    assert d.app.settings.recent[0].endswith(RAMP)
    yield from d.undo()
    assert d.scene is kept
    yield from d.redo()
    assert d.scene.volume.dims == (30, 25, 20)


def raw(d: Driver) -> Script:
    """A file that nothing describes: what it holds is asked, a guess and a number do."""
    voxels = np.arange(16**3, dtype=np.uint16)
    file = d.folder / "unknown.raw"
    file.write_bytes(bytes(10) + voxels.tobytes())
    d.drop(str(file))
    yield from d.until(lambda: "raw.dims" in d.seen.where)
    yield
    d.screen("raw")
    yield from d.choose("raw.dtype", "uint16")
    left, top, right, bottom = d.where("raw.dims")
    for part in (1, 3, 5):
        place = left + part * (right - left) / 6, (top + bottom) / 2
        yield from d.press(*place, times=2)
        yield from d.do(lambda t: t.key_chars_replace_enter("16"))
    yield from d.until(lambda: "raw.skip" in d.seen.where)
    d.screen("raw-skip")
    yield from d.click("raw.skip")
    yield from d.click("raw.open")
    yield from d.rest()
    assert np.array_equal(d.scene.volume.data.ravel(), voxels)
    assert d.shell.dialogs.active == ""


def saved_and_reopened(d: Driver) -> Script:
    """A scene file brings back what was saved, to the pixel."""
    yield from ball(d)
    yield from d.choose("raycast.shading", "phong")
    yield from d.drag(d.middle, (50, 20))
    assert d.app.dirty
    d.app.save(d.folder / "kept")
    yield from d.rest()
    assert not d.app.dirty
    yield from d.silence()
    saved, seen = d.scene, d.view()
    yield from d.open(given(d, RAMP))
    yield from d.open(str(d.folder / "kept.volviz.json"))
    yield from d.silence()
    assert d.scene.raycast == saved.raycast
    assert d.scene.camera == saved.camera
    assert d.scene.transfer == saved.transfer
    assert np.array_equal(d.view(), seen)


def pictures(d: Driver) -> Script:
    """F12 writes what is seen; any size and a clear background on request."""
    yield from ball(d)
    yield from d.key(Key.x)
    yield from d.silence()
    seen = d.view()
    before = set(d.folder.parent.glob("*.png"))
    yield from d.key(Key.f12)
    yield from d.rest()
    (quick,) = set(d.folder.parent.glob("*.png")) - before
    with Image.open(quick) as opened:
        assert opened.size == d.shell.viewport.size
        off = np.abs(np.asarray(opened.convert("RGB")).astype(int) - seen)
    assert off.mean() < 0.3, off.mean()
    d.shell.exports.take_picture(d.folder / "small.png", (120, 90), True)
    yield from d.rest()
    with Image.open(d.folder / "small.png") as opened:
        picture = np.asarray(opened)
    assert picture.shape == (90, 120, 4)
    assert picture[0, 0, 3] == 0
    assert picture[45, 60, 3] > 0


def cancelled(d: Driver) -> Script:
    """The button stops a slow load within half a second; what was open stays."""
    stopped: list[float] = []
    asked: list[float] = []

    def slow(progress):
        try:
            for i in range(2000):
                progress(i / 2000, "reading")
                time.sleep(0.01)
        except Cancelled:
            stopped.append(time.monotonic())
            raise

    def act(t):
        t.mouse_move("//###busy/Cancel")
        asked.append(time.monotonic())
        t.mouse_click(0)

    yield from ball(d)
    kept = d.scene
    d.app.load("slow.nrrd", slow)
    yield from d.until(lambda: d.app.job is not None and d.app.job.remaining is not None)
    yield
    d.screen("loading")
    yield from d.do(act)
    yield from d.until(lambda: bool(stopped), 5)
    assert stopped[0] - asked[0] < 0.5
    assert d.app.job is None
    assert d.scene is kept
