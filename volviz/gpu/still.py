"""A still picture of any size, drawn a little at a time so that the window stays alive.

Its pixels are those of `Renderer.image`: bands instead of tiles do not show in a picture. The
memory it takes is that of the picture and of one band.
"""

from __future__ import annotations

import time
from collections.abc import Generator

import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError
from volviz.gpu import ahead
from volviz.gpu.checked import Gpu
from volviz.gpu.gathering import Gathering
from volviz.gpu.passes.view import View
from volviz.gpu.residency import Residency
from volviz.image import check_size
from volviz.model.frame import Frame

WIDEST = 1000
MOST_ROWS = 250
"""No powers of two, for which llvmpipe would compile shaders once more."""
MIN_ROWS = 4
DRAW_SECONDS = 0.02
"""What one draw should take: short beside what a person feels as a halt."""


class Still:
    """uint8[h, w, 4] of a frame, sRGB, straight alpha, row 0 on top: whole once `advance` says so.

    Raises UsageError for an impossible size and LimitError where there is no memory for it.
    """

    def __init__(self, gpu: Gpu, resident: Residency, frame: Frame, size: tuple[int, int]) -> None:
        self.gpu, self.resident, self.frame = gpu, resident, frame
        self.size = check_size(size)
        self.fraction = 0.0
        try:
            self.pixels: NDArray[np.uint8] = np.zeros((*self.size[::-1], 4), np.uint8)
        except MemoryError as error:
            raise LimitError("no memory for so large a picture", fix="make it smaller") from error
        self._pixels_per_second = 2e5
        self._drawing = self._bands()

    def advance(self, seconds: float) -> bool:
        """Draw for about so long; True once it is whole. Raises GraphicsError, LimitError."""
        self.gpu.activate()
        deadline = time.perf_counter() + seconds
        for fraction in self._drawing:
            self.fraction = fraction
            if time.perf_counter() >= deadline:
                return False
        self.fraction = 1.0
        return True

    def release(self) -> None:
        """Free what it has on the GPU; what is drawn stays."""
        self.gpu.activate()
        self._drawing.close()

    def _bands(self) -> Generator[float, None, None]:
        """Draw all of it; after each draw, the part that is done."""
        while not ahead.ready(self.gpu, self.frame):
            yield 0.0
        width, height = self.size
        done = 0
        y = 0
        while y < height:
            wide = min(width, WIDEST, self.gpu.limits.max_viewport[0])
            fit = int(self._pixels_per_second * DRAW_SECONDS / wide)
            rows = min(max(fit, MIN_ROWS), MOST_ROWS, height - y)
            for x in range(0, width, wide):
                view = View(self.size, (x, y, min(wide, width - x), rows))
                area = view.tile[2] * rows
                for part in self._band(view):
                    yield (done + part * area) / (width * height)
                done += area
            y += rows

    def _band(self, view: View) -> Generator[float, None, None]:
        """All samples of one part of the picture, into `pixels`."""
        samples = self.frame.raycast.samples
        light = Gathering(self.gpu, self.resident, view)
        try:
            for sample in range(samples):
                start = time.perf_counter()
                light.add(self.frame)
                spent = max(time.perf_counter() - start, 1e-5)
                rate = view.tile[2] * view.tile[3] / spent
                # Rows of background are quick; the ones after them need not be.
                self._pixels_per_second = min(rate, 1.5 * self._pixels_per_second)
                if sample + 1 < samples:
                    yield (sample + 1) / samples
            self._show(light, view)
        finally:
            light.release()
        yield 1.0

    def _show(self, light: Gathering, view: View) -> None:
        x, y, w, h = view.tile
        shown = self.gpu.framebuffer((w, h), "f1")
        try:
            light.show(shown, self.frame.background)
            raw = np.frombuffer(shown.read(components=4, alignment=1), np.uint8)
        finally:
            self.gpu.release_framebuffer(shown)
        top = self.size[1] - y - h
        self.pixels[top : top + h, x : x + w] = raw.reshape(h, w, 4)[::-1]
