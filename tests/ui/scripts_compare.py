"""The Compare panel and the wipe in a real window: `python -m tests.ui.scripts_compare NAME DIR`.

As scenarios: a scenario is a generator, every `yield` is one frame.
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import volviz
from tests.ui.driver import Driver, Key, Script, drive
from tests.ui.patience import unseen
from volviz.lab import measure, vary
from volviz.model.surface_look import SceneSurface
from volviz.model.volume import Volume
from volviz.samples import sample
from volviz.scene import Scene
from volviz.ui import trials as trying
from volviz.ui.im import imgui

SIDE = trying.SIDE


def ball(seed: int) -> Scene:
    """Soft tissue with a core of bone in air; quickly drawn."""
    z, y, x = np.mgrid[-1:1:24j, -1:1:28j, -1:1:32j]
    radius = np.sqrt(x**2 + y**2 + z**2 * 1.2)
    noise = np.random.default_rng(seed).normal(0, 10, radius.shape)
    hu = np.where(radius < 0.4, 900, np.where(radius < 0.8, 40, -1000)) + noise
    volume = Volume.from_array(
        hu.astype(np.int16), modality="CT", value_unit="HU", space="LPS", name=f"phantom{seed}"
    )
    return Scene.of(volume).with_knobs(samples=2)


def opened(d: Driver, seed: int = 1) -> Script:
    d.app.show(ball(seed), "Open")
    yield from d.rest(100)
    yield from d.panel("compare")
    yield from d.do(lambda t: t.mouse_move_to_pos(imgui.ImVec2(*d.middle)))
    yield


def tried(d: Driver, seconds: float = 120.0) -> Script:
    """Press the button, and wait until all is measured."""
    yield from d.click("compare.run")
    end = time.monotonic() + seconds
    for _ in range(3):
        yield
    while d.shell.trials.running:
        assert time.monotonic() < end, "the variants are not done"
        with unseen():
            yield
    yield


def picture(trial) -> np.ndarray:
    raw = np.frombuffer(trial.texture.read(), np.uint8)
    return raw.reshape(SIDE, SIDE, 4)


def panel(d: Driver) -> Script:
    yield from opened(d)
    before = d.shell.gpu.live
    yield from d.choose("compare.knob", "raycast.shading")
    yield from d.type_in("compare.values", "none, phong")
    yield from tried(d)
    yield from shadings(d)
    yield from wrong_words(d)
    d.screen("compare")
    yield from d.click("compare.errors")
    yield from d.type_in("compare.values", "all")
    yield from tried(d)
    assert [t.rmse for t in d.shell.trials.all] == [None] * 3
    yield from stopped(d)
    d.app.show(ball(2), "Open")
    yield from d.rest(100)
    yield
    assert not d.shell.trials.all, "they belong to a volume that is gone"
    assert d.shell.gpu.live["textures"] <= before["textures"] + 2
    assert d.shell.gpu.live["framebuffers"] <= before["framebuffers"] + 2


def shadings(d: Driver) -> Script:
    """What was tried is what `render` draws, and taking one over is one step of undo."""
    first = d.scene
    found = d.shell.trials.all
    assert [t.variant.changed["raycast.shading"] for t in found] == ["none", "phong"]
    everything = [t.variant.scene for t in found]
    for trial in found:
        assert trial.ms > 0
        assert np.array_equal(picture(trial), volviz.render(trial.variant.scene, (SIDE, SIDE)))
    fine = volviz.render(vary.fine(first, everything[0], everything), (SIDE, SIDE))
    assert found[0].rmse == measure.rmse(measure.difference(found[0].image, fine))
    steps = len(d.app.history.past)
    yield from d.click("compare.0")
    assert d.scene.raycast.shading == "none"
    assert len(d.app.history.past) == steps + 1
    yield from d.undo()
    assert d.scene is first
    yield from d.rest(100)


def wrong_words(d: Driver) -> Script:
    yield from d.type_in("compare.values", "none, fong")
    before = list(d.shell.trials.all)
    yield from d.click("compare.run")
    assert d.shell.trials.all == before
    assert not d.shell.trials.running


def stopped(d: Driver) -> Script:
    yield from d.choose("compare.knob", "raycast.step")
    yield from d.click("compare.errors")
    budget, trying.BUDGET = trying.BUDGET, 0.0
    yield from d.click("compare.run")
    for _ in range(3):
        yield
    assert d.shell.trials.running
    yield from d.click("compare.stop")
    trying.BUDGET = budget
    assert not d.shell.trials.running
    assert not all(t.rmse for t in d.shell.trials.all)
    yield from d.rest(100)


def wipe(d: Driver) -> Script:
    yield from opened(d)
    yield from d.choose("compare.knob", "raycast.mode")
    yield from d.click("compare.errors")
    yield from tried(d)
    yield from d.rest(100)
    plain, before = d.view(), d.shell.gpu.live
    yield from d.click("compare.wipe")
    yield from d.rest(100)
    yield from d.silence()
    d.screen("wipe")
    both_sides(d, ("dvr", "mip"))
    yield from dragged(d)
    camera = d.scene.camera
    yield from d.drag((d.middle[0] + 60, d.middle[1] + 40), (40, 20))
    assert d.scene.camera != camera, "the view under the wipe does not turn"
    yield from d.rest(100)
    yield from d.silence()
    both_sides(d, ("dvr", "mip"))
    yield from d.choose("compare.left", "1")
    yield from d.rest(100)
    yield from d.silence()
    both_sides(d, ("mip", "mip"))
    yield from d.undo()
    assert d.scene.camera == camera
    yield from d.key(Key.escape)
    yield
    assert d.shell.trials.wipe is None
    yield from d.rest(100)
    yield from d.silence()
    assert np.array_equal(d.view(), plain), "not the view from before"
    assert d.shell.gpu.live["framebuffers"] <= before["framebuffers"]
    yield from ends_with_its_volume(d)


def dragged(d: Driver) -> Script:
    x, y, w, h = d.shell.place
    camera = d.scene.camera
    line = (x + d.shell.trials.wipe.at * w, y + 0.25 * h)
    yield from d.drag(line, (-0.2 * w, 0))
    assert abs(d.shell.trials.wipe.at - 0.3) < 0.02
    assert d.scene.camera is camera, "the line turns the view"
    yield from d.rest(100)
    yield from d.silence()
    both_sides(d, ("dvr", "mip"))


def both_sides(d: Driver, modes: tuple[str, str]) -> None:
    """Left and right of the line stand the pixels that `render` draws of either, to the bit."""
    size, at = d.shell.viewport.size, d.shell.trials.wipe.at
    seen = d.view()
    x, rows = round(at * size[0]), slice(int(0.1 * size[1]), int(0.4 * size[1]))
    free = (slice(0, x - 24), slice(x + 24, size[0]))
    drawn = [volviz.render(d.scene.with_knobs(mode=m), size).pixels[..., :3] for m in modes]
    for part, asked in zip(free, drawn, strict=True):
        assert np.array_equal(seen[rows, part], asked[rows, part]), (part, modes)
    if modes[0] != modes[1]:
        assert np.abs(drawn[0].astype(int) - drawn[1]).mean() > 2


def ends_with_its_volume(d: Driver) -> Script:
    yield from d.click("compare.wipe")
    yield from d.rest(100)
    assert d.shell.trials.wipe is not None
    d.app.show(ball(3), "Open")
    yield from d.rest(100)
    yield
    assert d.shell.trials.wipe is None


def surfaces_of_a_sample(d: Driver) -> Script:
    """Methods beside each other: the table has what `volviz.compare` finds, the truth too."""
    scene = Scene.of(sample("sphere", size=24)).with_surfaces([SceneSurface.at(0.0)])
    d.app.show(scene.with_knobs(samples=1, show_volume=False), "Open")
    yield from d.rest(200)
    yield from d.panel("compare")
    yield from d.choose("compare.knob", "surface.method")
    yield from d.type_in("compare.values", "marching-cubes, cuberille")
    yield from tried(d)
    smooth, blocks = (t.facts for t in d.shell.trials.all)
    assert 0 < smooth["truth_rms"] < blocks["truth_rms"]
    assert smooth["euler"] == 2
    imgui.internal.find_window_by_name("Compare###compare").scroll_target = imgui.ImVec2(0, 1e4)
    yield from d.silence()
    d.screen("compare-surfaces")


def presets_of_a_sample(d: Driver) -> Script:
    """For people to look at."""
    d.shell.open(["sample:ct-head"])
    yield from d.rest(200)
    yield from d.panel("compare")
    yield from d.choose("compare.knob", "preset")
    yield from d.click("compare.errors")
    yield from tried(d, 200)
    d.screen("compare-presets")
    yield from d.choose("compare.right", "1")
    yield from d.click("compare.wipe")
    yield from d.rest(200)
    yield from d.silence()
    d.screen("wipe-presets")


def main(name: str, folder: Path) -> None:
    large = name.endswith("of_a_sample")
    size = (1280, 800) if large else (920, 580)
    drive(globals()[name], folder, size=size, axes=large, box=False)
    print("driven")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
