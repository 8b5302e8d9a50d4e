"""A surface as triangles, or points where there are no faces. World LPS millimetres."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError
from volviz.model.volume import Space


@dataclass(frozen=True, eq=False)
class Mesh:
    """Vertices, faces and what goes with them, read-only; compared by identity.

    vertices: float32[n, 3], x, y, z in world mm (LPS where `space` says so). normals:
    float32[n, 3], unit length, towards lower values; float32[0, 3] where none were made. faces:
    uint32[m, 3], counter-clockwise seen from where the normals point to; no faces: points.
    values: float32[n] or None, a scalar per vertex. colors: uint8[n, 4] or None, sRGB with
    straight opacity. skipped: cells that were left out because a sample of theirs is not valid.
    apart: mm, how wide discs at the points must be to leave no holes; 0: not known.
    Raises UsageError for arrays of other shapes and for faces of vertices that are not there.
    """

    vertices: NDArray[np.float32]
    faces: NDArray[np.uint32] = field(default_factory=lambda: np.empty((0, 3), np.uint32))
    normals: NDArray[np.float32] = field(default_factory=lambda: np.empty((0, 3), np.float32))
    values: NDArray[np.float32] | None = None
    colors: NDArray[np.uint8] | None = None
    space: Space | None = None
    skipped: int = 0
    apart: float = 0.0

    def __post_init__(self) -> None:
        for name in ("vertices", "faces", "normals"):
            if np.ndim(getattr(self, name)) != 2:
                raise UsageError("an array of rows of three is needed", field=f"mesh.{name}")
        count = len(self.vertices)
        self._check_faces(count)
        self._keep("vertices", np.float32, (count, 3))
        self._keep("faces", np.uint32, (len(self.faces), 3))
        self._keep("normals", np.float32, (count if len(self.normals) else 0, 3))
        if self.values is not None:
            self._keep("values", np.float32, (count,))
        if self.colors is not None:
            self._keep("colors", np.uint8, (count, 4))

    @classmethod
    def of_right_arrays(
        cls,
        vertices: NDArray[np.float32],
        faces: NDArray[np.uint32],
        normals: NDArray[np.float32],
        *,
        space: Space | None = None,
        skipped: int = 0,
    ) -> Mesh:
        """Of arrays whose types, shapes and numbers are right because of how they were made.

        They are not looked at again, which takes milliseconds where there are millions.
        """
        mesh = cls(vertices[:0], space=space, skipped=skipped)
        for name, array in (("vertices", vertices), ("faces", faces), ("normals", normals)):
            array.setflags(write=False)
            object.__setattr__(mesh, name, array)
        return mesh

    def _check_faces(self, count: int) -> None:
        """Before they become 32 bits without a sign."""
        faces = np.asarray(self.faces)
        if not faces.size:
            return
        if faces.dtype.kind not in "iu":
            raise UsageError(f"faces are whole numbers, not {faces.dtype}", field="faces")
        least = int(faces.min()) if faces.dtype.kind == "i" else 0
        wrong = least if least < 0 else int(faces.max())
        if not 0 <= wrong < count:
            raise UsageError(f"a face names vertex {wrong}, there are {count}", field="faces")

    def _keep(self, name: str, dtype: Any, shape: tuple[int, ...]) -> None:
        given = np.asarray(getattr(self, name))
        if given.dtype.kind not in "biuf":
            raise UsageError(f"numbers are needed, not {given.dtype}", field=f"mesh.{name}")
        if given.shape != shape:
            raise UsageError(
                f"the array has shape {given.shape}, not {shape}", field=f"mesh.{name}"
            )
        array = np.ascontiguousarray(given, dtype=dtype).view()
        array.setflags(write=False)
        object.__setattr__(self, name, array)

    @property
    def empty(self) -> bool:
        """True if there is nothing to draw."""
        return len(self.vertices) == 0

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        arrays = (self.vertices, self.faces, self.normals, self.values, self.colors)
        return sum(a.nbytes for a in arrays if a is not None)

    @cached_property  # asked for with every frame while things move
    def bounds(self) -> NDArray[np.float64]:
        """float64[2, 3]: least and greatest corner of the box of the vertices; NaN if empty."""
        ends = np.full((2, 3), np.nan)
        if not self.empty:
            columns = self.vertices.T  # one by one: 20 times as quick as along axis 0
            ends[:] = [c.min() for c in columns], [c.max() for c in columns]
        ends.setflags(write=False)
        return ends

    def __repr__(self) -> str:
        return f"<Mesh {len(self.vertices)} vertices, {len(self.faces)} triangles>"
