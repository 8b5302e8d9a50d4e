"""The light gathered for a picture or a part of it: what every way of drawing goes through."""

from __future__ import annotations

from collections.abc import Iterator

import moderngl

from volviz.errors import Cancelled
from volviz.gpu.checked import Gpu, colour_texture
from volviz.gpu.layers import Layers
from volviz.gpu.passes import display, raycast
from volviz.gpu.passes.view import View, blocks
from volviz.gpu.residency import Residency
from volviz.model.frame import Frame
from volviz.model.scene import Background
from volviz.progress import Progress


class Gathering:
    """The sum of a frame's jittered samples over the tile of a view, in a float framebuffer.

    light: premultiplied linear light, of the tile's size. samples: how many are whole. row: of the
    present sample, the first that is not there yet. With surfaces the tile is a whole picture, or
    one of its `blocks`. depth: of the first sample, once that is whole: mm along each ray to the
    opaque surfaces, 0 for none; only where it is asked for.
    """

    def __init__(self, gpu: Gpu, resident: Residency, view: View, *, deep: bool = False) -> None:
        self.view = view
        self._deep = deep
        self._far: moderngl.Framebuffer | None = None
        self._far_there = False
        self.light = gpu.framebuffer(view.tile[2:], "f4")
        self.samples = 0
        self._gpu, self._resident = gpu, resident
        self._layers = Layers(gpu, resident)
        self._pixels = 0
        self._part: tuple[int, Iterator[None]] | None = None

    @property
    def row(self) -> int:
        """The first row of the present sample that is not whole."""
        return self._pixels // self.light.size[0]

    def begin(self, view: View) -> None:
        """Begin anew, with another part of the same size."""
        self.view = view
        self.light.scissor = (0, 0, *self.light.size)
        self.light.clear()
        self.samples = self._pixels = 0
        self._part = None
        self._far_there = False

    def add(self, frame: Frame, rows: int | None = None, progress: Progress | None = None) -> None:
        """Draw the rest of the present sample, so many rows at once.

        It waits until they are drawn: otherwise a cancel would wait for all that is queued.
        """
        before = self.samples
        while self.samples == before:
            if progress is not None and progress.cancelled:
                raise Cancelled
            self.step(frame, rows, progress)

    def step(self, frame: Frame, rows: int | None = None, progress: Progress | None = None) -> int:
        """Draw a little: the next rows, or a part of the surfaces or of the rays between them. The
        number of pixels that are whole now, 0 for such a part; only then rows may be asked for."""
        if self._part is None:
            self._part = self._next(frame, rows, progress)
        pixels, drawing = self._part
        try:
            unfinished = next(drawing, "whole") != "whole"
            self._gpu.ctx.finish()
        finally:
            self.light.scissor = (0, 0, *self.light.size)
        if unfinished:
            return 0
        self._part = None
        self._pixels += pixels
        width, height = self.light.size
        if self._pixels >= width * height:
            self._pixels = 0
            self.samples += 1
        return pixels

    def _next(
        self, frame: Frame, rows: int | None, progress: Progress | None
    ) -> tuple[int, Iterator[None]]:
        """How many pixels are next, and what draws them."""
        view = self.view.at_sample(self.samples)
        width, height = self.light.size
        if any(not m.mesh.empty for m in frame.meshes):
            done = 0
            for tile in blocks(view):
                if done == self._pixels:
                    break
                done += tile[2] * tile[3]
            block = view.part(tile)
            return tile[2] * tile[3], self._surfaces(frame, block, progress)
        more = height - self.row if rows is None else min(rows, height - self.row)
        return more * width, self._rows(frame, view, more, progress)

    def _rows(
        self, frame: Frame, view: View, rows: int, progress: Progress | None
    ) -> Iterator[None]:
        """The next rows of the present sample, whole once it ends."""
        if frame.raycast.show_volume:
            self.light.scissor = (0, self.row, self.light.size[0], rows)
            self.light.use()
            raycast.draw(self._gpu, self._resident, frame, view, progress=progress)
        yield from ()

    def _surfaces(self, frame: Frame, block: View, progress: Progress | None) -> Iterator[None]:
        corner = self.view.tile[:2]
        yield from self._layers.draw(frame, block, self.light, corner, progress)
        if self._deep and self.samples == 0:
            if self._far is None:
                self._far = self._gpu.framebuffer(self.light.size, "f4", 1)
            self._layers.keep_depth(frame, block, self._far, corner)
            self._far_there = True

    @property
    def depth(self) -> moderngl.Texture | None:
        """See above; None before there is one, and without surfaces."""
        there = self._far_there and self.samples > 0
        return colour_texture(self._far) if self._far is not None and there else None

    def weave(self, quarter: Gathering, *, last: bool) -> None:
        """Take over a quarter of the pixels of the first sample, which is whole with the last."""
        self.light.use()
        display.weave(self._gpu, colour_texture(quarter.light), quarter.view.first)
        self.samples = int(last)

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
        if self._far is not None:
            self._gpu.release_framebuffer(self._far)
        self._gpu.release_framebuffer(self.light)
