"""A still picture of any size, drawn a little at a time so that the window stays alive.

Its pixels are those of `Renderer.image`: bands instead of tiles do not show in a picture. The
memory it takes is that of the picture and of one band.
"""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator

import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError
from volviz.gpu import ahead
from volviz.gpu.checked import Gpu
from volviz.gpu.gathering import Gathering
from volviz.gpu.pace import Pace
from volviz.gpu.passes.view import Tile, View, blocks
from volviz.gpu.residency import Residency
from volviz.image import check_size
from volviz.model.frame import Frame

WIDEST = 1000
MOST_ROWS = 250
"""No powers of two, for which llvmpipe would compile shaders once more."""
MIN_ROWS = 4


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
        self._pace = Pace(2e5)
        self._light: Gathering | None = None
        self._drawing = self._parts()

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

    def _parts(self) -> Generator[float, None, None]:
        """Draw all of it; after each draw, the part that is done."""
        while not ahead.ready(self.gpu, self.frame):
            yield 0.0
        done, whole = 0, self.size[0] * self.size[1]
        surfaces = any(not m.mesh.empty for m in self.frame.meshes)
        tiles = blocks(View.whole(self.size)) if surfaces else self._bands()
        try:
            for tile in tiles:
                area = tile[2] * tile[3]
                for part in self._part(View(self.size, tile)):
                    yield (done + part * area) / whole
                done += area
        finally:
            if self._light is not None:
                self._light.release()

    def _bands(self) -> Iterator[Tile]:
        """Parts of few rows, by the pace of those before."""
        width, height = self.size
        wide = min(width, WIDEST, self.gpu.limits.max_viewport[0])
        y = 0
        while y < height:
            rows = min(max(self._pace.amount() // wide, MIN_ROWS), MOST_ROWS, height - y)
            for x in range(0, width, wide):
                yield x, y, min(wide, width - x), rows
            y += rows

    def _part(self, view: View) -> Generator[float, None, None]:
        """All samples of one part of the picture, into `pixels`."""
        samples = self.frame.raycast.samples
        light = self._gathering(view)
        while light.samples < samples:
            start = time.perf_counter()
            pixels = light.step(self.frame)
            if pixels:
                self._pace.took(pixels, time.perf_counter() - start)
            if light.samples < samples:
                yield light.samples / samples
        self._show(light, view)
        yield 1.0

    def _gathering(self, view: View) -> Gathering:
        """For one part after the other: new memory for each would have to be made ready."""
        if self._light is not None and self._light.light.size == view.tile[2:]:
            self._light.begin(view)
            return self._light
        if self._light is not None:
            self._light.release()
        self._light = Gathering(self.gpu, self.resident, view)
        return self._light

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
