"""A virtual X screen of one's own, what is on it, and its pointer. numpy only: peers use it too.

Xvfb keeps its pixels in a mapped file, so anybody can look without asking the X server.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import struct
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

WIDTH, HEIGHT = 1280, 800
VARIABLE = "VOLVIZ_BENCH_SCREEN"
MIDDLE = (WIDTH // 2 - 130, HEIGHT // 2 - 130, 260, 260)


@contextlib.contextmanager
def screen() -> Iterator[dict[str, str]]:
    """A running Xvfb; what to add to the environment of programs that are to be shown on it."""
    with tempfile.TemporaryDirectory(prefix="volviz-bench-") as folder:
        read, write = os.pipe()
        size = f"{WIDTH}x{HEIGHT}x24"
        command = ["Xvfb", "-displayfd", str(write), "-screen", "0", size]
        command += ["-fbdir", folder, "-nolisten", "tcp"]
        server = subprocess.Popen(command, pass_fds=[write], stderr=subprocess.DEVNULL)
        os.close(write)
        try:
            with os.fdopen(read) as pipe:
                number = pipe.readline().strip()
            if not number:
                raise RuntimeError("Xvfb does not start")
            yield {"DISPLAY": f":{number}", VARIABLE: str(Path(folder) / "Xvfb_screen0")}
        finally:
            server.terminate()
            server.wait()


class Screen:
    """The pixels of a virtual screen, as they are now."""

    def __init__(self, path: str | None = None) -> None:
        self._raw = np.memmap(path or os.environ[VARIABLE], np.uint8, "r")
        # an X window dump: sizes as big-endian words, then colours of 12 bytes, then rows
        words = struct.unpack(">25I", self._raw[:100].tobytes())
        start, self.stride, colors = words[0], words[12], words[19]
        first = start + 12 * colors
        rows = self._raw[first : first + self.stride * HEIGHT].reshape(HEIGHT, self.stride)
        self.pixels = rows[:, : 4 * WIDTH].reshape(HEIGHT, WIDTH, 4)

    def look(self, place: tuple[int, int, int, int], every: int = 4) -> np.ndarray:
        """uint8[h, w, 3], a copy of every so-many-th pixel of (left, top, width, height)."""
        x, y, w, h = place
        seen: np.ndarray = self.pixels[y : y + h : every, x : x + w : every, 2::-1]
        return np.array(seen)

    def whole(self) -> np.ndarray:
        """uint8[h, w, 3] of all of it."""
        return self.look((0, 0, WIDTH, HEIGHT), 1)


def x11() -> ctypes.CDLL:
    """Xlib, with the types its functions need."""
    lib = ctypes.CDLL("libX11.so.6")
    lib.XOpenDisplay.restype = ctypes.c_void_p
    lib.XDefaultRootWindow.restype = ctypes.c_ulong
    lib.XDefaultRootWindow.argtypes = [ctypes.c_void_p]
    for name in ("XSync", "XCloseDisplay"):
        getattr(lib, name).argtypes = [ctypes.c_void_p] + [ctypes.c_int] * (name == "XSync")
    lib.XWarpPointer.argtypes = [
        ctypes.c_void_p, ctypes.c_ulong, ctypes.c_ulong, *[ctypes.c_int] * 6,
    ]  # fmt: skip
    return lib


def point_at(x: int, y: int) -> None:
    """Move the pointer of the display there: real events for who lies under it."""
    lib = x11()
    display = lib.XOpenDisplay(None)
    lib.XWarpPointer(display, 0, lib.XDefaultRootWindow(display), 0, 0, 0, 0, x, y)
    lib.XSync(display, 0)
    lib.XCloseDisplay(display)


class Mouse:
    """A mouse with a clock of its own: positions 125 times a second, on a thread.

    What waits while a frame is drawn waits in the figures too: an event counts from when it was
    due. wake: told that there is something, as an X event would.
    """

    RATE = 125.0

    def __init__(self, path: list[tuple[float, float]], wake=lambda: None, delay=0.05) -> None:
        self.start = time.perf_counter() + delay
        self._path, self._wake, self._taken = path, wake, 0
        threading.Thread(target=self._run, daemon=True).start()

    def _due(self) -> int:
        passed = int((time.perf_counter() - self.start) * self.RATE) + 1
        return min(max(passed, 0), len(self._path))

    def _run(self) -> None:
        for index in range(len(self._path)):
            left = self.start + index / self.RATE - time.perf_counter()
            if left > 0:
                time.sleep(left)
            self._wake()

    @property
    def over(self) -> bool:
        """True once all positions were taken."""
        return self._taken >= len(self._path)

    def take(self) -> list[tuple[float, float, float]]:
        """(when it was due, x, y) of the positions that came since the last call."""
        first, self._taken = self._taken, self._due()
        at = range(first, self._taken)
        return [(self.start + i / self.RATE, *self._path[i]) for i in at]


def swing(x: float, y: float, reach: float, seconds: float) -> list[tuple[float, float]]:
    """A path of the mouse: to and fro sideways, once in two seconds, a little up and down."""
    t = np.arange(1, round(seconds * Mouse.RATE) + 1) / Mouse.RATE
    across = x + reach * np.sin(np.pi * t)
    down = y + 0.2 * reach * np.sin(0.77 * np.pi * t)
    return [(float(a), float(b)) for a, b in zip(across, down, strict=True)]


def resident_mb() -> float:
    """Memory of this process in RAM, in MB."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
