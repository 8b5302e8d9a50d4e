"""napari under the same stopwatch, by its own Python: `python -m tests.bench.peer_napari TASK`.

One layer, three dimensions, drawn as its users first see it: maximum intensity (its `translucent`
shows next to nothing of these files). The camera is turned by its API, and Qt asked to paint.
"""

from __future__ import annotations

import gc
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

from tests.bench.screen import HEIGHT, WIDTH, Mouse, point_at, resident_mb, swing

TURNING = float(os.environ.get("VOLVIZ_BENCH_SECONDS", "4"))


def _read(name: str) -> tuple[Any, tuple[float, ...]]:
    """Voxels [z, y, x] and their spacing, by the reader a user would take."""
    import numpy as np

    if Path(name).suffix == ".nrrd":
        import nrrd

        data, header = nrrd.read(name)
        directions = header.get("space directions")
        sizes = (1.0,) * 3 if directions is None else np.linalg.norm(directions, axis=1)
    else:
        import nibabel

        image = nibabel.load(name)
        data, sizes = np.asarray(image.dataobj), image.header.get_zooms()[:3]
    return data.T, tuple(float(s) for s in reversed(sizes))


def _viewer(name: str | None) -> Any:
    import napari

    viewer = napari.Viewer(ndisplay=3, show=False)
    if name is not None:
        _add(viewer, name)
    viewer.show()
    viewer.window._qt_window.setGeometry(0, 0, WIDTH, HEIGHT)
    return viewer


def _add(viewer: Any, name: str) -> None:
    data, scale = _read(name)
    viewer.add_image(data, scale=scale)


def start(names: list[str]) -> None:
    """What a script of two lines does; until it is ended from outside."""
    import napari

    _viewer(names[0])
    napari.run()


class Painted:
    """The canvas, and when it was last on the screen."""

    def __init__(self, viewer: Any) -> None:
        from qtpy.QtWidgets import QApplication

        self.app = QApplication.instance()
        self.widget = viewer.window._qt_viewer.canvas.native
        self.swapped = 0.0
        self.widget.frameSwapped.connect(self._swap)

    def _swap(self) -> None:
        self.swapped = time.perf_counter()

    def paint(self) -> float:
        """Let Qt paint once; when that was on the screen."""
        self.swapped = 0.0
        self.widget.update()
        end = time.perf_counter() + 20
        while not self.swapped:
            self.app.processEvents()
            if time.perf_counter() > end:
                raise RuntimeError("napari does not paint")
        return self.swapped

    def loop(self, seconds: float) -> None:
        """Qt's own loop for so long."""
        from qtpy.QtCore import QEventLoop, QTimer

        loop = QEventLoop()  # the application's own would take the window with it when it ends
        QTimer.singleShot(round(1000 * seconds), loop.quit)
        loop.exec()


def turn(names: list[str]) -> dict[str, Any]:
    """Rotate the camera along the path of the mouse."""
    viewer = _viewer(names[0])
    painted = Painted(viewer)
    painted.loop(3.0)
    found: dict[str, Any] = {"turn_latency_ms": [], "turn_frame_ms": []}
    width, height = painted.widget.width(), painted.widget.height()
    mouse = Mouse(swing(0.0, 0.0, width / 6, TURNING))
    first = last = 0.0
    a, b, c = viewer.camera.angles
    while not mouse.over:
        batch = mouse.take()
        if not batch:
            time.sleep(0.0005)
            continue
        _, x, y = batch[-1]
        viewer.camera.angles = (a + 0.2 * y, b + 0.4 * x, c)
        now = painted.paint()
        found["turn_latency_ms"] += [1e3 * (now - due) for due, _, _ in batch]
        if last:
            found["turn_frame_ms"].append(1e3 * (now - last))
        first, last = first or now, now
    found["turn_per_second"] = [len(found["turn_frame_ms"]) / (last - first)]
    found["view"] = [width, height]
    found["quality"] = "the same while dragging as at rest"
    return found


def idle(names: list[str]) -> dict[str, Any]:
    """Share of a processor in Qt's loop."""
    viewer = _viewer(names[0])
    painted = Painted(viewer)
    painted.loop(4.0)
    found: dict[str, Any] = {}
    corner = painted.widget.mapToGlobal(painted.widget.rect().center())
    for name, at in (("idle", (2, 2)), ("idle_over", (corner.x(), corner.y()))):
        point_at(*at)
        painted.loop(2.0)
        used, begun = time.process_time(), time.perf_counter()
        painted.loop(2.5 * TURNING)
        share = (time.process_time() - used) / (time.perf_counter() - begun)
        found[f"{name}_percent"] = [100 * share]
    return found


def memory(names: list[str]) -> dict[str, Any]:
    """Open file after file in one window, removing the layer before."""
    viewer = _viewer(None)
    painted = Painted(viewer)
    painted.loop(2.0)
    found: dict[str, Any] = {"resident_mb": []}
    for name in names:
        viewer.layers.clear()
        _add(viewer, name)
        painted.paint()
        gc.collect()
        found["resident_mb"].append(resident_mb())
    return found


TASKS = {"start": start, "turn": turn, "idle": idle, "memory": memory}

if __name__ == "__main__":
    print(json.dumps(TASKS[sys.argv[1]](sys.argv[2:])))
