"""Volumes and tables as textures, kept for as long as their numpy arrays live and are in use."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import nullcontext
from typing import Any
from weakref import WeakKeyDictionary, ref

import moderngl
import numpy as np
from numpy.typing import NDArray

from volviz.errors import LimitError
from volviz.gpu import prefault
from volviz.gpu.checked import Gpu
from volviz.gpu.meshes import Meshes
from volviz.gpu.texel import kept_texture3d
from volviz.model.frame import ColorTable, Emptiness, Voxels
from volviz.model.transfer import corrected_opacity
from volviz.progress import Progress, silent

TABLE_WIDTH = 4096  # the shader counts its rows by it (classify.glsl)
SECONDS = 0.1
"""Between two reports of an upload that nothing else waits for."""
_TEXEL = {"uint8": "nu1", "uint16": "nu2", "float32": "f4"}


class _Upload:
    """A volume on its way: memory for its texture, the texture, what writes the next slab into it.

    at_once: whoever asks waits all the same, so nobody else need see to the memory.
    """

    def __init__(self, gpu: Gpu, voxels: Voxels, *, at_once: bool) -> None:
        self._gpu, self._voxels = gpu, voxels
        self._memory: prefault.Memory | None = None
        self.texture: moderngl.Texture3D | None = None
        self.slabs: Iterator[float] = iter(())
        if gpu.software and not at_once and prefault.helps(voxels.nbytes):
            try:
                self._memory = prefault.Memory(voxels.nbytes)
            except MemoryError as error:
                raise LimitError(
                    f"no memory for {voxels.nbytes / 1e6:.0f} MB more", fix="reduce the volume"
                ) from error

    def begun(self, *, at_once: bool) -> bool:
        """Make the texture if there is memory for it; True if it is there now."""
        if self._memory is not None and not self._memory.ready and not at_once:
            return False
        memory, self._memory = self._memory, None
        with nullcontext() if memory is None else memory.given():
            voxels = self._voxels
            components = 2 if voxels.masked else 1
            dtype = _TEXEL[voxels.array.dtype.name]
            self.texture = kept_texture3d(self._gpu, voxels.dims, components, dtype, linear=True)
        self.slabs = self._gpu.uploading3d(self.texture, voxels.array)
        return True

    def release(self) -> None:
        """Give up."""
        if self._memory is not None:
            self._memory.release()
        if self.texture is not None:
            self.texture.release()


class Residency:
    """What is on the GPU. One volume for each owner: who asks for another gives up the one before.

    An owner is whoever draws (a `Progressive`); those that name none are one owner together. So a
    picture for a file and the view beside it may show two volumes without fighting for the place.
    """

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self.meshes = Meshes(gpu)
        self._volumes: WeakKeyDictionary[Voxels, moderngl.Texture3D] = WeakKeyDictionary()
        self._uploads: dict[Voxels, _Upload] = {}
        self._wanted: WeakKeyDictionary[object, ref[Voxels]] = WeakKeyDictionary()
        self._distances: WeakKeyDictionary[Emptiness, moderngl.Texture3D] = WeakKeyDictionary()
        self._tables: WeakKeyDictionary[ColorTable, dict[Any, moderngl.Texture]] = (
            WeakKeyDictionary()
        )

    def upload(
        self,
        voxels: Voxels,
        seconds: float,
        owner: object | None = None,
        *,
        at_once: bool = False,
    ) -> float:
        """Bring the volume nearer to the GPU for about so long; the part (0..1) that is there.

        At least one slab each time, once there is memory for it, which a worker sees to unless
        at_once. Raises LimitError.
        """
        self._wanted[self if owner is None else owner] = ref(voxels)
        if voxels in self._volumes:
            return 1.0
        end = time.perf_counter() + seconds
        if voxels not in self._uploads:
            self._drop_unwanted()
            self._uploads[voxels] = _Upload(self._gpu, voxels, at_once=at_once)
        way = self._uploads[voxels]
        try:
            if way.texture is None and (
                not way.begun(at_once=at_once) or time.perf_counter() >= end
            ):
                return 0.0  # making room may take all the time there is
            for done in way.slabs:
                if time.perf_counter() >= end and done < 1.0:
                    return done
        except BaseException:
            self._uploads.pop(voxels).release()
            raise
        assert way.texture is not None
        self._volumes[voxels] = way.texture
        del self._uploads[voxels]
        return 1.0

    def forget(self, owner: object) -> None:
        """An owner draws no more: its volume goes unless another one draws it too."""
        if self._wanted.pop(owner, None) is not None:
            self._drop_unwanted()

    def volume(
        self, voxels: Voxels, *, linear: bool, progress: Progress | None = None
    ) -> moderngl.Texture3D:
        """The 3D texture of these voxels, uploaded now if it is not there. Raises LimitError.

        linear: filter linearly. Cancelled through `progress`.
        """
        progress = progress or silent()
        while (
            voxels not in self._volumes
            and (done := self.upload(voxels, SECONDS, at_once=True)) < 1.0
        ):
            try:
                progress(done, "uploading")
            except BaseException:
                self.forget(self)
                raise
        texture = self._volumes[voxels]
        kind = moderngl.LINEAR if linear else moderngl.NEAREST
        texture.filter = (kind, kind)
        return texture

    def distances(self, emptiness: Emptiness) -> moderngl.Texture3D:
        """The 3D texture of how far a ray may leap."""
        texture = self._distances.get(emptiness)
        if texture is None:
            _release_all(self._distances)
            bz, by, bx = emptiness.distance.shape
            texture = self._gpu.texture3d((bx, by, bz), 1, "u1", linear=False)
            self._gpu.upload3d(texture, emptiness.distance)
            self._distances[emptiness] = texture
        return texture

    def table(self, table: ColorTable, *, step: float, per_length: bool) -> moderngl.Texture:
        """The transfer function for one step length (mm), premultiplied: rows of 4096 entries.

        per_length: correct the opacity to the step, else take it as it is.
        """
        known = self._tables.setdefault(table, {})
        key = (step, per_length)
        if key not in known:
            for old in known.values():
                old.release()
            known.clear()
            known[key] = self._table_texture(baked(table, step if per_length else None))
        return known[key]

    def release(self) -> None:
        """Free all textures and buffers, half filled ones too."""
        self.meshes.release()
        self._wanted.clear()
        self._drop_unwanted()
        _release_all(self._distances)
        for known in self._tables.values():
            for texture in known.values():
                texture.release()
        self._tables.clear()

    def _drop_unwanted(self) -> None:
        wanted = {voxels() for voxels in self._wanted.values()}
        gone = [v for v in self._volumes if v not in wanted]
        for voxels in gone:
            self._volumes.pop(voxels).release()
        for voxels in [v for v in self._uploads if v not in wanted]:
            gone.append(voxels)
            self._uploads.pop(voxels).release()
        if self._gpu.software and any(prefault.helps(v.nbytes) for v in gone):
            prefault.trim()

    def _table_texture(self, entries: NDArray[np.float32]) -> moderngl.Texture:
        width = min(len(entries), TABLE_WIDTH)
        rows = -(-len(entries) // width)
        padded = np.zeros((rows * width, 4), np.float32)
        padded[: len(entries)] = entries
        grid = padded.reshape(rows, width, 4)
        return self._gpu.texture2d((width, rows), 4, grid, "f4", linear=False)


def _release_all(textures: WeakKeyDictionary[Any, moderngl.Texture3D]) -> None:
    for texture in textures.values():
        texture.release()
    textures.clear()


def baked(table: ColorTable, step: float | None) -> NDArray[np.float32]:
    """float32[n, 4]: linear-light colour times opacity, and opacity over a step of so many mm."""
    entries = table.entries.astype(np.float64)
    opacity = entries[:, 3]
    if step is not None:
        opacity = corrected_opacity(opacity, step, table.unit_distance)
    return np.concatenate([entries[:, :3] * opacity[:, None], opacity[:, None]], axis=1).astype(
        np.float32
    )
