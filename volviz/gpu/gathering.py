"""The light gathered for a picture or a part of it: what every way of drawing goes through."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl

from volviz.gpu.checked import Gpu, colour_texture
from volviz.gpu.layers import Layers
from volviz.gpu.passes import display, raycast
from volviz.gpu.passes.view import View
from volviz.gpu.residency import Residency
from volviz.model.frame import Frame
from volviz.model.scene import Background
from volviz.progress import Progress


class Gathering:
    """The sum of a frame's jittered samples over the tile of a view, in a float framebuffer.

    light: premultiplied linear light, of the tile's size. samples: how many are whole.
    """

    def __init__(self, gpu: Gpu, resident: Residency, view: View) -> None:
        self.view = view
        self.light = gpu.framebuffer(view.tile[2:], "f4")
        self.samples = 0
        self.row = 0
        self._gpu, self._resident = gpu, resident
        self._layers = Layers(gpu, resident)
        self._band: tuple[int, Iterator[None]] | None = None

    def clear(self) -> None:
        """Begin anew."""
        self.light.scissor = (0, 0, *self.light.size)
        self.light.clear()
        self.samples = self.row = 0
        self._band = None

    def add(self, frame: Frame, rows: int | None = None, progress: Progress | None = None) -> bool:
        """Cast the next rows (default: the rest) of the present sample; True once it is whole.

        It waits until they are drawn: otherwise a cancel would wait for all that is queued.
        """
        while not self.step(frame, rows, progress):
            pass
        return self.row == 0

    def step(self, frame: Frame, rows: int | None = None, progress: Progress | None = None) -> int:
        """Draw something of the next rows: all of it, or one layer of surfaces. The number of rows
        that are there now, 0 until the last layer is; only then others may be asked for."""
        if self._band is None:
            height = self.light.size[1]
            more = height - self.row if rows is None else min(rows, height - self.row)
            self._band = more, self._drawing(frame, more, progress)
        more, drawing = self._band
        try:
            unfinished = next(drawing, "whole") != "whole"
            self._gpu.ctx.finish()
        finally:
            self.light.scissor = (0, 0, *self.light.size)
        if unfinished:
            return 0
        self._band = None
        self.row += more
        if self.row >= self.light.size[1]:
            self.row = 0
            self.samples += 1
        return more

    def _drawing(self, frame: Frame, rows: int, progress: Progress | None) -> Iterator[None]:
        """The next rows of the present sample, whole once it ends."""
        view = self.view.at_sample(self.samples)
        if any(not m.mesh.empty for m in frame.meshes):
            band = view.rows(self.row, rows)
            yield from self._layers.draw(frame, band, self.light, self.row, progress)
        elif frame.raycast.show_volume:
            self.light.scissor = (0, self.row, self.light.size[0], rows)
            self.light.use()
            raycast.draw(self._gpu, self._resident, frame, view, progress=progress)

    def show(self, target: moderngl.Framebuffer, background: Background) -> None:
        """The mean of the samples over the background, into a framebuffer of the same size.

        Only between samples: half of one would show.
        """
        target.use()
        light = colour_texture(self.light)
        display.draw(self._gpu, light, self.samples, background, self.view)

    def release(self) -> None:
        """Free its framebuffers."""
        self._layers.release()
        self._gpu.release_framebuffer(self.light)
