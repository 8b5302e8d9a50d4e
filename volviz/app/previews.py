"""Small pictures of volumes that are not open: made on a thread, one by one, as they are wanted."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from volviz.errors import Cancelled, VolvizError, safe_text
from volviz.io.options import ReadOptions
from volviz.io.parts import Part, Slice
from volviz.progress import Progress

SIDE = 160
Picture = NDArray[np.uint8]


class Previews:
    """Pictures of the middle slices of these parts. One thread makes what was wanted last first.

    wake: called from the thread when a picture is there. `close` ends it within half a second.
    """

    def __init__(self, parts: Sequence[Part], wake: Callable[[], None]) -> None:
        self.parts = tuple(parts)
        self.made: dict[int, Picture | str] = {}
        self._wake = wake
        self._progress = Progress()
        self._wanted: list[int] = []
        self._news = threading.Condition()
        self._thread: threading.Thread | None = None

    def get(self, index: int) -> Picture | str | None:
        """uint8[h, w] of a part, why there is none, or None while it is not made yet."""
        if index not in self.made:
            self._want(index)
        return self.made.get(index)

    def close(self) -> None:
        """Stop; what is being made is given up."""
        self._progress.cancel()
        with self._news:
            self._wanted.clear()
            self._news.notify()

    @property
    def running(self) -> bool:
        """True while its thread lives."""
        return self._thread is not None and self._thread.is_alive()

    def _want(self, index: int) -> None:
        with self._news:
            if self._progress.cancelled:
                return
            if index in self._wanted:
                self._wanted.remove(index)
            self._wanted.append(index)
            self._news.notify()
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="volviz previews", daemon=True)
            self._thread.start()

    def _run(self) -> None:
        while True:
            with self._news:
                while not self._wanted and not self._progress.cancelled:
                    self._news.wait()
                if self._progress.cancelled:
                    return
                index = self._wanted.pop()
            if index in self.made:
                continue
            try:
                self.made[index] = self._make(self.parts[index])
            except Cancelled:
                return
            self._wake()

    def _make(self, part: Part) -> Picture | str:
        try:
            return picture_of(part.middle_slice(ReadOptions(progress=self._progress)))
        except Cancelled:
            raise
        except VolvizError as error:
            return safe_text(error.what, 200)
        except Exception as error:  # a preview is a courtesy: its bug must not end the others
            return safe_text(f"{type(error).__name__}: {error}", 200)


def picture_of(one: Slice, side: int = SIDE) -> Picture:
    """uint8[h, w] with square pixels, its longer side `side`: the slice in its window.

    The file's own window where it shows something, else from the 1st to the 99th percentile.
    NaN is black.
    """
    from PIL import Image

    values = np.asarray(one.values, dtype=np.float32)
    finite = np.isfinite(values)
    low, high = _window(values[finite], one.window)
    shown = np.clip((np.where(finite, values, low) - low) / max(high - low, 1e-30), 0, 1)
    width, height = (n * abs(s) for n, s in zip(values.shape[::-1], one.spacing, strict=True))
    scale = side / max(width, height)
    size = (max(round(width * scale), 1), max(round(height * scale), 1))
    grey = Image.fromarray((shown * 255).astype(np.uint8))
    return np.asarray(grey.resize(size, Image.Resampling.BILINEAR))


def _window(values: NDArray[np.float32], given: tuple[float, float] | None) -> tuple[float, float]:
    """Lowest and highest value to tell apart."""
    if values.size == 0:
        return 0.0, 1.0
    if given is not None and given[1] > 0:
        low, high = given[0] - given[1] / 2, given[0] + given[1] / 2
        if np.mean((values > low) & (values < high)) > 0.02:
            return low, high
    low, high = (float(v) for v in np.percentile(values, (1, 99)))
    if high <= low:
        low, high = float(values.min()), float(values.max())
    return low, high
