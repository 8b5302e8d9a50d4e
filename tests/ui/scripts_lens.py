"""The lens in the window, by injected events: `python -m tests.ui.scripts_lens NAME FOLDER`."""

from __future__ import annotations

import sys
import time
from pathlib import Path

import numpy as np

import volviz
from tests.ui import injected
from tests.ui.injected import Driver, Script
from tests.ui.patience import unseen
from tests.ui.scripts_surfaces import ready
from volviz.model.surface_look import SceneSurface
from volviz.ui import lens_tool
from volviz.ui.im import ImVec2, imgui


def lensed(d: Driver, seconds: float = 240.0) -> Script:
    """Until the surface is the one of this camera and this lens, and the picture is whole."""
    end = time.monotonic() + seconds
    yield
    while True:
        found = d.shell.viewport.frames.surfaces
        if found and found[0] is not None and found[0].camera == d.app.scene.camera:
            break
        assert time.monotonic() < end, "no surface comes"
        with unseen():
            yield
    yield from d.rest(90.0)


def on(d: Driver) -> Script:
    """A surface with its edges, and the lens over the middle of the view."""
    yield from ready(d)
    surfaces = [SceneSurface.at(300.0, wireframe="overlay", opacity=1.0)]
    scene = d.app.scene.with_surfaces(surfaces).with_knobs(show_volume=False)
    d.app.change(scene, "Surface")
    imgui.set_window_focus("Surfaces###surfaces")
    imgui.get_io().add_mouse_pos_event(*d.middle)
    yield
    yield from d.key(imgui.Key.l)
    assert d.app.scene.lens.lens
    yield from lensed(d)


def where(d: Driver) -> tuple[float, float]:
    """The middle of the lens on the screen."""
    x, y, w, h = d.shell.place
    scene = d.app.scene
    at = lens_tool._circle(scene.camera, scene, (w, h))
    assert at is not None
    return x + at[0], y + at[1]


def dragging(d: Driver) -> Script:
    """The lens follows the mouse, its surface follows the lens, and a drag is one step."""
    yield from on(d)
    frames = d.shell.viewport.frames
    d.screen("lens")
    plain = volviz.extract_surface(d.app.scene.volume, 300.0)
    here = frames.surfaces[0]
    assert len(here.mesh.faces) < 0.7 * len(plain.faces)
    assert here.culled.hidden > 0
    before, steps = d.app.scene, len(d.app.history.steps)
    start = where(d)
    assert np.abs(np.subtract(start, d.middle)).max() < 4
    io, made, slowest = imgui.get_io(), set(), 0.0
    io.add_mouse_pos_event(*start)
    yield
    yield
    io.add_mouse_button_event(0, True)
    yield
    for i in range(1, 31):
        io.add_mouse_pos_event(start[0] - 3 * i, start[1] + 2 * i)
        begin = time.perf_counter()
        yield
        slowest = max(slowest, time.perf_counter() - begin)
        assert frames.frame.meshes
        made.add(frames.surfaces[0].mesh)
    io.add_mouse_button_event(0, False)
    yield
    yield from lensed(d)
    assert d.app.scene.camera == before.camera
    assert d.app.scene.lens.focus != before.lens.focus
    assert np.abs(np.subtract(where(d), (start[0] - 90, start[1] + 60))).max() < 4
    assert len(d.app.history.steps) == steps + 1
    assert frames.surfaces[0].mesh is not here.mesh
    d.screen("lens-dragged")
    io.add_mouse_pos_event(2, 2)  # no grip is lit
    yield from d.rest()
    size = d.shell.viewport.size
    wanted = volviz.render(d.app.scene, size).pixels[..., :3].astype(int)
    assert (np.abs(d.view() - wanted) <= 1).all(axis=-1).mean() > 0.97  # the circle is over it
    yield from d.key(imgui.Key.z, imgui.Key.mod_ctrl)
    assert d.app.scene.lens == before.lens
    yield from d.key(imgui.Key.l)
    assert not d.app.scene.lens.lens
    print(f"{len(made)} surfaces in 30 frames, slowest {1000 * slowest:.0f} ms")


def turning(d: Driver) -> Script:
    """While the camera moves something whole is seen; then what this camera sees."""
    yield from on(d)
    frames = d.shell.viewport.frames
    lens, first = d.app.scene.lens, frames.surfaces[0]
    x, y, w, h = d.shell.place
    io, start = imgui.get_io(), (x + 0.9 * w, y + 0.9 * h)
    io.add_mouse_pos_event(*start)
    yield
    yield
    io.add_mouse_button_event(0, True)
    yield
    for i in range(1, 16):
        io.add_mouse_pos_event(start[0] - 12 * i, start[1])
        yield
        (drawn,) = frames.frame.meshes
        if frames.frame.camera != first.camera and frames.surfaces[0] is first:
            assert drawn.mesh is first.coarse
    io.add_mouse_button_event(0, False)
    yield from lensed(d)
    assert d.app.scene.lens == lens
    (drawn,) = frames.frame.meshes
    assert drawn.mesh is frames.surfaces[0].mesh is not first.mesh
    d.screen("lens-turned")


def keys(d: Driver) -> Script:
    """Alt and the mouse: the lens comes to it, and the wheel changes its size."""
    yield from on(d)
    io, before = imgui.get_io(), d.app.scene
    x, y = d.middle
    target = ImVec2(x + 50, y - 60)
    io.add_key_event(imgui.Key.mod_alt, True)
    yield from d.drag((round(target.x), round(target.y)), (0, 0))
    io.add_mouse_wheel_event(0, 2.0)
    yield
    yield
    io.add_key_event(imgui.Key.mod_alt, False)
    yield
    assert d.app.scene.camera == before.camera
    assert np.abs(np.subtract(where(d), (target.x, target.y))).max() < 4
    assert d.app.scene.lens.lens_radius > 1.1 * before.lens.lens_radius
    yield from lensed(d)


SCRIPTS = (dragging, turning, keys)

if __name__ == "__main__":
    injected.run({s.__name__: s for s in SCRIPTS}[sys.argv[1]], Path(sys.argv[2]))
