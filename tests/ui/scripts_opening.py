"""Choosing and opening in a real window: `python -m tests.ui.scripts_opening NAME FOLDER`."""

from __future__ import annotations

import gc
import os
import sys
import time
import weakref
from dataclasses import replace
from pathlib import Path

import nibabel
import numpy as np

from tests.io import dicom_maker
from tests.ui import injected
from tests.ui.injected import Driver, Script
from volviz.app import viewer
from volviz.ui import chooser
from volviz.ui.im import imgui

OPENED = 50


def _study(folder: Path) -> Path:
    """Three series, each a ball of another size in noise."""
    for k, (name, count) in enumerate((("LOCALIZER", 3), ("HEAD 1.0 B30", 24), ("HEAD 5.0", 12))):
        z, y, x = np.mgrid[:count, :40, :48]
        middle = (count / 2, 20, 24)
        far = sum((a - m) ** 2 / (m * 0.8) ** 2 for a, m in zip((z, y, x), middle, strict=True))
        values = np.where(far < 1, 1100 + 300 * k, 100).astype(np.uint16)

        def named(ds, _, k=k, name=name):
            ds.SeriesNumber, ds.SeriesDescription, ds.AcquisitionDate = k + 1, name, "20240229"

        place = folder / "study" / f"S{k}"
        dicom_maker.series(place, count, data=values, change=named, uid=f"1.2.{k}")
    return folder / "study"


def _loaded(d: Driver) -> Script:
    """Until nothing is read or wanted; the picture may still be coarse."""
    end = time.monotonic() + 200
    yield
    while d.app.job is not None or d.app.choosing.wanted is not None:
        assert time.monotonic() < end
        yield
    yield
    yield


def _asked(d: Driver) -> Script:
    """Until the question is on the screen with all its pictures."""
    end = time.monotonic() + 200
    while time.monotonic() < end:
        yield
        previews = d.shell.chooser.previews
        if previews is not None and len(previews.made) == len(previews.parts):
            break
    else:
        raise AssertionError("no question")
    for _ in range(4):
        yield


def _click_row(d: Driver, index: int, times: int = 1) -> Script:
    left, top, right, bottom = d.shell.chooser.rows[index]
    io = imgui.get_io()
    delays = io.mouse_single_click_delay, io.mouse_double_click_time
    # a frame may take long where others work too
    io.mouse_single_click_delay, io.mouse_double_click_time = 20.0, 10.0
    io.add_mouse_pos_event((left + right) / 2, (top + bottom) / 2)
    yield
    for _ in range(times):
        io.add_mouse_button_event(0, True)
        io.add_mouse_button_event(0, False)
    for _ in range(6):
        yield
    io.mouse_single_click_delay, io.mouse_double_click_time = delays


def choose_series(d: Driver) -> Script:
    study = str(_study(d.folder))
    d.shell.open([str(d.folder / "ramp.npy")])
    yield from _loaded(d)
    kept = d.app.scene
    d.shell.window._dropped(None, [study])
    yield from _asked(d)
    assert d.shell.dialogs.active == chooser.TITLE
    assert d.shell.chooser.selected == 1, "the one with most samples"
    d.screen("chooser-dark")
    d.shell.toggle_theme()
    for _ in range(3):
        yield
    d.screen("chooser-light")
    previews, textures = d.shell.chooser.previews, list(d.shell.chooser._textures.values())
    assert len(textures) == 3
    yield from d.key(imgui.Key.escape)
    for _ in range(3):
        yield
    assert d.app.scene is kept
    assert d.shell.dialogs.active == ""
    assert d.app.choosing.offer is None
    assert all(type(t.mglo).__name__ == "InvalidObject" for t in textures), "not freed"
    assert not previews.running
    d.shell.open([study])
    yield from _asked(d)
    yield from d.key(imgui.Key.down_arrow)
    yield from d.key(imgui.Key.enter)
    yield from _loaded(d)
    assert d.app.scene.volume.dims == (48, 40, 12)
    yield from d.key(imgui.Key.d, imgui.Key.mod_ctrl, imgui.Key.mod_shift)
    yield from _asked(d)
    assert d.shell.chooser.selected == 2, "what is open"
    yield from _click_row(d, 0, times=2)
    yield from _loaded(d)
    assert d.app.scene.volume.dims == (48, 40, 3)
    d.screen("chosen")
    yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert d.app.scene.volume.dims == (48, 40, 12)
    assert not [m.text for m in d.app.messages.all if m.level == "error"]
    d.shell.open([study])
    yield from _asked(d)  # and the window is closed in front of the question


def film(d: Driver) -> Script:
    t, z, y, x = np.mgrid[:6, :24, :32, :32]
    ball = ((x - 16) ** 2 + (y - 16) ** 2 + (z - 12) ** 2 < (4 + t) ** 2) * 100.0
    values = (ball + np.random.default_rng(0).random(ball.shape)).astype(np.float32)
    nibabel.save(nibabel.Nifti1Image(values.T, np.eye(4)), d.folder / "film.nii.gz")
    d.shell.open([str(d.folder / "film.nii.gz")])
    yield from _loaded(d)
    d.app.change(d.app.scene.with_raycast(samples=1), "Rendering")
    yield from d.rest()
    d.screen("film")
    first, before = d.view(), d.app.scene
    yield from d.key(imgui.Key.period)
    yield from _loaded(d)
    assert d.app.scene.volume.info.time == 1
    assert (d.app.scene.camera, d.app.scene.transfer) == (before.camera, before.transfer)
    assert np.abs(d.view().astype(int) - first).max() > 20
    yield from d.key(imgui.Key.space)
    seen, end = set(), time.monotonic() + 30
    while len(seen) < 6 and time.monotonic() < end:
        seen.add(d.app.scene.volume.info.time)
        yield
    assert len(seen) == 6
    yield from d.key(imgui.Key.space)
    assert not d.app.choosing.playing
    yield from _loaded(d)
    while d.app.history.past and d.app.scene is not before:
        yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert d.app.scene is before
    yield from d.rest()
    bar = np.s_[: first.shape[0] * 3 // 4]  # what is above the bar and its tooltip
    assert np.array_equal(d.view()[bar], first[bar]), "undo does not bring the pixels back"
    d.shell.toggle_theme()
    for _ in range(3):
        yield
    d.screen("film-light")


def odd_names(d: Driver) -> Script:
    folder = d.folder / "odd"
    folder.mkdir()
    names = ["日本語.npy", "a##b.npy", "100%s%n.npy", "x" * 200 + ".npy", os.fsdecode(b"\xe9.npy")]
    for k, name in enumerate(names):
        np.save(folder / name, np.random.default_rng(k).random((5, 6, 7)))
        d.shell.open([str(folder / name)])
        yield from _loaded(d)
        assert d.app.scene.source.path == str(folder / name), d.app.messages.all
    assert len(d.app.settings.recent) == len(names)
    yield from d.key(imgui.Key.o, imgui.Key.mod_ctrl)
    for _ in range(4):
        yield
    assert len(d.shell.dialogs._browser._names) == len(names)
    d.screen("odd-names")
    browser = d.shell.dialogs._browser
    for text in ("/" + "y" * 5000, "", "~nobody/a", "/" + "z/" * 1500, "file://%00"):
        browser.text = text
        for _ in range(3):
            yield
        assert d.shell.dialogs.active == "Open"
    yield from d.key(imgui.Key.escape)
    yield from d.click(20, 12)
    for _ in range(3):
        yield
    yield from d.click(60, 90)
    for _ in range(3):
        yield
    d.screen("odd-recent")
    d.shell.dialogs.save_scene()
    for _ in range(3):
        yield
    d.shell.dialogs._browser.text = "/" + "y" * 5000
    for _ in range(3):
        yield
    yield from d.key(imgui.Key.escape)
    assert not [m for m in d.app.messages.all if m.level == "error"]


def broken_layout(d: Driver) -> Script:
    yield from _loaded(d)
    folder = d.folder / "config"
    assert (folder / "layout.ini.bad").read_bytes() == b"\xff\xfe\x00 no layout"
    assert (folder / "settings.json.bad").exists()
    told = [m.text for m in d.app.messages.all if m.level == "warning"]
    assert len(told) == 2, told
    d.shell.open([str(d.folder / "ramp.npy")])
    yield from _loaded(d)
    x, y, w, h = d.shell.place
    assert w > 300, (x, y, w, h)


def closed_while_loading(d: Driver) -> Script:
    ended = []

    def slow(progress):
        try:
            while True:
                progress(0.3, "reading")
                time.sleep(0.01)
        finally:
            ended.append(time.monotonic())

    d.app.load("slow.nrrd", slow)
    for _ in range(5):
        yield
    close = d.shell.close

    def closed():
        asked = time.monotonic()
        close()
        while not ended and time.monotonic() < asked + 2:
            time.sleep(0.01)
        assert ended[0] - asked < 0.5
        print("closed in time")

    d.shell.close = closed


def fifty(d: Driver) -> Script:
    viewer.KEPT_BYTES = 8 << 20
    d.app.keep(replace(d.app.settings, panels=False))
    alive, memory, textures = [], [], []
    for k in range(OPENED):
        shape = (96 + k % 7, 128 + k % 5, 64)  # so that a leak is more than the allocator strays
        values = np.random.default_rng(k).integers(0, 255, shape, np.uint8)
        np.save(d.folder / f"{k}.npy", values)
        d.shell.open([str(d.folder / f"{k}.npy")])
        yield from _loaded(d)
        assert d.app.scene.volume.dims == shape[::-1]
        alive.append(weakref.ref(d.app.scene.volume))
        (d.folder / f"{k}.npy").unlink()
        gc.collect()
        memory.append(_resident())
        textures.append(d.shell.gpu.live["textures"])
    left = sum(ref() is not None for ref in alive)
    each = 99 * 130 * 64
    print(f"{left} volumes of {OPENED} live, textures {textures[10]} then {textures[-1]}")
    print(f"resident {memory[9] >> 20} MiB after 10, {memory[-1] >> 20} MiB after {OPENED}")
    assert left <= (8 << 20) // each + 3
    # a table for each volume that undo reaches, and what one picture and the window need
    assert max(textures) <= left + 10, textures
    # what one volume in the making takes for a moment is no growth
    assert min(memory[-5:]) - memory[19] < 30 * 3 * each / 2, memory


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * 4096


SCRIPTS = (choose_series, film, odd_names, broken_layout, closed_while_loading, fifty)


if __name__ == "__main__":
    place = Path(sys.argv[2])
    if sys.argv[1] == "broken_layout":
        (place / "config").mkdir()
        (place / "config" / "layout.ini").write_bytes(b"\xff\xfe\x00 no layout")
        (place / "config" / "settings.json").write_bytes(b"{broken")
    injected.run({s.__name__: s for s in SCRIPTS}[sys.argv[1]], place)
