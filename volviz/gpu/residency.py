"""Volumes and tables as textures, kept for as long as their numpy arrays live and are in use."""

from __future__ import annotations

from typing import Any
from weakref import WeakKeyDictionary

import moderngl
import numpy as np
from numpy.typing import NDArray

from volviz.gpu.checked import Gpu
from volviz.model.frame import ColorTable, Emptiness, Voxels
from volviz.model.transfer import corrected_opacity
from volviz.progress import Progress

TABLE_WIDTH = 4096  # the shader counts its rows by it (classify.glsl)
_TEXEL = {"uint8": "nu1", "uint16": "nu2", "float32": "f4"}


class Residency:
    """What is on the GPU. One volume at a time: a new one makes room by dropping the old."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._volumes: WeakKeyDictionary[Voxels, moderngl.Texture3D] = WeakKeyDictionary()
        self._distances: WeakKeyDictionary[Emptiness, moderngl.Texture3D] = WeakKeyDictionary()
        self._tables: WeakKeyDictionary[ColorTable, dict[Any, moderngl.Texture]] = (
            WeakKeyDictionary()
        )

    def volume(
        self, voxels: Voxels, *, linear: bool, progress: Progress | None = None
    ) -> moderngl.Texture3D:
        """The 3D texture of these voxels, filtered linearly or not. Raises LimitError."""
        texture = self._volumes.get(voxels)
        if texture is None:
            _release_all(self._volumes)
            texture = self._upload(voxels, progress)
            self._volumes[voxels] = texture
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
        """Free all textures."""
        _release_all(self._volumes)
        _release_all(self._distances)
        for known in self._tables.values():
            for texture in known.values():
                texture.release()
        self._tables.clear()

    def _upload(self, voxels: Voxels, progress: Progress | None) -> moderngl.Texture3D:
        components = 2 if voxels.masked else 1
        dtype = _TEXEL[voxels.array.dtype.name]
        texture = self._gpu.texture3d(voxels.dims, components, dtype, linear=True)
        try:
            self._gpu.upload3d(texture, voxels.array, progress)
        except BaseException:
            texture.release()
            raise
        return texture

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
