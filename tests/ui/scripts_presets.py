"""Gallery and bookmarks in a real window: `python -m tests.ui.scripts_presets NAME FOLDER`.

By injected events (injected.py).
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import volviz
from tests.ui.injected import Driver, Script
from tests.ui.patience import unseen
from volviz.app import App
from volviz.classify import own_presets
from volviz.model.scene import Background
from volviz.model.views import volume_camera
from volviz.model.volume import Volume
from volviz.scene import Scene
from volviz.ui import thumbnails, tips, widgets
from volviz.ui.im import imgui
from volviz.ui.panels import presets
from volviz.ui.shell import Shell
from volviz.ui.window import show


def phantom(seed: int) -> Scene:
    """Bone in soft tissue in air, larger than what thumbnails are drawn of; quickly drawn."""
    z, y, x = np.mgrid[-1:1:90j, -1:1:100j, -1:1:150j]
    radius = np.sqrt(x**2 + y**2 + z**2 * 1.2)
    noise = np.random.default_rng(seed).normal(0, 10, radius.shape)
    hu = np.where(radius < 0.4, 900, np.where(radius < 0.8, 40, -1000)) + noise
    volume = Volume.from_array(
        hu.astype(np.int16), modality="CT", value_unit="HU", space="LPS", name=f"phantom{seed}"
    )
    return Scene.of(volume).with_knobs(samples=1, step=2.0)


def drawn(d: Driver, seconds: float = 120.0) -> Script:
    """Until all thumbnails that are wanted are there."""
    end = time.monotonic() + seconds
    for _ in range(4):
        yield
    while d.shell.shelf.eager or d.shell.shelf.thumbnails._job is not None:
        assert time.monotonic() < end, "the thumbnails are not done"
        with unseen():
            yield
    yield


def kept(d: Driver) -> dict:
    """Finished thumbnails by key."""
    return {k: v.texture for k, v in d.shell.shelf.thumbnails._album.items()}


def pixels(texture) -> np.ndarray:
    width, height = texture.size
    return np.frombuffer(texture.read(), np.uint8).reshape(height, width, 4)[..., :3].astype(int)


def middle(seen: widgets.Watch, id_: str) -> tuple[float, float]:
    left, top, right, bottom = seen.where[id_]
    return (left + right) / 2, (top + bottom) / 2


def look_right(d: Driver) -> None:
    """They are what `render` draws of the same few samples with the same preset."""
    made = kept(d)
    assert len(made) > 20, made
    assert all(t is not None for t in made.values())
    few = thumbnails.few_samples(d.app.scene.volume)
    assert max(few.dims) <= thumbnails.EDGE < max(d.app.scene.volume.dims)
    camera = volume_camera(d.app.scene.volume, zoom=presets.CLOSER)
    shown = {}
    for name in ("ct-bone", "ct-head", "ct-mip", "viridis"):
        (texture,) = [t for (n, _), t in made.items() if n == name]
        scene = Scene.of(few, preset=name).with_camera(camera).with_knobs(step=1.0, samples=2)
        asked = volviz.render(scene, texture.size).pixels[..., :3]
        shown[name] = pixels(texture)
        assert np.abs(shown[name] - asked).mean() < 2.0, name
    empty = Background().bottom[0] * 255
    assert shown["ct-bone"].max() > empty + 60
    assert np.abs(shown["ct-bone"] - shown["ct-head"]).mean() > 3


def thumbnails_of_this_volume(d: Driver, seen: widgets.Watch) -> Script:
    d.app.show(phantom(1), "Open")
    yield from d.rest(100)
    count = d.shell.gpu.live["textures"]
    imgui.set_window_focus("Presets###presets")
    yield from drawn(d)
    look_right(d)
    d.screen("presets")
    first = d.app.scene
    before = d.view()
    yield from d.click(*middle(seen, "presets.ct-aaa"))
    assert d.app.scene.transfer == Scene.of(first.volume, preset="ct-aaa").transfer
    assert len(d.app.history.past) == 1
    yield from d.rest(100)
    assert np.abs(d.view().astype(int) - before).mean() > 1
    yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert d.app.scene is first
    yield from d.rest(100)
    # but for the border of the panel beside, which is lit while it is in front
    assert np.array_equal(d.view()[:, :-4], before[:, :-4]), "undo does not bring the pixels back"
    del first
    yield from gone_with_their_volume(d, count)


def gone_with_their_volume(d: Driver, count: int) -> Script:
    imgui.set_window_focus("Transfer function###transfer")
    d.app.show(phantom(2), "Open")
    yield from d.rest(100)
    assert kept(d) == {}, "thumbnails of another volume"
    d.app.undo()
    yield from d.rest(100)
    assert len(kept(d)) > 20, "the volume is still there, and so are its thumbnails"
    d.app.redo()
    d.app.history = type(d.app.history).of(d.app.scene)
    d.app.saved = d.app.scene
    yield from d.rest(100)
    import gc

    gc.collect()
    yield
    left = d.shell.gpu.live["textures"]
    assert left <= count + 1, (left, count)


def work_waits_while_things_move(d: Driver, seen: widgets.Watch) -> Script:
    d.app.show(phantom(1), "Open")
    yield from d.rest(100)
    imgui.set_window_focus("Presets###presets")
    spent = []
    advance = d.shell.shelf.thumbnails.advance

    def timed(*args, **how):
        start = time.thread_time()
        more = advance(*args, **how)
        spent.append((how["free"], time.thread_time() - start))
        return more

    d.shell.shelf.thumbnails.advance = timed
    while not kept(d):
        yield
    io = imgui.get_io()
    io.add_mouse_pos_event(*d.middle)
    yield
    io.add_mouse_button_event(0, True)
    yield
    count = len(kept(d))
    for i in range(12):
        io.add_mouse_pos_event(d.middle[0] + 5 * i, d.middle[1])
        yield
    assert len(kept(d)) == count, "thumbnails are drawn while the view turns"
    assert [free for free, _ in spent[-8:]] == [False] * 8
    io.add_mouse_button_event(0, False)
    yield from d.rest(100)
    yield from drawn(d)
    assert len(kept(d)) > count
    print("longest share of a frame:", max(s for _, s in spent))


def own_and_bookmarks(d: Driver, seen: widgets.Watch) -> Script:
    own_presets.folder().mkdir(parents=True)
    (own_presets.folder() / "broken.json").write_text('{"name": 3}')
    d.app.show(phantom(1), "Open")
    yield from d.rest(100)
    told = [m for m in d.app.messages.all if "broken.json" in m.text]
    assert len(told) == 1
    assert "name" in told[0].text
    assert told[0].count == 1
    imgui.set_window_focus("Presets###presets")
    yield from drawn(d)
    yield from d.click(*middle(seen, "presets.ct-aaa.star"))
    assert App(folder=d.app.folder).settings.favourites == ("ct-aaa",)
    yield from d.click(*middle(seen, "presets.save"))
    yield
    imgui.get_io().add_input_characters_utf8("Seen today")
    yield
    yield
    yield from d.key(imgui.Key.enter)
    yield
    assert list(own_presets.own().presets) == ["seen-today"]
    assert d.app.scene.transfer.name == "seen-today"
    yield from d.rest(100)
    yield from drawn(d)
    assert any(key[0] == "seen-today" for key in kept(d))
    imgui.get_io().add_mouse_pos_event(*d.middle)
    yield
    yield from d.key(imgui.Key.d, imgui.Key.mod_ctrl)
    start = d.app.scene.camera
    yield from d.drag(d.middle, (90, 30))
    turned = d.app.scene.camera
    yield from d.key(imgui.Key._2, imgui.Key.mod_alt, imgui.Key.mod_shift)
    yield from d.key(imgui.Key._1, imgui.Key.mod_alt)
    assert d.app.scene.camera == start
    yield from d.key(imgui.Key._2, imgui.Key.mod_alt)
    assert d.app.scene.camera == turned
    yield from d.key(imgui.Key._3, imgui.Key.mod_alt)
    assert d.app.scene.camera == turned
    assert [b.name for b in d.app.scene.bookmarks] == ["View 1", "View 2"]
    yield from d.rest(100)
    imgui.set_window_focus("View###view")
    yield from drawn(d)
    one, two = (pixels(t) for k, t in kept(d).items() if k[0] == "bookmark")
    assert np.abs(one - two).mean() > 1
    d.screen("bookmarks")


def run(name: str, folder: Path) -> None:
    def started(shell: Shell) -> None:
        driver = Driver(shell, folder)
        seen = widgets.Watch()
        tips._watches.append(seen)
        script = globals()[name](driver, seen)
        frame = shell.frame

        def driven() -> None:
            frame()
            if next(script, "end") == "end":
                shell.frame = frame
                print("driven")
                shell.leave()
            shell.window.touch()

        shell.frame = driven

    app = App(folder=folder / "config")
    app.keep(replace(app.settings, size=(960, 700)))
    show(app=app, started=started)


if __name__ == "__main__":
    run(sys.argv[1], Path(sys.argv[2]))
