"""Meshes as buffers, kept for as long as the meshes live; brought there a piece at a time.

A mesh lies there in pieces of neighbouring triangles with a box around each, so that a tile of a
picture draws only what may be seen in it.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from typing import Any
from weakref import WeakKeyDictionary

import moderngl
import numpy as np
from numpy.typing import NDArray

from volviz.gpu.checked import Gpu
from volviz.model.mesh import Mesh

PIECE = 1 << 11
"""Triangles (or points) of one piece."""
TOGETHER = 16
"""Pieces that are brought to the GPU at once."""
NEIGHBOURS, AROUND = 0.25, 1.5
"""Of the ways from point to point: so many are to a neighbour; and how much wider than that a point
is drawn, for neighbours across."""
_PARTS = ("vertices", "normals", "colors")
_FORMATS = {"vertices": "3f", "normals": "3f", "colors": "4f1"}
_NAMES = {"vertices": "in_position", "normals": "in_normal", "colors": "in_color"}


class MeshBuffers:
    """The buffers of one mesh. boxes: float32[n, 2, 3], corners of its pieces in world mm.

    count: of indices, or of points where there are no triangles. apart: mm between neighbouring
    points, 0 with triangles.
    """

    def __init__(self, gpu: Gpu, mesh: Mesh) -> None:
        self._gpu = gpu
        self._arrays: dict[str, NDArray[Any]] = {
            name: array
            for name in _PARTS
            if (array := getattr(mesh, name)) is not None and len(array)
        }
        self._faces = mesh.faces
        self.apart = 0.0 if len(mesh.faces) else mesh.apart or _apart(mesh.vertices)
        self.points = len(mesh.faces) == 0
        self.count = len(mesh.vertices) if self.points else mesh.faces.size
        self.per_piece = PIECE * (1 if self.points else 3)
        self.boxes = np.empty((-(-self.count // self.per_piece), 2, 3), np.float32)
        self.buffers = {name: gpu.buffer(array.nbytes) for name, array in self._arrays.items()}
        self.indices = None if self.points else gpu.buffer(mesh.faces.nbytes)
        self.nbytes = sum(a.nbytes for a in self._arrays.values()) + mesh.faces.nbytes

    @property
    def bounds(self) -> NDArray[np.float32]:
        """float32[2, 3] of all pieces."""
        return np.stack([self.boxes[:, 0].min(axis=0), self.boxes[:, 1].max(axis=0)])

    def pieces(self) -> Iterator[float]:
        """Write the next piece into the buffers; yields the part that is there."""
        vertices = self._arrays["vertices"]
        total, done = self.nbytes, 0
        for name, array in self._arrays.items():
            step = TOGETHER * PIECE * array.shape[1]
            flat = array.reshape(-1)
            for start in range(0, flat.size, step):
                part = flat[start : start + step]
                with self._gpu.guarded("upload of a mesh"):
                    self.buffers[name].write(part, offset=start * array.itemsize)
                done += part.nbytes
                yield done / total * 0.999
        faces = self._faces.reshape(-1)
        for i in range(0, len(self.boxes), TOGETHER):
            run = slice(i * self.per_piece, (i + TOGETHER) * self.per_piece)
            corners = vertices[run] if self.points else vertices[faces[run]]
            starts = np.arange(0, len(corners), self.per_piece)
            self.boxes[i : i + TOGETHER, 0] = np.minimum.reduceat(corners, starts)
            self.boxes[i : i + TOGETHER, 1] = np.maximum.reduceat(corners, starts)
            if self.indices is not None:
                with self._gpu.guarded("upload of a mesh"):
                    self.indices.write(faces[run], offset=run.start * faces.itemsize)
                done += faces[run].nbytes
                yield done / total * 0.999
        self._arrays.clear()
        self._faces = np.empty((0, 3), np.uint32)

    def array(self, program: moderngl.Program) -> moderngl.VertexArray:
        """What draws it with this program, which need not take all there is."""
        content = [
            (buffer, _FORMATS[name], _NAMES[name])
            for name, buffer in self.buffers.items()
            if program.get(_NAMES[name], None) is not None
        ]
        return self._gpu.ctx.vertex_array(program, content, self.indices)

    def release(self) -> None:
        """Free them."""
        for buffer in self.buffers.values():
            buffer.release()
        if self.indices is not None:
            self.indices.release()


def _apart(points: NDArray[np.float32]) -> float:
    """About the way between neighbouring points that are in order, as extractors make them: most
    have a neighbour beside them in the list, others begin a row."""
    chosen = np.arange(0, len(points) - 1, max(len(points) // 20_000, 1))
    if not len(chosen):
        return 0.0
    ways = np.linalg.norm(points[chosen + 1] - points[chosen], axis=1)
    return float(np.quantile(ways, NEIGHBOURS)) * AROUND


class Meshes:
    """All meshes on the GPU. One that nobody holds any more goes by itself."""

    def __init__(self, gpu: Gpu) -> None:
        self._gpu = gpu
        self._known: WeakKeyDictionary[Mesh, MeshBuffers] = WeakKeyDictionary()
        self._filling: WeakKeyDictionary[Mesh, tuple[MeshBuffers, Iterator[float]]] = (
            WeakKeyDictionary()
        )

    def upload(self, meshes: Sequence[Mesh], seconds: float) -> float:
        """Bring meshes nearer to the GPU for about so long; the part (0..1) that is there.

        At least one piece each time. Empty meshes need nothing. Raises LimitError.
        """
        end = time.perf_counter() + seconds
        missing = [m for m in dict.fromkeys(meshes) if not m.empty and m not in self._known]
        for i, mesh in enumerate(missing):
            if mesh not in self._filling:
                buffers = MeshBuffers(self._gpu, mesh)
                self._filling[mesh] = buffers, buffers.pieces()
            buffers, pieces = self._filling[mesh]
            for done in pieces:
                if time.perf_counter() >= end:
                    return (i + done) / len(missing)
            self._known[mesh] = self._filling.pop(mesh)[0]
        return 1.0

    def buffers(self, mesh: Mesh) -> MeshBuffers:
        """The buffers of a mesh that is not empty, uploaded now if they are not there."""
        while mesh not in self._known:
            self.upload([mesh], 1.0)
        return self._known[mesh]

    @property
    def nbytes(self) -> int:
        """Bytes on the GPU."""
        return sum(b.nbytes for b in self._known.values())

    def release(self) -> None:
        """Free all."""
        for buffers in (*self._known.values(), *(f[0] for f in self._filling.values())):
            buffers.release()
        self._known.clear()
        self._filling.clear()
