"""volviz's window under a stopwatch: `python -m tests.bench.window TASK NAME...`, one JSON line.

Positions of the mouse go in through ImGui's queue, where GLFW's callbacks put theirs, before the
frame that would have taken them; the loop, its sleeping and its waking are the program's own.
What X itself takes is left out, for peers too.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from tests.bench import stalls
from tests.bench.screen import Mouse, Screen, point_at, resident_mb, swing, x11
from volviz.app import App, viewer
from volviz.gpu.passes import raycast
from volviz.ui import painting
from volviz.ui.desktop import SETTLING_FRAMES, wake
from volviz.ui.im import glfw, imgui
from volviz.ui.shell import Shell
from volviz.ui.window import show

MOVES = 8
TURNING = float(os.environ.get("VOLVIZ_BENCH_SECONDS", "4"))
Script = Iterator[None]


class Bench:
    """A shell, a mouse for it, and the times of its frames."""

    def __init__(self, shell: Shell, names: list[str]) -> None:
        self.shell, self.app, self.names = shell, shell.app, names
        self.mouse: Mouse | None = None
        self.swapped = 0.0
        self.frames = 0
        self.batch: list[float] = []
        self.found: dict[str, Any] = {}
        self.screen = Screen()
        self._frame = shell.frame
        self._x11 = x11()
        self._display = glfw.get_x11_display()

    def frame(self) -> None:
        """One frame, with what the mouse did until now."""
        self.batch = []
        if self.mouse is not None:
            for due, x, y in self.mouse.take():
                imgui.get_io().add_mouse_pos_event(x, y)
                self.batch.append(due)
        self._frame()
        self.swapped = time.perf_counter()
        self.frames += 1
        self._x11.XSync(self._display, 0)

    def rest(self, seconds: float = 300.0) -> Script:
        """Until nothing is loaded and the picture is whole."""
        end = time.monotonic() + seconds
        for _ in range(3):
            yield
        while self.app.job is not None or not self.shell.viewport.state.done:
            if time.monotonic() > end:
                raise RuntimeError("the window does not come to rest")
            yield

    def first_sample(self) -> Script:
        """Until nothing is loaded and all rays are cast once."""
        while self.app.job is not None or self.shell.viewport.state.samples < 1:
            yield

    def shown(self) -> Any:
        """The scene that the picture on the screen is of."""
        return self.shell.viewport.frames.scene

    def place(self) -> tuple[int, int, int, int]:
        """The 3D view on the screen."""
        left, top = glfw.get_window_pos(self.shell.window.handle)
        x, y, _, _ = self.shell.place
        return (round(left + x), round(top + y), *self.shell.viewport.size)

    def press(self, down: bool, at: tuple[float, float]) -> Script:
        imgui.get_io().add_mouse_pos_event(*at)
        wake()
        yield
        yield
        imgui.get_io().add_mouse_button_event(0, down)
        wake()
        yield
        yield

    def add(self, name: str, *values: float) -> None:
        self.found.setdefault(name, []).extend(values)

    def sleep(self, seconds: float) -> Script:
        """Leave the loop to itself."""
        done = threading.Event()

        def later() -> None:
            time.sleep(seconds)
            done.set()
            wake()

        threading.Thread(target=later, daemon=True).start()
        while not done.is_set():
            yield


def _dragged(b: Bench, path: list[tuple[float, float]], name: str) -> Script:
    """Follow the path with the button held: times between swaps, and from each position to the
    swap of the first frame whose picture is of a scene with it."""
    waiting: list[tuple[float, Any]] = []
    b.mouse = Mouse(path, wake)
    last = start = 0.0
    count = 0
    while not b.mouse.over or waiting:
        yield
        waiting += [(due, b.app.scene) for due in b.batch]
        shown = max((i for i, w in enumerate(waiting) if w[1] is b.shown()), default=-1)
        b.add(f"{name}_latency_ms", *(1e3 * (b.swapped - w[0]) for w in waiting[: shown + 1]))
        del waiting[: shown + 1]
        if last:
            b.add(f"{name}_frame_ms", 1e3 * (b.swapped - last))
            count += 1
        start = start or b.swapped
        last = b.swapped
    b.mouse = None
    b.add(f"{name}_per_second", count / (last - start))


def turn(b: Bench) -> Script:
    """Rotate with the mouse for some seconds, then let go."""
    yield from b.first_sample()
    x, y, w, h = b.place()
    middle = (x + w / 2, y + h / 2)
    rays: list[tuple[float, float]] = []
    cast = raycast.draw

    def watched(gpu: Any, resident: Any, frame: Any, view: Any, *more: Any, **named: Any) -> None:
        if view.step_scale != 1.0 or view.size != b.shell.viewport.size:
            rays.append((view.size[0] / b.shell.viewport.size[0], view.step_scale))
        cast(gpu, resident, frame, view, *more, **named)

    yield from b.press(True, middle)
    raycast.draw = watched
    yield from _dragged(b, swing(*middle, w / 6, TURNING), "turn")
    raycast.draw = cast
    moved = b.swapped
    before = b.shell.viewport.state.samples
    assert before == 0, "the picture was not coarse"
    imgui.get_io().add_mouse_button_event(0, False)
    while b.shell.viewport.state.samples < 1:
        yield
    b.add("first_sample_ms", 1e3 * (b.swapped - moved))
    yield from b.rest()
    b.add("whole_ms", 1e3 * (b.swapped - moved))
    b.add("rays", *(r for r, _ in rays))
    b.add("step", *(s for _, s in rays))
    b.found["view"] = [w, h]
    b.found["samples"] = b.app.scene.raycast.samples
    b.found["quality"] = "fewer rays and larger steps, by the time of the last picture"


def turn_alone(b: Bench) -> Script:
    """The same with all panels hidden."""
    b.shell.toggle("panels")
    yield from turn(b)


def points(b: Bench) -> Script:
    """Move a control point of the opacity: once from rest, several times; then drag it."""
    places: list[Any] = []
    draw = painting.points

    def watched(at: Any, where: Any, *more: Any) -> None:
        places.append(where)
        draw(at, where, *more)

    painting.points = watched
    yield from b.first_sample()
    del places[:]
    yield from b.sleep(0.3)
    assert places, "no transfer function is shown"
    opacities = places[0]
    x, y = (float(n) for n in opacities[len(opacities) // 2])
    yield from b.press(True, (x, y))
    for step in range(MOVES):
        while b.shell.viewport.state.samples < 1:
            yield
        # upwards: a point at the bottom would show nothing when it is moved along it
        yield from _moved(b, (x + (8 if step % 2 else 4), y - (12 if step % 2 else 6)))
    yield from _dragged(b, swing(x + 12, y, 10, TURNING), "point_drag")
    yield from b.press(False, (x, y))


def _moved(b: Bench, to: tuple[float, float]) -> Script:
    """One move; time to the swap of the first frame of that scene whose pixels are others."""
    before, scene = b.screen.look(b.place()), b.app.scene
    b.mouse = Mouse([to], wake)
    due, first = b.mouse.start, b.frames
    while True:
        yield
        if not b.mouse.over:
            first = b.frames
        seen = b.screen.look(b.place())
        shown = b.app.scene is not scene and b.shown() is b.app.scene
        if shown and (seen != before).any():
            break
        before = seen
    b.add("point_ms", 1e3 * (b.swapped - due))
    b.add("point_frames", b.frames - first)
    b.mouse = None


def idle(b: Bench) -> Script:
    """Share of a processor while nothing happens, with the pointer elsewhere and over the view."""
    yield from b.rest()
    x, y, w, h = b.place()
    for name, at in (("idle", (2, 2)), ("idle_over", (x + w // 2, y + h // 2))):
        point_at(*at)
        yield from b.sleep(2.0)
        for _ in range(SETTLING_FRAMES):  # of the waking that ended the sleep
            yield
        frames, used, start = b.frames, time.process_time(), time.perf_counter()
        yield from b.sleep(2.5 * TURNING)
        share = (time.process_time() - used) / (time.perf_counter() - start)
        b.add(f"{name}_percent", 100 * share)
        b.add(f"{name}_frames", b.frames - frames - 1)  # the one that ends the measurement


def memory(b: Bench) -> Script:
    """Open file after file, without closing any: undo keeps volumes, up to its bound."""
    yield from _opened(b, "")


def memory_no_undo(b: Bench) -> Script:
    """The same where undo keeps no other volume: what grows now is kept by mistake."""
    viewer.KEPT_BYTES = 0
    yield from _opened(b, "")


def _opened(b: Bench, prefix: str) -> Script:
    for name in b.names:
        b.shell.open([name])
        while b.app.job is not None or b.shell.viewport.state.rays == 0:
            yield
        yield
        yield
        gc.collect()
        b.add("resident_mb", resident_mb())
    known = {id(s.state.volume): s.state.volume.info.nbytes for s in b.app.history.steps}
    b.found["undo_mb"] = sum(known.values()) / 1e6


TASKS: dict[str, Callable[[Bench], Script]] = {
    "turn": turn,
    "turn_alone": turn_alone,
    "points": points,
    "idle": idle,
    "memory": memory,
    "memory_no_undo": memory_no_undo,
    "stalls": stalls.stalls,
}


def run(task: str, names: list[str]) -> None:
    """One task in a window; what was found as JSON."""
    found: dict[str, Any] = {}

    def started(shell: Shell) -> None:
        bench = Bench(shell, names)
        script = TASKS[task](bench)

        def timed() -> None:
            bench.frame()
            if next(script, "end") == "end":
                found.update(bench.found)
                shell.leave()

        shell.frame = timed

    with tempfile.TemporaryDirectory() as folder:
        files = () if task.startswith(("memory", "stalls")) else names
        show(names=files, app=App(folder=Path(folder)), started=started)
    print(json.dumps(found))


if __name__ == "__main__":
    run(sys.argv[1], sys.argv[2:])
