"""No surface is made on the window's thread: `python -m tests.ui.scripts_threads NAME FOLDER`.

What extracts is wrapped so that it tells its thread; pictures are those that `render` draws.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np

import volviz
from tests.ui.driver import Driver, Script, drive
from tests.ui.patience import unseen
from tests.ui.scripts_compare import ball, picture, tried
from volviz import isosurface
from volviz.errors import Cancelled
from volviz.isosurface import adaptive
from volviz.model.surface import Surface
from volviz.model.surface_look import SceneSurface
from volviz.ui.trials import SIDE


class Told:
    """Which surfaces were made, and whether on the window's thread; `gate` holds them up."""

    def __init__(self) -> None:
        self.made: list[tuple[Surface, bool]] = []
        self.gate: threading.Event | None = None
        self.waiting = self.cancelled = False

    def take(self, surface: Surface, progress) -> None:
        self.made.append((surface, threading.current_thread() is threading.main_thread()))
        self.waiting = self.gate is not None
        while self.gate is not None and not self.gate.wait(0.02):
            try:
                progress(0.5, "held up")
            except Cancelled:
                self.cancelled = True
                raise

    def check(self, *isovalues: float) -> None:
        """These were made since the last time, none of them here."""
        assert not [s for s, here in self.made if here], "on the window's thread"
        assert {*isovalues} <= {s.isovalue for s, _ in self.made}
        self.made.clear()


@contextmanager
def told() -> Iterator[Told]:
    found, plain, lensed = Told(), isosurface.extract, adaptive.extract

    def extract(volume, surface, progress=None):
        if max(volume.dims) > 3:  # what only warms up the compiler counts elsewhere
            found.take(surface, progress)
        return plain(volume, surface, progress)

    def extract_lensed(volume, surface, progress=None):
        found.take(surface, progress)
        return lensed(volume, surface, progress)

    isosurface.extract, adaptive.extract = extract, extract_lensed
    try:
        yield found
    finally:
        isosurface.extract, adaptive.extract = plain, lensed


def opened(d: Driver, panel: str, lens: bool = False) -> Script:
    scene = ball(1).with_surfaces([SceneSurface.at(200.0)])
    d.app.show(scene.with_knobs(show_volume=False, samples=1, lens=lens), "Open")
    while not any(d.shell.viewport.frames.surfaces):
        yield
    yield from d.rest(100)
    yield from d.panel(panel)


def same_as_rendered(d: Driver) -> None:
    for trial in d.shell.trials.all:
        drawn = volviz.render(trial.variant.scene, (SIDE, SIDE))
        assert np.array_equal(picture(trial), drawn), trial.title
    first, *others = (picture(t) for t in d.shell.trials.all)
    assert all((first != other).any() for other in others), "they show the same"


def compare(d: Driver, lens: bool = False) -> Script:
    with told() as seen:
        yield from opened(d, "compare", lens)
        yield from d.choose("compare.knob", "surface.isovalue")
        yield from d.click("compare.errors")
        yield from d.type_in("compare.values", "-500, 500")
        yield from tried(d)
        seen.check(-500, 500)
        same_as_rendered(d)
        seen.made.clear()
        seen.gate = threading.Event()
        yield from d.type_in("compare.values", "-300, 300")
        yield from d.click("compare.run")
        yield from until(lambda: seen.waiting)
        assert d.shell.trials.running
        yield from d.click("compare.stop")
        yield from stopped_soon(seen)
        assert not d.shell.trials.running
        seen.check(-300)


def compare_under_lens(d: Driver) -> Script:
    yield from compare(d, lens=True)


def until(happened, seconds: float = 200.0) -> Script:
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end, "it does not happen"
        with unseen():
            yield
    yield


def stopped_soon(seen: Told) -> Script:
    yield from until(lambda: seen.cancelled, 5.0)
    seen.gate = None


def wipe(d: Driver) -> Script:
    with told() as seen:
        yield from opened(d, "compare")
        yield from d.choose("compare.knob", "surface.isovalue")
        yield from d.type_in("compare.values", "-500, 500")
        yield from d.click("compare.errors")
        yield from tried(d)
        yield from d.click("compare.wipe")
        yield from wiped(d)
        seen.made.clear()
        before = free(d)
        seen.gate = threading.Event()
        yield from turned(d, "sobel")
        yield from until(lambda: seen.waiting)
        yield from d.rest(100)
        yield from until(lambda: d.shell.trials.preparing is not None)
        assert np.array_equal(free(d), before), "not the last good picture"
        seen.gate.set()
        yield from wiped(d)
        seen.check(-500, 500)
        yield from ended(d, seen)


def free(d: Driver) -> np.ndarray:
    """The part of the view over which nothing tells how far it is."""
    return d.view()[: d.shell.viewport.size[1] // 2]


def ended(d: Driver, seen: Told) -> Script:
    """Esc while its surfaces are made, or wait for those of the view: they are given up."""
    seen.gate = threading.Event()
    yield from turned(d, "forward")
    yield from until(lambda: d.shell.trials.preparing is not None)
    jobs = [side.resolving.job for side in d.shell.trials.wipe.sides]
    d.shell.trials.wipe.closed = True
    yield from until(lambda: d.shell.trials.wipe is None, 5.0)
    yield from until(lambda: all(job.finished for job in jobs), 5.0)
    assert all(isinstance(job.error, Cancelled) for job in jobs)
    seen.gate = None
    seen.check()


def turned(d: Driver, normals: str) -> Script:
    surface = d.scene.surfaces[0]
    new = SceneSurface.at(surface.surface.isovalue, normals=normals)
    d.app.change(d.scene.with_surfaces([new]), "Normals")
    yield


def wiped(d: Driver) -> Script:
    """Until both sides are whole, and the pixels that `render` draws of either."""
    yield
    yield from until(lambda: d.shell.trials.wipe.sides[1].frame is not None)
    yield from until(lambda: not d.shell.trials.wipe._waiting)
    yield from d.rest(100)
    yield from d.silence()
    size, at = d.shell.viewport.size, d.shell.trials.wipe.at
    x, rows = round(at * size[0]), slice(int(0.1 * size[1]), int(0.4 * size[1]))
    for value, part in ((-500.0, slice(0, x - 24)), (500.0, slice(x + 24, size[0]))):
        surface = SceneSurface.at(value, normals=d.scene.surfaces[0].surface.normals)
        drawn = volviz.render(d.scene.with_surfaces([surface]), size).pixels[..., :3]
        assert np.array_equal(d.view()[rows, part], drawn[rows, part]), value


def thumbnails(d: Driver) -> Script:
    with told() as seen:
        yield from opened(d, "presets")
        shelf = d.shell.shelf.thumbnails
        yield from until(lambda: len(shelf._album) > 2)
        seen.check(200)
        assert all(kept.texture is not None for kept in shelf._album.values())


def export(d: Driver) -> Script:
    with told() as seen:
        yield from opened(d, "view", lens=True)
        seen.made.clear()
        path = d.folder / "lensed.png"
        d.shell.exports.take_picture(path, (160, 120))
        yield from until(path.exists)
        seen.check(200)


def main(name: str, folder: Path) -> None:
    drive(globals()[name], folder, size=(920, 580), axes=False, box=False)
    print("driven")


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
