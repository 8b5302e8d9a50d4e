"""Draws frames: as a picture of any size, or better and better into any framebuffer.

It knows nothing of files, scenes or panels. The window and the command line use the same one.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from volviz.gpu.checked import Gpu
from volviz.gpu.gathering import Gathering
from volviz.gpu.passes import raycast
from volviz.gpu.passes.view import Tile, View, blocks
from volviz.gpu.progressive import Progressive
from volviz.gpu.residency import Residency
from volviz.image import check_size
from volviz.model.frame import Frame
from volviz.progress import Progress, silent

TILE = 512
SAMPLES_PER_DRAW = 1 << 26
"""On the processor: no draw takes longer than a cancel may. Tiles do not show in the picture."""


class Renderer:
    """Owns what it puts on the GPU; `release` frees it."""

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self.resident = Residency(gpu)

    def progressive(self) -> Progressive:
        """A picture that is there at once and gets better; for any framebuffer. The caller's."""
        return Progressive(self.gpu, self.resident)

    def image(
        self,
        frame: Frame,
        size: tuple[int, int],
        *,
        samples: int | None = None,
        progress: Progress | None = None,
    ) -> NDArray[np.uint8]:
        """uint8[h, w, 4], sRGB, straight alpha, row 0 on top. Drawn in tiles; any size.

        samples: jittered pictures averaged, by default the frame's own number.
        """
        size = check_size(size)
        progress = progress or silent()
        cast = frame.raycast if samples is None else replace(frame.raycast, samples=samples)
        pixels = np.empty((size[1], size[0], 4), np.uint8)
        for view, done in self._tiles(frame, size):
            light = self._gathered(frame, view, cast.samples, progress.part(*done))
            try:
                x, y, w, h = view.tile
                top = size[1] - y - h
                pixels[top : top + h, x : x + w] = self._shown(light, frame)
            finally:
                light.release()
        return pixels

    def light(
        self, frame: Frame, size: tuple[int, int], *, samples: int = 1, antialias: bool = True
    ) -> NDArray[np.float32]:
        """float32[h, w, 4]: premultiplied linear light without background, row 0 on top.

        For measurements: nothing is rounded or encoded. One tile, so limited by the viewport.
        """
        size = check_size(size)
        view = View.whole(size, antialias=antialias)
        gathered = self._gathered(frame, view, samples, silent())
        try:
            raw = np.frombuffer(gathered.light.read(components=4, dtype="f4"), np.float32)
        finally:
            gathered.release()
        return raw.reshape(size[1], size[0], 4)[::-1] / np.float32(samples)

    def release(self) -> None:
        """Free everything this renderer put on the GPU."""
        self.resident.release()

    def _tiles(self, frame: Frame, size: tuple[int, int]) -> list[tuple[View, tuple[float, float]]]:
        if any(not m.mesh.empty for m in frame.meshes):
            rects = list(blocks(View.whole(size)))
        else:
            rects = self._squares(frame, size)
        n = len(rects)
        return [(View(size, rect), (i / n, (i + 1) / n)) for i, rect in enumerate(rects)]

    def _squares(self, frame: Frame, size: tuple[int, int]) -> list[Tile]:
        """Parts that are cast by one draw."""
        most = SAMPLES_PER_DRAW if self.gpu.software else 64 * SAMPLES_PER_DRAW
        cast = frame.raycast
        wide = cast.interpolation == "nearest" or cast.gradient == "sobel"
        if wide and raycast.shaded(frame):
            most //= 4  # such gradients look at 26 neighbours
        rays = most * frame.step / frame.longest_side
        side = min(max(math.isqrt(int(rays)) // 16 * 16, 16), TILE, *self.gpu.limits.max_viewport)
        return [
            (x, y, min(side, size[0] - x), min(side, size[1] - y))
            for y in range(0, size[1], side)
            for x in range(0, size[0], side)
        ]

    def _gathered(self, frame: Frame, view: View, samples: int, progress: Progress) -> Gathering:
        self.gpu.activate()
        gathering = Gathering(self.gpu, self.resident, view)
        try:
            for sample in range(samples):
                progress(sample / samples, "rendering")
                gathering.add(frame, progress=progress)
        except BaseException:
            gathering.release()
            raise
        progress(1.0, "rendering")
        return gathering

    def _shown(self, gathering: Gathering, frame: Frame) -> NDArray[np.uint8]:
        """uint8[h, w, 4] of what was gathered, row 0 on top."""
        width, height = gathering.light.size
        target = self.gpu.framebuffer((width, height), "f1")
        try:
            gathering.show(target, frame.background)
            raw = np.frombuffer(target.read(components=4, alignment=1), np.uint8)
        finally:
            self.gpu.release_framebuffer(target)
        return raw.reshape(height, width, 4)[::-1]
