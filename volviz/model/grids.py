"""Grids that are no volume."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError
from volviz.model.volume import Space


@dataclass(frozen=True, eq=False)
class TetMesh:
    """Tetrahedra with a value at each vertex, linear between them; compared by identity.

    >>> tets = volviz.TetMesh(vertices, cells, values)
    >>> mesh = volviz.extract_surface(tets, 0.5)

    vertices: float32[n, 3], world mm. cells: int64[m, 4], vertex numbers. values: [n], integers
    or floats; a cell with a value that is not finite has no surface. Raises UsageError for arrays
    of other shapes and for cells of vertices that are not there.
    """

    vertices: NDArray[np.float32]
    cells: NDArray[np.int64]
    values: NDArray[Any]
    space: Space | None = None

    def __post_init__(self) -> None:
        count = len(self.vertices)
        for name, dtype, shape in (
            ("vertices", np.float32, (count, 3)),
            ("cells", np.int64, (len(self.cells), 4)),
            ("values", np.asarray(self.values).dtype.newbyteorder("="), (count,)),
        ):
            given = np.asarray(getattr(self, name))
            if given.shape != shape:
                raise UsageError(f"the array has shape {given.shape}, not {shape}", field=name)
            array = np.ascontiguousarray(given, dtype=dtype).view()
            array.setflags(write=False)
            object.__setattr__(self, name, array)
        if self.cells.size and not 0 <= self.cells.min() <= self.cells.max() < count:
            raise UsageError(f"a cell names a vertex outside 0..{count - 1}", field="cells")
