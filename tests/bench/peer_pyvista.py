"""PyVista under the same stopwatch, by its own Python: `python -m tests.bench.peer_pyvista TASK`.

It draws as its users see it: `add_volume` without options, its own window and interactor. Mouse
events go in at the interactor, the level of ImGui's queue in ours.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import time
from typing import Any

from tests.bench.screen import HEIGHT, WIDTH, Mouse, point_at, resident_mb, swing

TURNING = float(os.environ.get("VOLVIZ_BENCH_SECONDS", "4"))


def _read(name: str) -> Any:
    import pyvista

    return pyvista.read(name)


def _plotter(name: str | None) -> Any:
    import pyvista

    plotter = pyvista.Plotter(window_size=[WIDTH, HEIGHT])
    if name is not None:
        plotter.add_volume(_read(name))
    plotter.show(interactive=False, interactive_update=True, auto_close=False)
    return plotter


def start(names: list[str]) -> None:
    """What a script of two lines does; until it is ended from outside."""
    plotter = _plotter(names[0])
    plotter.iren.interactor.Start()


def turn(names: list[str]) -> dict[str, Any]:
    """Rotate with the mouse for some seconds, then let go: VTK's own trackball."""
    plotter = _plotter(names[0])
    plotter.enable_trackball_style()
    plotter.render()
    found: dict[str, Any] = {"turn_latency_ms": [], "turn_frame_ms": []}
    interactor = plotter.iren.interactor
    middle = (WIDTH / 2, HEIGHT / 2)
    interactor.SetEventInformation(round(middle[0]), round(middle[1]))
    interactor.LeftButtonPressEvent()
    mouse = Mouse(swing(*middle, WIDTH / 6, TURNING))
    first = last = 0.0
    while not mouse.over:
        batch = mouse.take()
        if not batch:
            time.sleep(0.0005)
            continue
        interactor.SetEventInformation(round(batch[-1][1]), round(batch[-1][2]))
        interactor.MouseMoveEvent()  # draws and swaps
        now = time.perf_counter()
        found["turn_latency_ms"] += [1e3 * (now - due) for due, _, _ in batch]
        if last:
            found["turn_frame_ms"].append(1e3 * (now - last))
        first, last = first or now, now
    found["turn_per_second"] = [len(found["turn_frame_ms"]) / (last - first)]
    interactor.LeftButtonReleaseEvent()
    plotter.render()
    found["first_sample_ms"] = found["whole_ms"] = [1e3 * (time.perf_counter() - last)]
    found["view"] = list(plotter.window_size)
    (actor,) = [a for a in plotter.actors.values() if hasattr(a, "mapper")][:1]
    found["quality"] = (
        f"{type(actor.mapper).__name__} while dragging at "
        f"{interactor.GetDesiredUpdateRate():g} updates/s asked for, then still"
    )
    return found


def idle(names: list[str]) -> dict[str, Any]:
    """Share of a processor in its own event loop."""
    plotter = _plotter(names[0])
    interactor = plotter.iren.interactor
    found: dict[str, Any] = {}
    for name, at in (("idle", (2, 2)), ("idle_over", (WIDTH // 2, HEIGHT // 2))):
        point_at(*at)
        _loop(interactor, 2.0)
        used, begun = time.process_time(), time.perf_counter()
        _loop(interactor, 2.5 * TURNING)
        share = (time.process_time() - used) / (time.perf_counter() - begun)
        found[f"{name}_percent"] = [100 * share]
    return found


def _loop(interactor: Any, seconds: float) -> None:
    observer = interactor.AddObserver("TimerEvent", lambda *_: interactor.TerminateApp())
    timer = interactor.CreateOneShotTimer(round(1000 * seconds))
    interactor.Start()
    interactor.DestroyTimer(timer)
    interactor.RemoveObserver(observer)


def memory(names: list[str]) -> dict[str, Any]:
    """Open file after file in one window, `clear()` between them."""
    plotter = _plotter(None)
    found: dict[str, Any] = {"resident_mb": []}
    for name in names:
        plotter.clear()
        plotter.add_volume(_read(name))
        plotter.reset_camera()
        plotter.render()
        gc.collect()
        found["resident_mb"].append(resident_mb())
    return found


TASKS = {"start": start, "turn": turn, "idle": idle, "memory": memory}

if __name__ == "__main__":
    print(json.dumps(TASKS[sys.argv[1]](sys.argv[2:])))
