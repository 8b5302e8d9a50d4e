"""A picture that is there at once and gets better: coarse while things move, whole at rest.

At rest the rays are cast in bands of rows that fit a time budget, so that no draw freezes the
window; a sample is shown when its last band is there. The samples are those of `Renderer.image`,
so what is shown in the end is the same picture.
"""

from __future__ import annotations

import time
from dataclasses import dataclass, replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from volviz.gpu.checked import Gpu, colour_texture
from volviz.gpu.passes import display, raycast
from volviz.gpu.passes.raycast import View
from volviz.gpu.residency import Residency
from volviz.model.frame import Frame

MIN_RAYS = 0.12
COARSE_STEP, COARSEST_STEP = 2.0, 3.0
CHEAP_BELOW = 0.6
COARSE_TERMINATION = 0.97
MIN_ROWS = 8
BANDS = 16
"""At least so many draws per sample, so that dear rows cannot surprise us by much."""


@dataclass(frozen=True)
class Progressed:
    """What is on the picture. samples: whole ones, 0 while it is coarse. rays: of the pixels along
    each side. seconds: of the last draw of a whole sample, or of a coarse picture."""

    samples: int = 0
    rays: float = 0.0
    seconds: float = 0.0
    done: bool = False


class Progressive:
    """One picture of a size, drawn better with every call of `coarse` or `refine`."""

    def __init__(self, gpu: Gpu, resident: Residency, rays: float = 0.35) -> None:
        self.gpu = gpu
        self.resident = resident
        self.state = Progressed()
        self.rays = rays
        self._frame: Frame | None = None
        self._light: moderngl.Framebuffer | None = None
        self._coarse: moderngl.Framebuffer | None = None
        self._small: moderngl.Framebuffer | None = None
        self._shown: moderngl.Framebuffer | None = None
        self._current: moderngl.Framebuffer | None = None
        self._row = 0
        self._spent = 0.0
        self._pixels_per_second = 2e5

    @property
    def texture(self) -> int | None:
        """OpenGL's name of the RGBA8 texture with the picture, row 0 at the bottom.

        While things move it is smaller than the picture and to be drawn larger.
        """
        return None if self._current is None else int(colour_texture(self._current).glo)

    def coarse(self, frame: Frame, size: tuple[int, int], budget: float) -> Progressed:
        """Draw all of it now, with as few rays as the budget (seconds) asks for."""
        self.gpu.activate()
        rays = self.rays
        inner = (max(round(size[0] * rays), 1), max(round(size[1] * rays), 1))
        self._coarse = self._fitting(self._coarse, inner, "f4")
        start = time.perf_counter()
        self._coarse.clear()
        self._coarse.use()
        step = 1.0 if rays > 0.75 else COARSE_STEP if rays > 0.3 else COARSEST_STEP
        view = View.whole(inner, step_scale=step)
        raycast.draw(self.gpu, self.resident, _cheaper(frame, rays), view)
        self._small = self._display(self._small, self._coarse, 1, frame)
        colour_texture(self._small).filter = (moderngl.LINEAR, moderngl.LINEAR)
        self.gpu.ctx.finish()
        spent = max(time.perf_counter() - start, 1e-5)
        # Rays on a side go with the root of the time; only part of the way, or it would flicker.
        wanted = rays * (budget / spent) ** 0.5
        self.rays = min(max(0.5 * rays + 0.5 * wanted, MIN_RAYS), 1.0)
        self._frame = None
        self._current = self._small
        self.state = Progressed(0, rays, spent)
        return self.state

    def refine(self, frame: Frame, size: tuple[int, int], budget: float) -> Progressed:
        """Cast full rays for about `budget` seconds; show each sample when it is whole."""
        self.gpu.activate()
        if self._frame is not frame or self._light is None or self._light.size != size:
            self._begin(frame, size)
        if self.state.done:
            return self.state
        deadline = time.perf_counter() + budget
        while not self.state.done:
            self._band(frame, size, deadline - time.perf_counter())
            if time.perf_counter() >= deadline:
                break
        return self.state

    def pixels(self) -> NDArray[np.uint8]:
        """uint8[h, w, 4] of the last whole sample: sRGB, straight alpha, row 0 on top."""
        assert self._shown is not None
        self.gpu.activate()
        width, height = self._shown.size
        raw = np.frombuffer(self._shown.read(components=4, alignment=1), np.uint8)
        return np.ascontiguousarray(raw.reshape(height, width, 4)[::-1])

    def release(self) -> None:
        """Free its framebuffers."""
        for target in (self._light, self._coarse, self._small, self._shown):
            if target is not None:
                self.gpu.release_framebuffer(target)
        self._light = self._coarse = self._small = self._shown = self._current = None
        self._frame = None

    def _begin(self, frame: Frame, size: tuple[int, int]) -> None:
        self._light = self._fitting(self._light, size, "f4")
        self._light.scissor = (0, 0, *size)
        self._light.clear()
        self._frame = frame
        self._row, self._spent = 0, 0.0
        self.state = Progressed(0, self.state.rays, self.state.seconds)

    def _band(self, frame: Frame, size: tuple[int, int], left: float) -> None:
        """Some rows of the present sample, as many as fit into the time that is left."""
        assert self._light is not None
        width, height = size
        fit = int(self._pixels_per_second * max(left, 0.0) / width)
        rows = min(max(fit, MIN_ROWS), max(height // BANDS, MIN_ROWS), height - self._row)
        view = View.whole(size).at_sample(self.state.samples)
        self._light.scissor = (0, self._row, width, rows)
        self._light.use()
        start = time.perf_counter()
        try:
            raycast.draw(self.gpu, self.resident, frame, view)
            self.gpu.ctx.finish()
        finally:
            self._light.scissor = (0, 0, width, height)
        spent = max(time.perf_counter() - start, 1e-5)
        # Rows of background are quick; the ones after them need not be.
        self._pixels_per_second = min(rows * width / spent, 1.5 * self._pixels_per_second)
        self._spent += spent
        self._row += rows
        if self._row >= height:
            self._finish_sample(frame)

    def _finish_sample(self, frame: Frame) -> None:
        assert self._light is not None
        samples = self.state.samples + 1
        self._shown = self._display(self._shown, self._light, samples, frame)
        self._current = self._shown
        done = samples >= frame.raycast.samples
        self.state = Progressed(samples, 1.0, self._spent, done)
        self._row, self._spent = 0, 0.0

    def _display(
        self,
        target: moderngl.Framebuffer | None,
        light: moderngl.Framebuffer,
        samples: int,
        frame: Frame,
    ) -> moderngl.Framebuffer:
        """Light as a picture of the same size; the framebuffer that has it."""
        target = self._fitting(target, light.size, "f1")
        target.use()
        view = View.whole(light.size)
        display.draw(self.gpu, colour_texture(light), samples, frame.background, view)
        return target

    def _fitting(
        self, target: moderngl.Framebuffer | None, size: tuple[int, int], dtype: str
    ) -> moderngl.Framebuffer:
        if target is not None and target.size == size:
            return target
        if target is not None:
            self.gpu.release_framebuffer(target)
        return self.gpu.framebuffer(size, dtype)


def _cheaper(frame: Frame, rays: float) -> Frame:
    """The frame for few large pixels: noise would show more in them than steps do, errors of the
    normals and what shines through the last of the opacity less."""
    cast = replace(frame.raycast, jitter=0.0)
    if rays < CHEAP_BELOW:
        ends = min(cast.termination, COARSE_TERMINATION)
        cast = replace(cast, gradient="intermediate", termination=ends)
    return replace(frame, raycast=cast)
