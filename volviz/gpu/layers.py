"""Surfaces in the volume: layers from front to back, and the rays from one to the next.

The opaque surfaces are drawn first: no ray goes beyond them. The translucent ones are peeled off
layer by layer, nearest first (Everitt 2001), from every side right; each layer ends a part of the
rays and shines onto what was gathered before it. So the volume between two surfaces is integrated
where it is, and all together costs one ray per pixel. A mode that shows one place of each ray, as
the maximum is, has nothing to integrate: there all layers come first, and the whole ray behind.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import replace
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from volviz.gpu import shaders
from volviz.gpu.checked import Gpu, colour_texture
from volviz.gpu.pace import Pace
from volviz.gpu.passes import raycast, surface
from volviz.gpu.passes.raycast import Ends
from volviz.gpu.passes.view import Tile, View, uneven
from volviz.gpu.residency import Residency
from volviz.model.frame import Frame
from volviz.progress import Progress

FILE, BEHIND = "raycast/ends_layers.glsl", "raycast/ends_behind.glsl"
UNITS = ("u_gathered", "u_near_key", "u_far_key", "u_far_color", "u_opaque_key", "u_opaque_color")
FIRST_UNIT = 3  # those before are the volume's
MIN_ROWS = 8
FIRST_BANDS, BANDS = 16, 4
"""At least so many draws for the rays to the first layer, and for those behind it."""


class Layers:
    """The framebuffers that it takes, as large as the largest part that was drawn."""

    def __init__(self, gpu: Gpu, resident: Residency) -> None:
        self._gpu, self._resident = gpu, resident
        self._size = (0, 0)
        self._opaque: moderngl.Framebuffer | None = None
        self._peeled: list[moderngl.Framebuffer] = []
        self._gathered: list[moderngl.Framebuffer] = []
        self._query: Any = None
        self._paces: dict[tuple[int, bool], Pace] = {}
        self._triangles = Pace(surface.PART / surface.PART_SECONDS)

    def draw(
        self,
        frame: Frame,
        view: View,
        target: moderngl.Framebuffer,
        corner: tuple[int, int],
        progress: Progress | None = None,
    ) -> Iterator[None]:
        """Add a sample of the view's tile to a float framebuffer, whose first pixel is `corner` of
        the picture.

        It is there once the iterator ends; parts of the triangles and of the rays of each layer
        are steps of it, so that a window may do something else in between.
        """
        self._fit(view.tile[2:])
        keys = surface.keys_of(frame, self._resident.meshes)
        assert self._opaque is not None
        self._begin(self._opaque, view)
        yield from surface.draw(
            self._gpu,
            self._resident.meshes,
            frame,
            view,
            target=self._opaque,
            keys=keys,
            pace=self._triangles,
        )
        yield
        count = 0
        if any(not m.opaque for m in frame.meshes):
            count = yield from self._translucent(frame, view, keys, progress)
        x, y, width, height = view.tile
        whole = replace(view, tile=(*corner, *target.size))

        def cast(band: Tile) -> None:
            target.scissor = (band[0] + x - corner[0], band[1] + y - corner[1], *band[2:])
            target.use()
            self._part(frame, whole, keys, count, last=True, progress=progress, first=(x, y))

        yield from self._in_bands((0, 0, width, height), (count, True), cast)

    def _translucent(
        self, frame: Frame, view: View, keys: surface.Keys, progress: Progress | None
    ) -> Generator[None, None, int]:
        """Gather what is seen down to the last layer; the number of layers."""
        rect: Tile = (0, 0, *view.tile[2:])
        now = rect

        def cast(band: Tile) -> None:
            into = self._gathered[number % 2]
            into.viewport, into.scissor = (0, 0, *view.tile[2:]), band
            into.use()
            self._part(frame, view, keys, number, last=False, progress=progress)

        for number in range(view.layers):
            left = self._left(number, view) if self._gpu.software else None
            # What ended with the layer before is copied once more, so that both framebuffers have
            # it; then it is left alone.
            rect, now = now, now if left is None else _open(left, view)
            if min(now[2:]) < 1 or not (yield from self._peel(frame, view, keys, number, left)):
                return number
            yield
            yield from self._in_bands(rect, (number, False), cast)
        return view.layers

    def _in_bands(
        self, rect: Tile, which: tuple[int, bool], cast: Callable[[Tile], None]
    ) -> Iterator[None]:
        """Cast a part of the tile, so many rows at once as go in a short time.

        which: number of the layer, and whether these are the last rays.
        """
        x, y, width, height = rect
        pace = self._paces.setdefault(which, Pace(2e5))
        # Rays behind the first layers are few; dear rows among the others must not surprise us.
        most = max(-(-height // (BANDS if which[0] else FIRST_BANDS)), MIN_ROWS)
        done = 0
        while done < height:
            rows = min(max(pace.amount() // width, MIN_ROWS), most, height - done)
            start = time.perf_counter()
            cast((x, y + done, width, rows))
            self._gpu.ctx.finish()
            pace.took(rows * width, time.perf_counter() - start)
            done += rows
            yield

    def keep_depth(
        self, frame: Frame, view: View, target: moderngl.Framebuffer, corner: tuple[int, int]
    ) -> None:
        """How far the opaque surfaces of the view's tile, just drawn, are: mm along the rays.

        target: one float a pixel; its first pixel is `corner` of the picture.
        """
        assert self._opaque is not None
        slope, start = surface.keys_of(frame, self._resident.meshes).place
        first = view.tile[0] - corner[0], view.tile[1] - corner[1]
        program = shaders.program(self._gpu, "lib/fullscreen.vert", "surface/depth.frag", {})
        shaders.set_uniforms(
            program,
            u_opaque=0,
            u_first_px=tuple(map(float, first)),
            u_place=(slope * frame.spacing, start * frame.spacing),
        )
        colour_texture(self._opaque, 1).use(0)
        target.scissor = (*first, *view.tile[2:])
        target.use()
        raycast.cover(self._gpu, program, add=False)
        self._gpu.check("keeping the depth")

    def release(self) -> None:
        """Free the framebuffers."""
        for target in (self._opaque, *self._peeled, *self._gathered):
            if target is not None:
                self._gpu.release_framebuffer(target)
        self._opaque, self._peeled, self._gathered, self._size = None, [], [], (0, 0)

    def _fit(self, size: tuple[int, int]) -> None:
        if size[0] <= self._size[0] and size[1] <= self._size[1]:
            return
        room = uneven(max(size[0], self._size[0])), uneven(max(size[1], self._size[1]))
        self.release()
        make = self._gpu.framebuffer
        self._opaque = make(room, "f4", depth=True, number=True)
        self._size = room

    def _peel(
        self,
        frame: Frame,
        view: View,
        keys: surface.Keys,
        number: int,
        left: NDArray[np.float32] | None,
    ) -> Generator[None, None, bool]:
        """Draw the layer of this number; False if there is nothing left. left: see `_left`."""
        gpu, room = self._gpu, self._size
        while len(self._peeled) < 2:
            self._peeled.append(gpu.framebuffer(room, "f4", depth=True, number=True))
            self._gathered.append(gpu.framebuffer(room, "f4"))
        if self._query is None:
            self._query = gpu.ctx.query(samples=True)
        assert self._opaque is not None
        target = self._peeled[number % 2]
        self._begin(target, view)
        layer = surface.Layer(
            number,
            colour_texture(self._peeled[(number + 1) % 2], 1),
            colour_texture(self._opaque, 1),
            colour_texture(self._gathered[(number + 1) % 2]),
            raycast.termination(frame),
            left,
        )
        drawing = surface.draw(
            gpu,
            self._resident.meshes,
            frame,
            view,
            target=target,
            keys=keys,
            pace=self._triangles,
            layer=layer,
        )
        seen = 0
        while True:
            with self._query:
                whole = next(drawing, "whole") == "whole"
            seen += int(self._query.samples)
            if whole:
                return seen > 0
            yield

    def _left(self, number: int, view: View) -> NDArray[np.float32]:
        """Where behind the layer before there may be more. Reading back costs a processor less than
        drawing triangles that nobody sees, and graphics more."""
        before = self._read(self._peeled[(number + 1) % 2], view) if number else None
        assert self._opaque is not None
        return surface.left_behind(before, self._read(self._opaque, view))

    def _read(self, target: moderngl.Framebuffer, view: View) -> NDArray[np.float32]:
        keys = colour_texture(target, 1)
        width, height = view.tile[2:]
        whole = np.frombuffer(keys.read(alignment=1), np.float32).reshape(keys.size[::-1])
        return whole[:height, :width]

    def _part(
        self,
        frame: Frame,
        view: View,
        keys: surface.Keys,
        number: int,
        *,
        last: bool,
        progress: Progress | None,
        first: tuple[int, int] | None = None,
    ) -> None:
        """Cast the rays from the layer before to this one; the last part: to where they end."""
        cast = frame.raycast
        behind = cast.show_volume and not raycast.MODES[cast.mode].per_length
        ends = self._ends(keys, number, last, first or view.tile[:2])
        if behind:
            own = {k: v for k, v in ends.uniforms.items() if k != "u_near_key"}
            ends = replace(ends, file=BEHIND, uniforms=own)
        if cast.show_volume and (last or not behind):
            raycast.draw(
                self._gpu, self._resident, frame, view, progress=progress, ends=ends, add=last
            )
            return
        program = shaders.program(
            self._gpu, "lib/fullscreen.vert", "surface/compose.frag", {"@ends": ends.file}
        )
        shaders.set_uniforms(
            program,
            **ends.uniforms,
            u_origin_px=tuple(map(float, view.tile[:2])),
            u_termination=raycast.termination(frame),
        )
        for unit, texture in ends.textures.items():
            texture.use(unit)
        raycast.cover(self._gpu, program, add=last)
        self._gpu.check("composing surfaces")

    def _ends(self, keys: surface.Keys, number: int, last: bool, first: tuple[int, int]) -> Ends:
        opaque = self._opaque
        assert opaque is not None
        before = self._gathered[(number + 1) % 2] if number else opaque
        near = self._peeled[(number + 1) % 2] if number else opaque
        far = opaque if last else self._peeled[number % 2]
        textures = (
            colour_texture(before),
            colour_texture(near, 1),
            colour_texture(far, 1),
            colour_texture(far),
            colour_texture(opaque, 1),
            colour_texture(opaque),
        )
        units = {name: FIRST_UNIT + i for i, name in enumerate(UNITS)}
        uniforms = {
            **units,
            "u_layers": (int(number > 0), int(not last)),
            "u_first_px": tuple(map(float, first)),
            "u_place": keys.place,
        }
        return Ends(FILE, uniforms, {FIRST_UNIT + i: t for i, t in enumerate(textures)})

    def _begin(self, target: moderngl.Framebuffer, view: View) -> None:
        target.scissor = (0, 0, *view.tile[2:])
        target.use()
        target.clear(depth=1.0)


def _open(left: NDArray[np.float32], view: View) -> Tile:
    """Of the tile, the part (x, y, width, height) in which rays go on behind the layer before."""
    rows, columns = np.nonzero(np.isfinite(left[0]))
    if not len(rows):
        return 0, 0, 0, 0
    width, height = view.tile[2:]
    x, y = int(columns.min()) * surface.BLOCK, int(rows.min()) * surface.BLOCK
    right = min((int(columns.max()) + 1) * surface.BLOCK, width)
    top = min((int(rows.max()) + 1) * surface.BLOCK, height)
    return x, y, right - x, top - y
