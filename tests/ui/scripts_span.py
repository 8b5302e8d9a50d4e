"""What panels tell of surfaces, in the window: `python -m tests.ui.scripts_span NAME FOLDER`."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np

from tests.ui import injected
from tests.ui.injected import Driver, Script
from tests.ui.scripts_surfaces import extracted, where
from volviz.model.surface_look import SceneSurface
from volviz.ui import tips
from volviz.ui.im import imgui
from volviz.ui.panels import PANELS


def ready(d: Driver) -> Script:
    """A small volume with a surface, drawn quickly."""
    d.app.keep(replace(d.app.settings, axes=False))
    d.shell.open([injected.SAMPLE])
    while d.app.scene is None:
        yield
    quick = d.app.scene.with_knobs(samples=1, step=2.0, shading="none", show_volume=False)
    d.app.change(quick, "Rendering")
    d.app.settle()
    yield from d.rest(120.0)
    yield from d.key(imgui.Key.i)
    yield from extracted(d, 150.0)


def reported(d: Driver) -> Script:
    """The report of a surface unfolds, and follows its isovalue."""
    yield from ready(d)
    yield from alone(d, "surfaces")
    x, y, _ = yield from where(d, "surfaces.0.report")
    yield from d.click(x, y)
    yield from answered(d)
    yield from where(d, "surfaces.0.report.json")
    d.screen("report")


def alone(d: Driver, name: str) -> Script:
    """One panel, as tall as the window."""
    for other in PANELS:
        d.shell.show_panel(other, other == name)
    d.shell.layout.reset()
    for _ in range(6):
        yield


def answered(d: Driver) -> Script:
    """Until nothing is worked out for the panels."""
    for _ in range(2000):
        yield
        slots = d.shell.answers._slots.values()
        if all(s.answer.job is None for s in slots):
            break
    yield from d.rest(120.0)


def spanned(d: Driver) -> Script:
    """Span space follows finder and isovalue; dragging in it is one step; nodes are drawn."""
    yield from ready(d)
    yield from alone(d, "span")
    yield from answered(d)
    d.screen("span-bricks")
    yield from choose(d, "interval-tree")
    d.screen("span-interval-tree")
    steps, before = len(d.app.history.steps), d.app.scene.surfaces[0].surface.isovalue
    x, y, width = yield from where(d, "span.plot")
    yield from d.drag((round(x), round(y)), (round(width / 8), -round(width / 8)))
    yield from answered(d)
    assert len(d.app.history.steps) == steps + 1
    after = d.app.scene.surfaces[0].surface.isovalue
    assert after != before
    slot = d.shell.answers._slots["span.visits"]
    assert slot.answer.value.isovalue == after
    yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert d.app.scene.surfaces[0].surface.isovalue == before
    yield from choose(d, "bono")
    yield from d.rest(120.0)
    bare = d.view().astype(int)
    yield from toggle(d, "span.nodes")
    yield from answered(d)
    d.screen("span-bono")
    lines = (np.abs(d.view().astype(int) - bare).max(axis=-1) > 30).mean()
    assert lines > 0.01
    d.shell.marks._depth = lambda *_: None  # as if nothing covered them
    yield from d.rest(120.0)
    assert (np.abs(d.view().astype(int) - bare).max(axis=-1) > 30).mean() > 1.1 * lines
    del d.shell.marks._depth
    turned = d.app.scene.camera.orbited(40, 20)
    d.app.change(d.app.scene.with_camera(turned), "Turn")
    yield from d.rest(120.0)
    d.screen("span-bono-turned")
    yield from toggle(d, "span.nodes")
    yield from d.rest(120.0)


def choose(d: Driver, finder: str) -> Script:
    """By the list in the panel."""
    x, y, _ = yield from where(d, "span.finder")
    yield from d.click(x, y)
    x, y, _ = yield from where(d, f"span.finder.{finder}")
    yield from d.click(x, y)
    yield from answered(d)
    assert d.app.scene.surfaces[0].surface.finder == finder
    yield from extracted(d, 150.0)


def toggle(d: Driver, name: str) -> Script:
    """A check box: it is at the left end of its item."""
    with tips.watch() as seen:
        yield
        yield
    left, top, _, bottom = seen.where[name]
    yield from d.click(left + 8, (top + bottom) / 2)


def ambiguous(d: Driver) -> Script:
    """Ambiguous cells are marked, gone through, and their rule is chosen by its picture."""
    yield from ready(d)
    yield from alone(d, "surfaces")
    # a field of noise has many of them
    noise = np.random.default_rng(1).standard_normal((24, 24, 24)).astype(np.float32)
    np.save(d.folder / "noise.npy", noise)
    d.shell.open([str(d.folder / "noise.npy")])
    while d.app.scene.volume.dims != (24, 24, 24):
        yield
    surface = SceneSurface.at(1.2)
    quick = d.app.scene.with_knobs(samples=1, show_volume=False).with_surfaces([surface])
    d.app.change(quick, "Surface")
    d.app.settle()
    yield from extracted(d, 150.0)
    bare = d.view().astype(int)
    x, y, _ = yield from where(d, "surfaces.0.cells")
    yield from d.click(x, y)
    yield from answered(d)
    yield from toggle(d, "surfaces.0.cells.on")
    yield from d.rest(120.0)
    assert (np.abs(d.view().astype(int) - bare).max(axis=-1) > 30).mean() > 0.02
    d.screen("cells")
    yield from toggle(d, "surfaces.0.cells.disputed")
    camera, steps = d.app.scene.camera, len(d.app.history.steps)
    x, y, _ = yield from where(d, "surfaces.0.cells.next")
    yield from d.click(x, y)
    yield from answered(d)
    assert d.app.scene.camera.target != camera.target
    d.screen("cell")
    x, y, _ = yield from where(d, "surfaces.0.cells.table15")
    yield from d.click(x, y)
    yield from extracted(d, 150.0)
    assert d.app.scene.surfaces[0].surface.ambiguity == "table15"
    assert len(d.app.history.steps) == steps + 2
    for _ in range(2):
        yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert d.app.scene.camera == camera
    assert d.app.scene.surfaces[0].surface.ambiguity == "trilinear"
    yield from d.rest(120.0)


def colored(d: Driver) -> Script:
    """A surface by a second field, and back."""
    yield from ready(d)
    yield from alone(d, "surfaces")
    yield from d.rest(120.0)
    plain = d.view().astype(int)
    x, y, _ = yield from where(d, "surfaces.0.more")
    yield from d.click(x, y)
    x, y, _ = yield from where(d, "surfaces.0.look.coloring")
    yield from d.click(x, y)
    x, y, _ = yield from where(d, "surfaces.0.look.coloring.field")
    yield from d.click(x, y)
    frames = d.shell.viewport.frames
    while not frames.surfaces[0].fields:
        yield
    yield from d.rest(120.0)
    d.screen("colored")
    seen = d.view().astype(int)
    assert (np.abs(seen - plain).max(axis=-1) > 40).mean() > 0.1
    assert frames.frame.meshes[0].color is None
    yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    yield from d.rest(120.0)
    assert d.app.scene.surfaces[0].look.coloring == "color"
    apart = np.abs(d.view().astype(int) - plain).max(axis=-1)
    assert (apart > 1).mean() < 0.05  # a tooltip may reach into the view


SCRIPTS = (reported, spanned, ambiguous, colored)

if __name__ == "__main__":
    injected.run({s.__name__: s for s in SCRIPTS}[sys.argv[1]], Path(sys.argv[2]))
