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

from volviz.gpu import ahead
from volviz.gpu.checked import Gpu, colour_texture
from volviz.gpu.detail import lighter
from volviz.gpu.gathering import Gathering
from volviz.gpu.pace import Pace
from volviz.gpu.passes import display
from volviz.gpu.passes.view import View
from volviz.gpu.residency import Residency
from volviz.model.frame import Frame

MIN_RAYS = 0.12
COARSE_RAYS, COARSE_STEPS = (MIN_RAYS, 0.3, 0.75), (3.0, 2.0, 1.0)
"""While things move: so many times the step at so many rays along a side, between them a line. At
equal cost more rays of larger steps blur less, larger steps miss thin things."""
STEP_CHANGE = 0.4
"""The step stays until another one is so much better: the table is made for each."""
CHEAP_BELOW = 0.6
COARSE_TERMINATION = 0.97
COARSE_LAYERS = 3
"""Of translucent surfaces, drawn by the processor while things move."""
BETWEEN = 0.5
BETWEEN_SECONDS = 0.5
"""At rest, what takes longer than this is shown with half the rays along each side first."""
MIN_ROWS = 8
UPLOAD_SECONDS = 0.03
ALMOST = 0.999
BANDS = 16
"""At least so many draws per sample, so that dear rows cannot surprise us by much."""


@dataclass(frozen=True)
class Progressed:
    """What is on the picture. samples: whole ones, 0 while it is coarse. rays: of the pixels along
    each side. seconds: of the last draw of a whole sample, or of a coarse picture. step: times the
    frame's own. uploaded: part
    of the volume that is on the GPU; until it is 1 the picture before stays. compiling: it waits
    only for shaders, which are made ready elsewhere."""

    samples: int = 0
    rays: float = 0.0
    seconds: float = 0.0
    done: bool = False
    uploaded: float = 1.0
    compiling: bool = False
    step: float = 1.0


class Progressive:
    """One picture of a size, drawn better with every call of `coarse` or `refine`."""

    def __init__(
        self,
        gpu: Gpu,
        resident: Residency,
        rays: float = 0.35,
        between: float = BETWEEN_SECONDS,
    ) -> None:
        self.gpu = gpu
        self.resident = resident
        self.state = Progressed()
        self.rays = rays
        self._step = 1.0
        self._frame: Frame | None = None
        self._size = (0, 0)
        self._light: Gathering | None = None
        self._few: Gathering | None = None
        self._coarse: Gathering | None = None
        self._between = between
        self._views: list[View] = []
        self._lighter: Frame | None = None
        self._small: moderngl.Framebuffer | None = None
        self._shown: moderngl.Framebuffer | None = None
        self._current: moderngl.Framebuffer | None = None
        self._spent = self._unfinished = 0.0
        self._pace = Pace(2e5)
        self._seen: Gathering | None = None
        self.depths = 0

    @property
    def depth(self) -> moderngl.Texture | None:
        """How far the opaque surfaces in the picture are, as `Gathering.depth`; None without any.

        `depths` counts how often it has changed.
        """
        return None if self._seen is None else self._seen.depth

    @property
    def texture(self) -> int | None:
        """OpenGL's name of the RGBA8 texture with the picture, row 0 at the bottom.

        While things move it is smaller than the picture and to be drawn larger.
        """
        return None if self._current is None else int(colour_texture(self._current).glo)

    def coarse(self, frame: Frame, size: tuple[int, int], budget: float) -> Progressed:
        """Draw all of it now, with as few rays as the budget (seconds) asks for."""
        moving = lighter(frame, _inner(size, self.rays)) if self.gpu.software else frame
        if not self._there(moving):
            return self.state
        rays = self.rays
        inner = _inner(size, rays)
        step = self._coarse_step(rays)
        start = time.perf_counter()
        view = View.whole(inner, step_scale=step)
        if self.gpu.software:
            view = replace(view, layers=COARSE_LAYERS)
        self._coarse = self._gathering(self._coarse, view)
        self._coarse.add(_cheaper(moving, rays))
        self._show_small(self._coarse, frame)
        self.gpu.ctx.finish()
        spent = max(time.perf_counter() - start, 1e-5)
        # Rays on a side go with the root of the time; only part of the way, or it would flicker.
        wanted = rays * (budget / spent) ** 0.5
        self.rays = min(max(0.5 * rays + 0.5 * wanted, MIN_RAYS), 1.0)
        self._frame = None
        self.state = Progressed(0, rays, spent, step=step)
        return self.state

    def refine(self, frame: Frame, size: tuple[int, int], budget: float) -> Progressed:
        """Cast full rays for about `budget` seconds; show each sample when it is whole."""
        if not self._there(frame):
            return self.state
        if self._frame is not frame or self._size != size:
            self._begin(frame, size)
        deadline = time.perf_counter() + budget
        while not self.state.done:
            self._band(frame, deadline - time.perf_counter())
            if time.perf_counter() >= deadline:
                break
        if self.state.done:
            ahead.look_ahead(self.gpu, frame)
        return self.state

    def show(self, target: moderngl.Framebuffer) -> None:
        """Draw what there is, coarse or refined, into any framebuffer, over all of it."""
        assert self._current is not None, "nothing was drawn yet"
        self.gpu.activate()
        target.use()
        display.copy(self.gpu, colour_texture(self._current))

    def pixels(self) -> NDArray[np.uint8]:
        """uint8[h, w, 4] of the last whole sample: sRGB, straight alpha, row 0 on top."""
        assert self._shown is not None
        self.gpu.activate()
        width, height = self._shown.size
        raw = np.frombuffer(self._shown.read(components=4, alignment=1), np.uint8)
        return np.ascontiguousarray(raw.reshape(height, width, 4)[::-1])

    def release(self) -> None:
        """Free its framebuffers, and its volume unless another picture shows it."""
        self.resident.forget(self)
        for gathering in (self._light, self._few, self._coarse):
            if gathering is not None:
                gathering.release()
        for target in (self._small, self._shown):
            if target is not None:
                self.gpu.release_framebuffer(target)
        self._light = self._few = self._coarse = self._small = self._shown = self._current = None
        self._frame = self._seen = None

    def _there(self, frame: Frame) -> bool:
        """True once volume, meshes and shaders are there; until then a part more with each call."""
        self.gpu.activate()
        compiled = ahead.ready(self.gpu, frame)
        part = self.resident.upload(frame.voxels, UPLOAD_SECONDS, self)
        if part >= 1.0 and frame.meshes:
            meshes = [m.mesh for m in frame.meshes]
            part = self.resident.meshes.upload(meshes, UPLOAD_SECONDS)
        there = part >= 1.0 and compiled
        if not there:
            self._frame = None
            rays, seconds = self.state.rays, self.state.seconds
            uploaded, waits = min(part, ALMOST), part >= 1.0
            self.state = Progressed(0, rays, seconds, uploaded=uploaded, compiling=waits)
        return there

    def _coarse_step(self, rays: float) -> float:
        """In halves, so that it does not change with every picture."""
        ideal = float(np.interp(rays, COARSE_RAYS, COARSE_STEPS))
        if abs(ideal - self._step) > STEP_CHANGE:
            self._step = round(2 * ideal) / 2
        return self._step

    def _begin(self, frame: Frame, size: tuple[int, int]) -> None:
        """From the first row. What would take long after a coarse picture gets one in between."""
        seconds = size[0] * size[1] / self._pace.per_second
        self._views, self._lighter = [], None
        if 0.0 < self.state.rays < BETWEEN and seconds > self._between:
            if any(not m.mesh.empty for m in frame.meshes):
                half = _inner(size, BETWEEN)
                self._views = [View.whole(half)]
                self._lighter = lighter(frame, half) if self.gpu.software else frame
            else:
                self._views = View.quarters(size)
            self._few = self._gathering(self._few, self._views[0])
        self._light = self._gathering(self._light, View.whole(size))
        self._frame, self._size = frame, size
        self._spent = self._unfinished = 0.0
        self.state = Progressed(0, self.state.rays, self.state.seconds)

    def _band(self, frame: Frame, left: float) -> None:
        """Some rows of the present sample, as many as fit into the time that is left."""
        light = self._few if self._views else self._light
        assert light is not None
        width, height = light.light.size
        fit = self._pace.amount(max(left, 0.0)) // width
        rows = min(max(fit, MIN_ROWS), max(height // BANDS, MIN_ROWS), height - light.row)
        start, before = time.perf_counter(), light.samples
        done = light.step(self._lighter or frame, rows)
        self._unfinished += max(time.perf_counter() - start, 1e-5)
        if not done:
            return
        spent, self._unfinished = self._unfinished, 0.0
        whole = light.samples > before
        self._pace.took(done, spent)
        self._spent += spent
        if whole and self._views:
            self._add_few(light, frame)
        elif whole:
            self._add_whole(light, frame)

    def _add_few(self, few: Gathering, frame: Frame) -> None:
        """Half the rays along each side are there: shown first, then a part of the whole."""
        assert self._light is not None
        if self.state.rays < BETWEEN:
            self._show_small(few, frame)
            self.state = Progressed(0, BETWEEN, self._spent)
        self._views = self._views[1:]
        if self._lighter is not None:
            self._lighter, self._spent = None, 0.0  # of other triangles: to be drawn anew
            return
        self._light.weave(few, last=not self._views)
        if self._views:
            few.begin(self._views[0])
        else:
            self._add_whole(self._light, frame)

    def _add_whole(self, light: Gathering, frame: Frame) -> None:
        self._shown = self._current = self._fitting(self._shown, light.light.size)
        self.depths += self._seen is not light or light.samples == 1
        self._seen = light
        light.show(self._shown, frame.background)
        last = light.samples >= frame.raycast.samples
        self.state = Progressed(light.samples, 1.0, self._spent, last)
        self._spent = 0.0

    def _show_small(self, light: Gathering, frame: Frame) -> None:
        """A picture with fewer pixels, to be drawn larger."""
        self._small = self._current = self._fitting(self._small, light.light.size)
        self.depths, self._seen = self.depths + 1, light
        light.show(self._small, frame.background)
        colour_texture(self._small).filter = (moderngl.LINEAR, moderngl.LINEAR)

    def _gathering(self, known: Gathering | None, view: View) -> Gathering:
        """An empty one for this view, the known one's framebuffer again if it fits."""
        if known is not None and known.light.size == view.tile[2:]:
            known.begin(view)
            return known
        if known is not None:
            known.release()
            self._seen = None if self._seen is known else self._seen
        return Gathering(self.gpu, self.resident, view, deep=True)

    def _fitting(
        self, target: moderngl.Framebuffer | None, size: tuple[int, int]
    ) -> moderngl.Framebuffer:
        if target is not None and target.size == size:
            return target
        if target is not None:
            self.gpu.release_framebuffer(target)
        return self.gpu.framebuffer(size, "f1")


def _inner(size: tuple[int, int], rays: float) -> tuple[int, int]:
    return max(round(size[0] * rays), 1), max(round(size[1] * rays), 1)


def _cheaper(frame: Frame, rays: float) -> Frame:
    """The frame for few large pixels: noise would show more in them than steps do, what shines
    through the last of the opacity less. Not with cheaper normals: errors twice as large."""
    cast = replace(frame.raycast, jitter=0.0)
    if rays < CHEAP_BELOW:
        cast = replace(cast, termination=min(cast.termination, COARSE_TERMINATION))
    return replace(frame, raycast=cast)
