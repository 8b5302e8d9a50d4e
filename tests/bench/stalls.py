"""How long the window's thread ever stays away from its events: `python -m tests.bench latency
stalls`.

A window is taken through what people do with a 512³ volume. For each action the longest turn of
the loop is told: from one look at the events to the next one. `thread` is the processor time of
that thread in it and does not hang on what else the machine does; `wall` also has what it waited
for (ray casting by other threads, the X server). `where` says what the thread was at, 60 ms after
the longest turn began.
"""

from __future__ import annotations

import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from tests.bench.screen import Mouse
from volviz.lab import vary
from volviz.model.surface_look import SceneSurface
from volviz.ui import painting
from volviz.ui.desktop import wake
from volviz.ui.im import imgui
from volviz.ui.panels import PANELS

SIDE = int(os.environ.get("VOLVIZ_BENCH_SIDE", "512"))
ONLY = "VOLVIZ_BENCH_ONLY"
LIMIT_MS = 100.0
"""What nobody may feel (design, contract 9)."""
LOOK_SECONDS = 0.06
SECONDS = 0.8
"""Of each drag."""
BIG = (4000, 3000)
Script = Iterator[None]


@dataclass
class Turns:
    """The longest turns of the loop within one action, ms. where: call of the longest by wall."""

    action: str
    count: int = 0
    wall: float = 0.0
    thread: float = 0.0
    where: str = ""
    over: list[str] = field(default_factory=list)


class Watch:
    """A clock on the loop of a window: wraps its waiting and looks at its thread from another."""

    def __init__(self, window: Any) -> None:
        self.found: list[Turns] = [Turns("start")]
        self._main = threading.get_ident()
        self._wait = window.wait
        self._began: float | None = None
        self._used = time.thread_time()
        self._place = ""
        self._over = False
        window.wait = self.wait
        threading.Thread(target=self._look, daemon=True).start()

    def action(self, name: str) -> None:
        """What happens from now on is called so."""
        self.found.append(Turns(name))

    def end(self) -> None:
        """Look no more."""
        self._over = True

    def wait(self, seconds: float | None) -> bool:
        """In place of the window's own: between two calls is one turn."""
        began, self._began = self._began, None
        wall = 0.0 if began is None else 1e3 * (time.perf_counter() - began)
        due: bool = self._wait(seconds)
        used, self._used = self._used, time.thread_time()
        self._note(wall, 1e3 * (self._used - used))
        self._place, self._began = "", time.perf_counter()
        return due

    def _note(self, wall: float, thread: float) -> None:
        turns = self.found[-1]
        turns.count += 1
        if wall > turns.wall:
            turns.wall, turns.where = wall, self._place
        turns.thread = max(turns.thread, thread)
        if thread > LIMIT_MS:
            turns.over.append(f"{thread:.0f} ms: {self._place}")

    def _look(self) -> None:
        while not self._over:
            time.sleep(0.01)
            began = self._began
            late = began is not None and time.perf_counter() - began > LOOK_SECONDS
            if late and not self._place:
                self._place = _stack(sys._current_frames().get(self._main))


def _stack(frame: FrameType | None) -> str:
    """The innermost calls of ours, the innermost last."""
    names: list[str] = []
    while frame is not None and len(names) < 5:
        code = frame.f_code
        if "volviz" in code.co_filename and "tests" not in code.co_filename:
            names.append(f"{Path(code.co_filename).stem}.{code.co_name}:{frame.f_lineno}")
        frame = frame.f_back
    return " > ".join(reversed(names))


def large_file(folder: Path) -> Path:
    """A 512³ volume of 16 bits on disk: shells of soft matter around a core, with noise."""
    path = folder / f"shells{SIDE}.npy"
    if path.exists():
        return path
    file = np.lib.format.open_memmap(path, mode="w+", dtype=np.int16, shape=(SIDE,) * 3)
    across = np.linspace(-1, 1, SIDE, dtype=np.float32)
    rng = np.random.default_rng(7)
    for z, depth in enumerate(across):
        radius = np.sqrt(depth**2 + across[:, None] ** 2 + 1.3 * across[None, :] ** 2)
        shells = 900 * np.cos(14 * radius) * np.exp(-radius) - 600 * (radius > 0.9)
        file[z] = shells + rng.normal(0, 4, radius.shape).astype(np.float32)
    file.flush()
    return path


# --- what people do --------------------------------------------------------------------------


def stalls(b: Any) -> Script:
    """The task: everything once; `b` is a `window.Bench` whose names are two files."""
    watch = Watch(b.shell.window)
    only = [name.strip() for name in os.environ.get(ONLY, "").split(";") if name.strip()]
    for name in only or ACTIONS:
        act = ACTIONS[name]
        watch.action(name)
        try:
            for _ in _whole(b, act, rest=name not in UNFINISHED):
                b.shell.window.touch()  # a script goes on with frames
                yield
        except Exception as error:  # one thing that fails must not hide the others
            watch.found[-1].where += f" FAILED: {error!r}"
        print(row(vars(watch.found[-1])), file=sys.stderr, flush=True)
    watch.end()
    b.found["stalls"] = [vars(turns) for turns in watch.found]


def _whole(b: Any, act: Callable[[Any], Script], *, rest: bool) -> Script:
    yield from act(b)
    if rest:
        yield from b.rest(300.0)


def _drag(b: Any, at: tuple[float, float], move: tuple[float, float], button: int = 0) -> Script:
    """Hold a button from one place to another, as fast as a hand."""
    io = imgui.get_io()
    io.add_mouse_pos_event(*at)
    yield
    yield
    io.add_mouse_button_event(button, True)
    yield
    steps = round(SECONDS * Mouse.RATE)
    sway = np.sin(np.linspace(0, 3 * np.pi, steps))
    b.mouse = Mouse([(at[0] + move[0] * s, at[1] + move[1] * s) for s in sway], wake)
    while not b.mouse.over:
        yield
    b.mouse = None
    io.add_mouse_button_event(button, False)
    yield


def _open(number: int) -> Callable[[Any], Script]:
    def act(b: Any) -> Script:
        before = b.app.scene
        b.shell.open([b.names[number]])
        while b.app.scene is before:
            yield
        b.app.change(b.app.scene.with_knobs(samples=1), "Samples")  # so that it rests soon
        yield

    return act


def _rotate(b: Any) -> Script:
    x, y, w, h = b.shell.place
    yield from _drag(b, (x + w / 2, y + h / 2), (w / 6, h / 9))


def _wheel(b: Any) -> Script:
    x, y, w, h = b.shell.place
    io = imgui.get_io()
    io.add_mouse_pos_event(x + w / 2, y + h / 2)
    for turn in (1, 1, 1, -1, -1, -1):
        io.add_mouse_wheel_event(0, turn)
        wake()
        for _ in range(4):
            yield


def _control_point(b: Any) -> Script:
    places: list[Any] = []
    draw = painting.points

    def watched(at: Any, where: Any, *more: Any) -> None:
        places.append(where)
        draw(at, where, *more)

    yield from _front(b, "transfer")
    painting.points = watched
    wake()
    yield
    yield
    painting.points = draw
    x, y = (float(n) for n in places[-2][len(places[-2]) // 2])
    yield from _drag(b, (x, y), (12, -10))


def _front(b: Any, name: str) -> Script:
    imgui.set_window_focus(f"{PANELS[name].title}###{name}")
    wake()
    yield
    yield


def _panels(b: Any) -> Script:
    for name in PANELS:
        yield from _front(b, name)


def _gallery(b: Any) -> Script:
    """All pictures of the gallery."""
    yield from _front(b, "presets")
    while True:
        yield
        job = b.shell.shelf.thumbnails._job
        if not b.shell.shelf.eager and job is None and b.shell._resting():
            return


def _knobs(**knobs: Any) -> Callable[[Any], Script]:
    def act(b: Any) -> Script:
        b.app.change(b.app.scene.with_knobs(**knobs), "Rendering")
        b.app.settle()
        wake()
        yield
        yield from b.first_sample()
        yield from _rotate(b)

    return act


def _look(**parts: Any) -> Callable[[Any], Script]:
    """One isosurface instead of those before; wait until it is drawn, turn it."""

    def act(b: Any) -> Script:
        facts = np.percentile(b.app.scene.volume.data[::8, ::8, ::8], 97)
        surface = SceneSurface.at(float(facts), **parts)
        b.app.change(b.app.scene.with_surfaces([surface]), "Surface")
        b.app.settle()
        wake()
        yield
        yield
        while b.shell.viewport.frames.lacking:
            yield
        yield from b.rest(300.0)
        yield from _rotate(b)

    return act


def _isovalue(b: Any) -> Script:
    """As the slider does: another value with every frame."""
    first = b.app.scene.surfaces[0]
    for number in range(40):
        value = first.surface.isovalue + 2.0 * number
        moved = replace(first, surface=replace(first.surface, isovalue=value))
        rest = b.app.scene.surfaces[1:]
        b.app.change(b.app.scene.with_surfaces([moved, *rest]), "Isovalue", "isovalue")
        wake()
        yield
    b.app.settle()
    while b.shell.viewport.frames.lacking:
        yield


def _compare(b: Any) -> Script:
    yield from _front(b, "compare")
    yield from b.rest(300.0)
    axis = vary.axis("raycast.shading=none,phong", b.app.scene)
    b.shell.trials.begin(b.app.scene, axis, errors=False)
    while b.shell.trials.running:
        yield


def _picture(b: Any) -> Script:
    path = Path(b.app.folder) / "big.png"
    b.shell.exports.take_picture(path, BIG, samples=1)
    while b.shell.exports.busy:
        yield
    if not path.exists():
        raise RuntimeError("no picture was written")


def _calls(*names: str) -> Callable[[Any], Script]:
    """Commands by name."""

    def act(b: Any) -> Script:
        from volviz.ui.commands import COMMANDS

        for name in names:
            b.shell.do(COMMANDS[name])
            wake()
            for _ in range(4):
                yield
            while b.shell.exports.busy or b.app.job is not None:
                yield

    return act


def _save(b: Any) -> Script:
    b.app.save(Path(b.app.folder) / "kept.volviz.json")
    while b.app.job is not None:
        yield


def _undo(b: Any) -> Script:
    from volviz.ui.commands import COMMANDS

    while b.app.history.past:
        b.shell.do(COMMANDS["undo"])
        wake()
        for _ in range(4):
            yield


ACTIONS: dict[str, Callable[[Any], Script]] = {
    "open 512³": _open(0),
    "rotate": _rotate,
    "wheel": _wheel,
    "drag a control point": _control_point,
    "every panel in front": _panels,
    "gallery of presets": _gallery,
    "shading none": _knobs(shading="none"),
    "shading phong": _knobs(shading="phong"),
    "gradient forward": _knobs(gradient="forward", shading="blinn-phong"),
    "mode mip": _knobs(mode="mip"),
    "mode dvr, step 2": _knobs(mode="dvr", step=2.0),
    "interpolation nearest": _knobs(interpolation="nearest"),
    "interpolation linear": _knobs(interpolation="linear"),
    "add a surface": _look(),
    "add a translucent surface": _look(opacity=0.5),
    "surface flat, wireframe": _look(shading="flat", wireframe="overlay"),
    "drag an isovalue": _isovalue,
    "compare": _compare,
    "picture 4000 × 3000": _picture,
    "copy scene, command, Python": _calls("copy-scene", "copy-command", "copy-python"),
    "copy the picture": _calls("copy-picture"),
    "save the scene": _save,
    "standard views": _calls("view-1", "view-3", "reset", "projection"),
    "theme, larger, smaller": _calls("theme", "larger", "smaller", "theme"),
    "help, palette": _calls("help", "palette"),
    "open a second file": _open(1),
    "undo all": _undo,
}
UNFINISHED = ("help, palette",)


# --- the table -------------------------------------------------------------------------------


def table(found: list[dict[str, Any]]) -> str:
    """Markdown, with what took more processor time than it may."""
    lines = ["| action | turns | thread ms | wall ms | where |", "|---|---|---|---|---|"]
    lines += map(row, found)
    over = [f"{turns['action']}: {o}" for turns in found for o in turns["over"]]
    said = over or [f"no turn took more than {LIMIT_MS:.0f} ms of the thread's processor time"]
    return "\n".join([*lines, *said])


def row(turns: dict[str, Any]) -> str:
    """One line of it."""
    mark = " **!**" if turns["thread"] > LIMIT_MS else ""
    numbers = f"{turns['count']} | {turns['thread']:.0f}{mark} | {turns['wall']:.0f}"
    return f"| {turns['action']} | {numbers} | {turns['where']} |"


def measured(folder: Path, second: str, *, ask: Any) -> list[dict[str, Any]]:
    """One run in a process of its own, with what earlier ones in this folder compiled.

    ask: runs a command in an environment and gives the JSON of its last line.
    """
    from tests.bench.screen import screen

    files = [str(large_file(folder)), second]
    environment = {**os.environ, "VOLVIZ_CONFIG_DIR": str(folder / "volviz")}
    environment["MESA_SHADER_CACHE_DIR"] = str(folder / "shaders")
    with screen() as display:
        command = [sys.executable, "-m", "tests.bench.window", "stalls", *files]
        found: list[dict[str, Any]] = ask(command, {**environment, **display})["stalls"]
    return found
