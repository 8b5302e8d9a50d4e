"""Surfaces in the window, by injected events: `python -m tests.ui.scripts_surfaces NAME FOLDER`."""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

import volviz
from tests.ui import injected
from tests.ui.injected import Driver, Script
from tests.ui.patience import unseen
from volviz.samples import sample
from volviz.ui import tips
from volviz.ui.im import imgui

SIZE = 128
"""Samples of the head from top to bottom."""


def ready(d: Driver) -> Script:
    d.app.keep(replace(d.app.settings, axes=False))
    d.app.show(volviz.Scene.of(sample("ct-head", size=SIZE)), "Open")
    d.app.change(d.app.scene.with_knobs(samples=1, step=2.0, shading="none"), "Rendering")
    d.app.settle()
    yield from d.rest(60.0)


def extracted(d: Driver, seconds: float = 200.0) -> Script:
    """Until every surface is the one that the scene asks for, and the picture is whole."""
    end = time.monotonic() + seconds
    yield
    while True:
        frames = d.shell.viewport.frames
        wanted = [(s.surface, s.refining) for s in d.app.scene.surfaces if s.look.visible]
        if [(f.surface, f.refining) for f in frames.surfaces if f is not None] == wanted:
            break
        assert time.monotonic() < end, "no surface comes"
        with unseen():
            yield
    yield from d.rest()


def where(d: Driver, name: str) -> Script:
    """The middle of a widget of the present frame, and its width."""
    with tips.watch() as seen:
        yield
        yield
    left, top, right, bottom = seen.where[name]
    return (left + right) / 2, (top + bottom) / 2, right - left


def adding(d: Driver) -> Script:
    yield from ready(d)
    bare = d.view()
    steps = len(d.app.history.steps)
    yield from d.key(imgui.Key.i)
    yield from extracted(d)
    assert [s.surface.isovalue for s in d.app.scene.surfaces] == [300.0]
    assert np.abs(d.view().astype(int) - bare).max() > 40
    yield from d.key(imgui.Key.i)
    yield from extracted(d)
    first, second = d.app.scene.surfaces
    assert second.surface.isovalue < first.surface.isovalue
    assert second.look.opacity < 1
    assert len(d.app.history.steps) == steps + 2
    d.screen("surfaces")
    shown = d.view()
    size = d.shell.viewport.size
    wanted = volviz.render(d.app.scene, size).pixels[..., :3].astype(int)
    assert (np.abs(shown - wanted) <= 1).all(axis=-1).mean() > 0.99
    yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    yield from d.rest()
    assert d.app.scene.surfaces == ()
    assert np.abs(d.view().astype(int) - bare).max() <= 1


def sliding(d: Driver) -> Script:
    """A drag of the isovalue is live, never leaves the view without a surface, and is one step."""
    yield from ready(d)
    yield from d.key(imgui.Key.i)
    yield from extracted(d)
    steps = len(d.app.history.steps)
    x, y, width = yield from where(d, "surfaces.0.slider")
    io, frames = imgui.get_io(), d.shell.viewport.frames
    made, values, slowest = set(), set(), 0.0
    io.add_mouse_pos_event(x - width / 4, y)
    yield
    yield
    io.add_mouse_button_event(0, True)
    for i in range(40):
        io.add_mouse_pos_event(x - width / 4 + i * width / 80, y)
        start = time.perf_counter()
        yield
        slowest = max(slowest, time.perf_counter() - start)
        assert frames.surfaces[0] is not None
        assert frames.frame.meshes
        made.add(frames.surfaces[0].surface.isovalue)
        values.add(d.app.scene.surfaces[0].surface.isovalue)
    io.add_mouse_button_event(0, False)
    yield
    yield from extracted(d)
    assert len(values) > 10
    assert 1 < len(made) <= len(values) + 1
    assert len(d.app.history.steps) == steps + 1
    d.screen("surface-slid")
    print(f"{len(values)} values, {len(made)} surfaces, slowest frame {1000 * slowest:.0f} ms")


def parts_of(faces: np.ndarray) -> int:
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    return len(trimesh.graph.connected_components(edges))


def refined(d: Driver) -> Script:
    """The largest part only: drawn, undone and done again, none of it extracted anew."""
    first = d.shell.viewport.frames.surfaces[0]
    assert parts_of(first.mesh.faces) > 1
    fold = yield from where(d, "surfaces.0.after")
    yield from d.click(*fold[:2])
    x, y, _ = yield from where(d, "surfaces.0.after.keep_largest")
    yield from d.click(x, y)
    yield from extracted(d)
    d.screen("after-extraction")
    assert d.app.history.present.label == "Keep largest"
    drawn = d.shell.viewport.frames.surfaces[0]
    assert parts_of(drawn.mesh.faces) == 1
    assert drawn.before is first
    assert d.shell.viewport.frames.frame.meshes[0].mesh is drawn.mesh
    yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    yield from extracted(d)
    assert d.shell.viewport.frames.surfaces[0] is first
    yield from d.key(imgui.Key.y, imgui.Key.mod_ctrl)
    yield from extracted(d)
    assert d.shell.viewport.frames.surfaces[0] is drawn
    yield from d.click(*fold[:2])


def saved(d: Driver) -> Script:
    """From its button, as it is drawn, to a file whose name is typed."""
    history, path = d.app.history, d.folder / "part.ply"
    x, y, _ = yield from where(d, "surfaces.0.save")
    yield from d.click(x, y)
    yield
    assert d.shell.dialogs.active == "Save Surface"
    yield from d.key(imgui.Key.a, imgui.Key.mod_ctrl)
    imgui.get_io().add_input_characters_utf8(str(path))
    yield
    yield
    d.screen("save-surface")
    x, y, _ = yield from where(d, "dialog.do")
    yield from d.click(x, y)
    yield from d.rest()
    assert d.shell.dialogs.active == ""
    assert d.app.history is history
    (told,) = [m.text for m in d.app.messages.all if str(path) in m.text]
    read = trimesh.load(path, process=False)
    drawn = d.shell.viewport.frames.surfaces[0].mesh
    np.testing.assert_array_equal(read.faces, drawn.faces)
    np.testing.assert_array_equal(read.vertices, drawn.vertices)
    assert f"{len(read.faces):,} triangles" in told


def panel(d: Driver) -> Script:
    """Its switches do what they say."""
    yield from ready(d)
    imgui.set_window_focus("Surfaces###surfaces")
    yield
    x, y, _ = yield from where(d, "surfaces.add")
    yield from d.click(x, y)
    yield from extracted(d)
    yield from refined(d)
    yield from saved(d)
    x, y, _ = yield from where(d, "surfaces.0.more")
    yield from d.click(x, y)
    yield from d.rest()
    d.screen("surface-knobs")
    yield from d.click(x, y)
    x, y, _ = yield from where(d, "surfaces.volume")
    yield from d.click(x - 20, y)
    assert not d.app.scene.raycast.show_volume
    yield from d.rest()
    alone = d.view()
    x, y, _ = yield from where(d, "surfaces.0.visible")
    yield from d.click(x, y)
    assert not d.app.scene.surfaces[0].look.visible
    yield from d.rest()
    below = d.view()[60:600].astype(int)  # between what is told: nothing is shown, it is saved
    assert np.ptp(below, axis=1).max() <= 1 < np.ptp(alone.astype(int))
    x, y, _ = yield from where(d, "surfaces.0.delete")
    yield from d.click(x, y)
    assert d.app.scene.surfaces == ()


SCRIPTS = (adding, sliding, panel)

if __name__ == "__main__":
    injected.run({s.__name__: s for s in SCRIPTS}[sys.argv[1]], Path(sys.argv[2]))
