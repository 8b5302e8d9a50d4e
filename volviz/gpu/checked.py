"""An OpenGL context whose makers check errors: moderngl itself never asks glGetError.

A texture larger than the limit, or than the memory, comes back from moderngl as an object that
looks fine and renders black. Every maker of `Gpu` drains the errors before and after, checks the
size first, and raises: `LimitError` for size and memory, `GraphicsError` naming the call for the
rest. moderngl's other traps are closed here too: textures repeat and filter NEAREST by default
(we clamp and say the filter), rows are packed without padding (alignment 1), and objects that
Python drops are deleted with their own context current, on its own thread.
"""

from __future__ import annotations

import os
import threading
import weakref
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, Literal

import moderngl
import numpy as np
from numpy.typing import NDArray

from volviz.errors import GraphicsError, LimitError
from volviz.gpu.formats import expect, slabs, texture_bytes, times
from volviz.progress import Progress, silent

Rung = Literal["window", "egl", "glfw-egl", "glfw-osmesa"]
SOFTWARE = ("llvmpipe", "softpipe", "swrast", "software rasterizer", "swiftshader")


class ContextLost(GraphicsError):
    """The driver took the context away (a reset, a changed graphics card): all in it is gone."""


@dataclass(frozen=True)
class Attempt:
    """One rung (and device) that was tried: why it was taken or left. ms: time it took."""

    rung: str
    device: int | None
    ok: bool
    reason: str
    renderer: str = ""
    ms: float = 0.0


@dataclass(frozen=True)
class GpuLimits:
    """Largest sides in texels or pixels."""

    max_texture: int
    max_texture_3d: int
    max_viewport: tuple[int, int]


@dataclass
class _Owned:
    """What changes in a Gpu: its live objects, its programs, whether it is closed.

    lost: asks whether the driver took it away. gone: it did. ahead: who compiles (ahead.py).
    """

    textures: weakref.WeakSet[Any] = field(default_factory=weakref.WeakSet)
    buffers: weakref.WeakSet[Any] = field(default_factory=weakref.WeakSet)
    framebuffers: weakref.WeakSet[Any] = field(default_factory=weakref.WeakSet)
    programs: dict[Any, Any] = field(default_factory=dict)
    on_release: list[Callable[[], None]] = field(default_factory=list)
    lost: Callable[[], bool] = lambda: False
    gone: bool = False
    ahead: Any = None
    released: bool = False


@dataclass(frozen=True, eq=False)
class Gpu:
    """An open OpenGL context: what it is, how it was found, and makers that check errors.

    rung, because: which rung of the ladder and why. attempts: every rung that was tried. version:
    GL_VERSION; code: 330, 450, …. software: a rasteriser on the CPU. thread: the only one that
    may call it. Use as a context manager or call `release`.
    """

    ctx: moderngl.Context
    rung: Rung
    because: str
    vendor: str
    renderer: str
    version: str
    code: int
    software: bool
    limits: GpuLimits
    device: int | None = None
    attempts: tuple[Attempt, ...] = ()
    thread: int = field(default_factory=threading.get_ident)
    process: int = field(default_factory=os.getpid)
    owned: _Owned = field(default_factory=_Owned, repr=False)

    def __enter__(self) -> Gpu:
        self.activate()
        return self

    def __exit__(self, *_: object) -> None:
        self.release()

    # --- the context -------------------------------------------------------------------------

    @property
    def released(self) -> bool:
        """True once the context was closed."""
        return self.owned.released

    @property
    def live(self) -> dict[str, int]:
        """How many textures, buffers, framebuffers and programs exist now, for leak tests."""
        owned = self.owned
        kinds = {
            "textures": owned.textures,
            "buffers": owned.buffers,
            "framebuffers": owned.framebuffers,
        }
        counts = {name: sum(map(_alive, objects)) for name, objects in kinds.items()}
        return {**counts, "programs": len(owned.programs)}

    def activate(self) -> None:
        """Make this context current, and delete what Python dropped. Only on its own thread."""
        if not self.owned.released and not self.lost():
            self._collect()
        elif self.owned.gone:
            raise ContextLost(f"the OpenGL context of {self.renderer} was lost")
        else:
            raise GraphicsError("this OpenGL context was closed")

    def lost(self) -> bool:
        """Make current; true if that is no longer possible. It is then closed, nothing deleted."""
        if os.getpid() != self.process:
            raise forked()
        if threading.get_ident() != self.thread:
            raise GraphicsError(
                "OpenGL was called from another thread than the one that opened it",
                fix="send the call to the thread that opened the context",
            )
        self.ctx.__enter__()
        if self.owned.lost():
            self.owned.released = self.owned.gone = True
            self._released()
        return self.owned.released

    def check(self, what: str) -> None:
        """Raise if an OpenGL error is pending; `what` names the calls since the last check."""
        self._raise_for(self._drain(), what)

    def release(self) -> None:
        """Delete everything that was made here and close the context. Twice does no harm."""
        if self.owned.released or self.lost():
            return
        self._collect()
        owned = self.owned
        # moderngl.Framebuffer.release forgets its attachments, so these go before the textures.
        for objects in (owned.framebuffers, owned.textures, owned.buffers):
            for item in list(objects):
                item.release()
        owned.programs.clear()
        self._collect()
        owned.released = True
        self.ctx.release()
        self._released()

    def _released(self) -> None:
        for act in reversed(self.owned.on_release):
            act()

    # --- makers ------------------------------------------------------------------------------

    def texture3d(
        self,
        size: tuple[int, int, int],
        components: int,
        dtype: str,
        *,
        linear: bool,
    ) -> moderngl.Texture3D:
        """An empty 3D texture, clamped to its edge on all axes.

        size: texels along x, y, z. dtype: moderngl's name ("nu2" for 16-bit unsigned, "f4" for
        float, see formats.py). linear: filter linearly (not for "u*" and "i*"). The content is
        undefined until `upload3d`. Raises LimitError for a size over the limit or memory; drivers
        that promise memory they don't have are found by texel.py.
        """
        self._room(size, components, dtype, self.limits.max_texture_3d, linear)
        with self.guarded(f"3D texture of {times(size)}"):
            texture = self.ctx.texture3d(size, components, None, alignment=1, dtype=dtype)
            self.owned.textures.add(texture)
            texture.repeat_x = texture.repeat_y = texture.repeat_z = False
            _set_filter(texture, linear)
        return texture

    def upload3d(
        self,
        texture: moderngl.Texture3D,
        array: NDArray[Any],
        progress: Progress | None = None,
    ) -> None:
        """Fill a 3D texture from array[z, y, x] or array[z, y, x, component], all of it now.

        The dtype must be the texture's (formats.py). Between slabs `progress` is called and may
        raise Cancelled; the texture is then half filled and the caller's to release.
        """
        progress = progress or silent()
        progress(0.0, "uploading")
        for fraction in self.uploading3d(texture, array):
            progress(fraction, "uploading")

    def uploading3d(self, texture: moderngl.Texture3D, array: NDArray[Any]) -> Iterator[float]:
        """The same a slab at a time: yields the part that is filled after each, at last 1."""
        nx, ny, nz = texture.size
        expect(array, texture.size, texture.components, texture.dtype)
        for z, z_end, y, y_end in slabs(array):
            with self.guarded(f"upload into a 3D texture of {times(texture.size)}"):
                slab = np.ascontiguousarray(array[z:z_end, y:y_end])
                texture.write(slab, viewport=(0, y, z, nx, y_end - y, z_end - z), alignment=1)
            yield (z_end - 1 + y_end / ny) / nz

    def texture2d(
        self,
        size: tuple[int, int],
        components: int,
        data: NDArray[Any] | None,
        dtype: str,
        *,
        linear: bool,
    ) -> moderngl.Texture:
        """A 2D texture of size (width, height), clamped; data[row, column(, component)] or None.

        Row 0 is at texture coordinate y = 0. Raises LimitError over the limit or memory.
        """
        self._room(size, components, dtype, self.limits.max_texture, linear)
        if data is not None:
            expect(data, size, components, dtype)
            data = np.ascontiguousarray(data)
        with self.guarded(f"texture of {times(size)}"):
            texture = self.ctx.texture(size, components, data, alignment=1, dtype=dtype)
            self.owned.textures.add(texture)
            texture.repeat_x = texture.repeat_y = False
            _set_filter(texture, linear)
        return texture

    def buffer(self, data: NDArray[Any] | bytes | int) -> moderngl.Buffer:
        """A buffer with a copy of `data` (vertices, indices, uniform blocks), or with room for so
        many bytes; not empty."""
        if isinstance(data, int):
            return self._room_for(data)
        content = data if isinstance(data, bytes) else np.ascontiguousarray(data)
        size = content.nbytes if isinstance(content, np.ndarray) else len(content)
        buffer = self._room_for(size)
        with self.guarded(f"buffer of {size} bytes"):
            buffer.write(content)
        return buffer

    def _room_for(self, size: int) -> moderngl.Buffer:
        if size < 1:
            raise ValueError("an OpenGL buffer cannot be empty")
        with self.guarded(f"buffer of {size} bytes"):
            buffer = self.ctx.buffer(reserve=size)
            self.owned.buffers.add(buffer)
        return buffer

    def framebuffer(
        self,
        size: tuple[int, int],
        dtype: str = "f1",
        components: int = 4,
        *,
        depth: bool = False,
        number: bool = False,
    ) -> moderngl.Framebuffer:
        """A framebuffer with one colour texture (NEAREST), cleared to 0.

        size: (width, height). depth: also attach a depth texture. number: also attach a second
        colour texture with one float ("f4") per pixel. Raises LimitError beyond the
        texture or viewport limit: larger pictures are made of tiles. `release_framebuffer` frees
        it with its textures.
        """
        if any(n > limit for n, limit in zip(size, self.limits.max_viewport, strict=True)):
            raise LimitError(
                f"a picture of {times(size)} is larger than this OpenGL draws at once "
                f"({times(self.limits.max_viewport)})",
                fix="ask for a smaller picture",
            )
        parts: list[Any] = [self.texture2d(size, components, None, dtype, linear=False)]
        try:
            if number:
                parts.append(self.texture2d(size, 1, None, "f4", linear=False))
            with self.guarded(f"framebuffer of {times(size)}"):
                if depth:
                    parts.append(self.ctx.depth_texture(size))
                    self.owned.textures.add(parts[-1])
                colours = parts[:-1] if depth else parts
                target = self.ctx.framebuffer(colours, parts[-1] if depth else None)
                self.owned.framebuffers.add(target)
                target.clear()
        except (GraphicsError, LimitError):
            for part in parts:
                part.release()
            raise
        return target

    def release_framebuffer(self, target: moderngl.Framebuffer) -> None:
        """Free a framebuffer and the textures attached to it. Twice does no harm."""
        if self.ctx.fbo is target:  # moderngl would go on binding a name that is gone
            self.ctx.detect_framebuffer(0).use()
        attached = [*(target.color_attachments or ()), target.depth_attachment]
        target.release()
        for texture in attached:
            if texture is not None:
                texture.release()

    # --- checking ----------------------------------------------------------------------------

    @contextmanager
    def guarded(self, what: str) -> Iterator[None]:
        """Run OpenGL calls in this context and raise if they, or calls before them, failed."""
        self.activate()
        self._raise_for(self._drain(), f"a call before {what}")
        try:
            yield
        except moderngl.Error as error:
            self._raise_for(self._drain(), what)
            raise GraphicsError(f"{what} failed: {_one_line(error)}") from error
        self._raise_for(self._drain(), what)

    def _drain(self) -> list[str]:
        found: list[str] = []
        # Without a working context glGetError may answer with errors for ever.
        while len(found) < 16 and (error := self.ctx.error) != "GL_NO_ERROR":
            found.append(error)
            if error == "GL_CONTEXT_LOST":
                break
        return found

    def _raise_for(self, errors: list[str], what: str) -> None:
        if not errors:
            return
        if "GL_CONTEXT_LOST" in errors:
            raise ContextLost(f"the OpenGL context of {self.renderer} was lost")
        if "GL_OUT_OF_MEMORY" in errors:
            raise LimitError(
                f"{what}: the memory of {self.renderer} is not enough",
                fix="reduce the volume or the picture, or close other programs",
            )
        listed = ", ".join(f"{n}× {e}" if n > 1 else e for e, n in Counter(errors).items())
        raise GraphicsError(f"{what} failed: {listed} on {self.renderer}")

    def _room(
        self, size: tuple[int, ...], components: int, dtype: str, limit: int, linear: bool
    ) -> int:
        return texture_bytes(
            size, components, dtype, linear=linear, limit=limit, owner=self.renderer
        )

    def _collect(self) -> None:
        # gc_mode "context_gc" queues what Python dropped. Context.gc() would stumble over objects
        # that were already released by hand, and "auto" would delete the same name in whichever
        # context happens to be current.
        queue = self.ctx.objects
        while queue:
            item = queue.popleft()
            if hasattr(item, "release"):
                item.release()


def forked() -> GraphicsError:
    """The error of a process that was forked after OpenGL was opened: drivers hang there."""
    return GraphicsError(
        "this process was forked after OpenGL was opened, which drivers do not survive",
        fix="start processes with multiprocessing.get_context('spawn')",
    )


def _alive(item: Any) -> bool:
    return not isinstance(item.mglo, moderngl.InvalidObject)


def _one_line(error: object) -> str:
    return " ".join(str(error).split())


def _set_filter(texture: moderngl.Texture | moderngl.Texture3D, linear: bool) -> None:
    kind = moderngl.LINEAR if linear else moderngl.NEAREST
    texture.filter = (kind, kind)


def colour_texture(target: moderngl.Framebuffer, index: int = 0) -> moderngl.Texture:
    """The texture that a framebuffer of `Gpu.framebuffer` draws its colour (1: number) into."""
    attached = target.color_attachments[index]
    assert isinstance(attached, moderngl.Texture)
    return attached
