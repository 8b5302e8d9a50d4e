"""What goes wrong or takes long under a window.

`python -m tests.ui.scripts_viewport NAME FOLDER`. By injected events; the window is
small, so that they are quick.
"""

from __future__ import annotations

import os
import shutil
import sys
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import moderngl
import numpy as np

import volviz
from tests.ui import injected
from tests.ui.injected import Driver, Script
from volviz import resolve, resources
from volviz.app import settings
from volviz.errors import Cancelled, LimitError
from volviz.gpu import formats, progressive
from volviz.gpu.checked import ContextLost, Gpu
from volviz.gpu.passes import raycast
from volviz.resolve import TextureLimits
from volviz.ui import view_notes, viewport
from volviz.ui.desktop import wake
from volviz.ui.im import imgui

SIZE = (660, 470)  # over the pointer of Xvfb, which else puts its own place before ours


def ball(name: str, radius: float, side: int = 40) -> volviz.Volume:
    z, y, x = np.mgrid[-1 : 1 : 1j * side, -1 : 1 : 1j * side, -1 : 1 : 1j * side]
    data = np.clip(radius + 0.2 - np.sqrt(x**2 + y**2 + z**2), 0, 0.4) * 1000
    return volviz.Volume.from_array(data.astype(np.uint16), name=name)


def shown(d: Driver, volume: volviz.Volume) -> Script:
    """Open a volume and wait for its picture."""
    scene = volviz.Scene.of(volume, aspect=d.shell.viewport.aspect)
    d.app.show(scene.with_raycast(samples=1), f"Open {volume.name}")
    yield from d.rest()
    yield
    yield


def whole(d: Driver) -> np.ndarray:
    return d.shell.viewport.picture.pixels()


def off_from_headless(d: Driver) -> float:
    """Mean difference between the window's picture and that of `render`."""
    headless = volviz.render(d.app.scene, d.shell.viewport.size).pixels
    return float(np.abs(whole(d).astype(int) - headless).mean())


def slabs(d: Driver) -> Script:
    yield from shown(d, ball("one", 0.8))
    before = d.view()
    live = volumes(d)
    formats.SLAB_BYTES = 40 * 40 * 2
    progressive.UPLOAD_SECONDS = 0.0
    scene = volviz.Scene.of(ball("two", 0.5), aspect=d.shell.viewport.aspect)
    d.app.show(scene.with_raycast(samples=1), "Open two")
    parts = []
    while len(parts) < 9:
        yield
        parts.append(d.shell.viewport.state.uploaded)
        assert np.array_equal(middle_of(d), middle_of(d, before)), "the good picture went away"
    parts = parts[1:]
    assert all(a < b < 1 for a, b in pairwise(parts)), parts
    d.screen("uploading")
    d.app.show(volviz.Scene.of(ball("three", 0.7)).with_raycast(samples=1), "Open three")
    yield
    yield
    assert volumes(d) <= live, "the volume that was on its way is still there"
    yield from d.rest()
    assert volumes(d) == live
    assert off_from_headless(d) < 0.3


def volumes(d: Driver) -> int:
    """How many 3D textures there are."""
    textures = [t for t in d.shell.gpu.owned.textures if isinstance(t, moderngl.Texture3D)]
    return sum(not isinstance(t.mglo, moderngl.InvalidObject) for t in textures)


def middle_of(d: Driver, picture: np.ndarray | None = None) -> np.ndarray:
    """The middle of the view: no badges, bars or letters there."""
    picture = d.view() if picture is None else picture
    h, w = picture.shape[:2]
    return picture[h // 3 : h // 2, w // 3 : 2 * w // 3]


def prepared_beside(d: Driver) -> Script:
    yield from shown(d, ball("one", 0.8))
    before, limits = d.view(), d.app.limits
    make, stopped = resolve.encode, []

    def slow(*given, progress, **more):
        try:
            for i in range(300):
                progress(i / 300, "preparing voxels")
                time.sleep(0.01)
        except Cancelled:
            stopped.append(time.monotonic())
            raise
        return make(*given, progress=progress, **more)

    resolve.encode = slow
    d.app.limits = replace(limits, promote8=not limits.promote8, max_bytes=30_000)
    drawn, until = 0, time.monotonic() + 1.0
    while time.monotonic() < until:
        yield
        drawn += 1
    job = d.shell.viewport.frames.job
    assert job is not None
    assert 0 < job.fraction < 1
    assert drawn > 4
    assert max(list(d.shell.times)[-4:]) < 0.6  # the worker sleeps three seconds
    assert np.array_equal(middle_of(d), middle_of(d, before))
    d.screen("preparing")
    d.app.limits, asked = limits, time.monotonic()  # as undo does: what was there is there
    while not stopped and time.monotonic() < asked + 5:
        yield
    assert stopped[0] - asked < 0.5
    assert d.shell.viewport.frames.job is None
    resolve.encode = make
    d.app.limits = replace(limits, max_bytes=30_000)
    yield from until_reduced(d)
    assert max(d.shell.viewport.frame.voxels.dims) < 40


def until_reduced(d: Driver) -> Script:
    end = time.monotonic() + 30
    while d.shell.viewport.frame is None or d.shell.viewport.frame.voxels.dims == (40, 40, 40):
        assert time.monotonic() < end
        yield
    yield from d.rest()


def out_of_memory(d: Driver) -> Script:
    make, viewport.SMALLEST_TEXTURE = Gpu.texture3d, 1000

    def small(self, size, components, dtype, **more):
        if dtype != "u1" and np.prod(size) * components * formats.TEXEL_DTYPES[dtype].itemsize > (
            20_000
        ):
            raise LimitError("3D texture: the memory of this card is not enough")
        return make(self, size, components, dtype, **more)

    Gpu.texture3d = small
    try:
        yield from until_shown(d, ball("large", 0.8))
        frame = d.shell.viewport.frame
        assert frame.voxels.nbytes <= 20_000 < 40**3 * 2
        badge = view_notes.reduced(
            d.app.scene.volume, frame, d.app.limits, d.shell.viewport.out_of_memory[1]
        )
        assert "1/2" in badge.text
        assert "the memory of this card" in badge.about
        for _ in range(4):
            yield from d.drag(d.middle, (30, 10))
        yield from d.rest()
        told = [m for m in d.app.messages.all if "resolution" in m.text]
        assert [m.count for m in told] == [1], d.app.messages.all
        assert not [m for m in d.app.messages.all if m.level == "error"]
        d.screen("reduced")
        x, y, *_ = d.shell.place
        imgui.get_io().add_mouse_pos_event(x + 40, y + 20)
        for _ in range(3):
            yield
        d.screen("reduced-why")
    finally:
        Gpu.texture3d = make
    yield from until_shown(d, ball("again", 0.6))  # another volume: all that fits is tried again
    assert d.shell.viewport.frame.voxels.dims == (40, 40, 40)


def until_shown(d: Driver, volume: volviz.Volume) -> Script:
    scene = volviz.Scene.of(volume, aspect=d.shell.viewport.aspect)
    d.app.show(scene.with_raycast(samples=1), f"Open {volume.name}")
    end = time.monotonic() + 30
    view = d.shell.viewport
    while view.frames.scene is None or view.frames.scene.volume is not volume:
        assert time.monotonic() < end
        yield
    while view.out_of_memory and view._refused is view.frame:
        assert time.monotonic() < end
        yield
    yield from d.rest()


def tiny_limit(d: Driver) -> Script:
    d.shell.viewport._limits = d.app.limits = TextureLimits(max_dim=2048, max_bytes=9_000)
    yield from until_shown(d, ball("large", 0.8))
    frame = d.shell.viewport.frame
    assert frame.voxels.nbytes <= 9_000
    badge = view_notes.reduced(d.app.scene.volume, frame, d.app.limits, None)
    assert "8.8 KiB" in badge.about
    assert [m.count for m in d.app.messages.all if "resolution" in m.text] == [1]


def shader(d: Driver) -> Script:
    folder = d.folder / "shaders"
    shutil.copytree(resources.shader_dir(), folder)
    resources.shader_dir = lambda: folder
    yield from shown(d, ball("one", 0.8))
    good = whole(d)
    file = folder / "display" / "display.frag"
    text = file.read_text()
    later(file, text.replace("texture(u_light", "textrue(u_light"))
    yield from soon(d, lambda: bool(d.app.messages.all))
    yield from d.rest()
    (told,) = d.app.messages.all
    assert told.level == "error"
    line = 1 + text[: text.index("texture(u_light")].count("\n")
    assert f"shaders/display/display.frag:{line}" in told.text
    d.screen("shader")
    assert np.array_equal(whole(d), good)
    yield from d.drag(d.middle, (50, 20))
    yield from d.rest()
    assert not np.array_equal(whole(d), good), "it no longer draws"
    d.app.undo()
    yield from d.rest()
    assert np.array_equal(whole(d), good)
    later(file, text.replace("encode(shown.a > 0.0 ?", "1.0 - encode(shown.a > 0.0 ?"))
    yield from soon(d, lambda: not np.array_equal(whole(d), good))
    yield from d.rest()
    assert np.abs((255 - whole(d)[..., :3].astype(int)) - good[..., :3]).max() <= 1
    assert [m.count for m in d.app.messages.all] == [1]


def soon(d: Driver, happened) -> Script:
    end = time.monotonic() + 10
    while not happened():
        assert time.monotonic() < end
        yield


def later(path: Path, text: str) -> None:
    """Write a file with a newer time, however coarse the clock of the file system is."""
    stamp = path.stat().st_mtime_ns + 1_000_000_000
    path.write_text(text)
    os.utime(path, ns=(stamp, stamp))


def lose(times: int) -> None:
    """Let the next ray casts fail as after a reset of the driver."""
    draw, left = raycast.draw, [times]

    def lost(*given, **more):
        if left[0]:
            left[0] -= 1
            raise ContextLost("the OpenGL context was lost")
        return draw(*given, **more)

    raycast.draw = lost


def lost(d: Driver) -> Script:
    yield from shown(d, ball("one", 0.8))
    d.app.change(d.app.scene.with_raycast(step=0.7), "Rendering")
    yield from d.rest()
    good, gpu, size = whole(d), d.shell.gpu, d.shell.viewport.size
    lose(1)
    d.app.change(d.app.scene.with_camera(d.app.scene.camera.orbited(40)), "Turn")
    yield from soon(d, lambda: d.shell.gpu is not gpu)
    assert gpu.released
    yield from d.rest()
    assert [m.level for m in d.app.messages.all] == ["warning"]
    assert "lost" in d.app.messages.all[0].text
    assert d.shell.viewport.size == size
    assert not np.array_equal(whole(d), good)
    d.app.undo()
    yield from d.rest()
    assert np.array_equal(whole(d), good), "not the same picture after the rebuild"
    d.screen("rebuilt")
    yield from d.drag(d.middle, (40, 10))
    assert d.app.history.present.label == "Turn", "the mouse is dead after the rebuild"


def lost_twice(d: Driver) -> Script:
    yield from shown(d, ball("one", 0.8))
    d.shell.open([injected.SAMPLE])
    yield from d.rest(60)
    lose(2)
    d.app.change(d.app.scene.with_raycast(step=0.7), "Rendering")
    for _ in range(200):
        yield
    raise AssertionError("it goes on without OpenGL")


def between_frames(d: Driver) -> Script:
    """Rays are cast while no frame is drawn; whoever moves the mouse gets one at once."""
    yield from shown(d, ball("one", 0.8))
    view, calls, moved = d.shell.viewport, [], []
    refine, viewport.RESTING_BUDGET = view.refine, 0.0

    def watched() -> bool:
        calls.append(d.app.scene)
        if len(calls) == 20:
            imgui.get_io().add_mouse_pos_event(SIZE[0] / 2 + 9, SIZE[1] / 2)
            wake()
            moved.append(len(calls))
        return refine()

    view.refine = watched
    d.app.change(d.app.scene.with_raycast(samples=8), "Samples")
    d.shell.window.touch = lambda: None  # scripts go on with frames
    frames = 0
    while frames < 2 or not view.state.done:
        yield
        frames += 1
        if moved and len(moved) == 1 and len(calls) > 19:
            moved.append(len(calls))
    assert len(calls) > 50, len(calls)
    assert frames < len(calls), (frames, len(calls))
    assert moved[1] - moved[0] <= 1, "a frame waited for rays"
    assert off_from_headless(d) == 0


NAMES = (
    "between_frames",
    "slabs",
    "prepared_beside",
    "out_of_memory",
    "tiny_limit",
    "shader",
    "lost",
    "lost_twice",
)


def main(name: str, folder: Path) -> None:
    settings.save(settings.Settings(size=SIZE, panels=False), folder / "config")
    injected.run(globals()[name], folder)


if __name__ == "__main__":
    from volviz.errors import VolvizError

    try:
        main(sys.argv[1], Path(sys.argv[2]))
    except VolvizError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_code)
