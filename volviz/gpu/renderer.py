"""Draws frames: into a window's framebuffer, progressively, or as a picture of any size.

It knows nothing of files, scenes or panels. The window and the command line use the same one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from volviz.gpu.checked import Gpu, colour_texture
from volviz.gpu.passes import display, raycast
from volviz.gpu.passes.raycast import View
from volviz.gpu.residency import Residency
from volviz.image import check_size
from volviz.model.frame import Frame
from volviz.progress import Progress, silent

TILE = 512
SAMPLES_PER_DRAW = 1 << 26
"""On the processor: no draw takes longer than a cancel may. Tiles do not show in the picture."""


@dataclass(frozen=True)
class Quality:
    """How much work a draw may be. rays: of the pixels along each side; step: times the frame's."""

    rays: float = 1.0
    step: float = 1.0


FULL = Quality()


@dataclass
class _Gathering:
    """The light gathered so far for one frame at one size and quality."""

    frame: Frame
    view: View
    quality: Quality
    target: moderngl.Framebuffer
    samples: int = 0


class Renderer:
    """Owns what it puts on the GPU; `release` frees it."""

    def __init__(self, gpu: Gpu) -> None:
        self.gpu = gpu
        self.resident = Residency(gpu)
        self._gathering: _Gathering | None = None

    def draw(
        self,
        frame: Frame,
        target: moderngl.Framebuffer,
        quality: Quality = FULL,
        progress: Progress | None = None,
    ) -> int:
        """Draw the frame into any framebuffer, over all of it; return how many samples it shows.

        The same frame drawn again at the same size and quality goes on accumulating jittered
        samples; anything else begins anew.
        """
        self.gpu.activate()
        gathering = self._gather_into(frame, target.size, quality)
        gathering.target.use()
        view = gathering.view.at_sample(gathering.samples)
        raycast.draw(self.gpu, self.resident, frame, view, progress)
        gathering.samples += 1
        target.use()
        texture = colour_texture(gathering.target)
        whole = View.whole(target.size)
        display.draw(self.gpu, texture, gathering.samples, frame.background, whole)
        return gathering.samples

    def image(
        self,
        frame: Frame,
        size: tuple[int, int],
        *,
        samples: int | None = None,
        quality: Quality = FULL,
        progress: Progress | None = None,
    ) -> NDArray[np.uint8]:
        """uint8[h, w, 4], sRGB, straight alpha, row 0 on top. Drawn in tiles; any size.

        samples: jittered pictures averaged, by default the frame's own number.
        """
        size = check_size(size)
        progress = progress or silent()
        cast = frame.raycast if samples is None else replace(frame.raycast, samples=samples)
        count = cast.samples
        pixels = np.empty((size[1], size[0], 4), np.uint8)
        for view, done in self._tiles(frame, size, quality):
            light = self._tile_light(frame, view, count, progress.part(*done))
            try:
                self._show_tile(light, count, frame, view, pixels)
            finally:
                self.gpu.release_framebuffer(light)
        return pixels

    def light(
        self, frame: Frame, size: tuple[int, int], *, samples: int = 1, antialias: bool = True
    ) -> NDArray[np.float32]:
        """float32[h, w, 4]: premultiplied linear light without background, row 0 on top.

        For measurements: nothing is rounded or encoded. One tile, so limited by the viewport.
        """
        size = check_size(size)
        view = View.whole(size, antialias=antialias)
        target = self._tile_light(frame, view, samples, silent())
        try:
            raw = np.frombuffer(target.read(components=4, dtype="f4"), np.float32)
        finally:
            self.gpu.release_framebuffer(target)
        return raw.reshape(size[1], size[0], 4)[::-1] / np.float32(samples)

    def release(self) -> None:
        """Free everything this renderer put on the GPU."""
        self._drop_gathering()
        self.resident.release()

    def _gather_into(self, frame: Frame, size: tuple[int, int], quality: Quality) -> _Gathering:
        known = self._gathering
        inner = (max(round(size[0] * quality.rays), 1), max(round(size[1] * quality.rays), 1))
        if known is not None:
            if known.frame is frame and known.quality == quality and known.view.size == inner:
                return known
            if known.view.size == inner:
                known.target.clear()
                view = View.whole(inner, step_scale=quality.step)
                self._gathering = _Gathering(frame, view, quality, known.target)
                return self._gathering
            self._drop_gathering()
        target = self.gpu.framebuffer(inner, "f4")
        view = View.whole(inner, step_scale=quality.step)
        self._gathering = _Gathering(frame, view, quality, target)
        return self._gathering

    def _drop_gathering(self) -> None:
        if self._gathering is not None:
            self.gpu.release_framebuffer(self._gathering.target)
            self._gathering = None

    def _tiles(
        self, frame: Frame, size: tuple[int, int], quality: Quality
    ) -> list[tuple[View, tuple[float, float]]]:
        most = SAMPLES_PER_DRAW if self.gpu.software else 64 * SAMPLES_PER_DRAW
        if frame.raycast.interpolation == "nearest" and raycast.shaded(frame):
            most //= 4  # gradients of labels look at 26 neighbours
        rays = most * frame.step * quality.step / frame.longest_side
        side = min(max(math.isqrt(int(rays)) // 16 * 16, 16), TILE, *self.gpu.limits.max_viewport)
        rects = [
            (x, y, min(side, size[0] - x), min(side, size[1] - y))
            for y in range(0, size[1], side)
            for x in range(0, size[0], side)
        ]
        n = len(rects)
        return [
            (View(size, rect, step_scale=quality.step), (i / n, (i + 1) / n))
            for i, rect in enumerate(rects)
        ]

    def _tile_light(
        self, frame: Frame, view: View, samples: int, progress: Progress
    ) -> moderngl.Framebuffer:
        self.gpu.activate()
        target = self.gpu.framebuffer(view.tile[2:], "f4")
        try:
            for sample in range(samples):
                progress(sample / samples, "rendering")
                target.use()
                raycast.draw(self.gpu, self.resident, frame, view.at_sample(sample), progress)
                self.gpu.ctx.finish()  # otherwise a cancel would wait for all queued samples
        except BaseException:
            self.gpu.release_framebuffer(target)
            raise
        progress(1.0, "rendering")
        return target

    def _show_tile(
        self,
        light: moderngl.Framebuffer,
        samples: int,
        frame: Frame,
        view: View,
        pixels: NDArray[np.uint8],
    ) -> None:
        x, y, w, h = view.tile
        shown = self.gpu.framebuffer((w, h), "f1")
        try:
            shown.use()
            display.draw(self.gpu, colour_texture(light), samples, frame.background, view)
            raw = np.frombuffer(shown.read(components=4, alignment=1), np.uint8)
        finally:
            self.gpu.release_framebuffer(shown)
        top = view.size[1] - y - h
        pixels[top : top + h, x : x + w] = raw.reshape(h, w, 4)[::-1]
