"""A hierarchy of resolutions by decimation; `choose` says which of them a picture needs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from volviz.meshes.decimate import decimate
from volviz.meshes.distance import two_sided
from volviz.meshes.nearest import Tree, point_distances, tree_of
from volviz.model.levels import Level, choose, pixel_size
from volviz.model.mesh import Mesh
from volviz.progress import Progress, silent

__all__ = ["Level", "choose", "levels_of", "pixel_size"]
FACTOR = 4
"""Triangles of a level against those of the next coarser one."""
_SOME = 5000  # points between two reports
LEAST = 500
"""Triangles below which no coarser level is made."""


def levels_of(
    mesh: Mesh,
    most: int = 6,
    *,
    boundary: str = "simplified",
    samples: int | None = None,
    progress: Progress | None = None,
) -> tuple[Level, ...]:
    """The mesh and coarser ones, finest first; the errors grow. At most `most` levels.

    Each is decimated from the one before it, to a quarter of its triangles or as far as topology
    and boundary let it, and measured against the first. samples: measure at so many vertices of
    either mesh only, which is quicker and may miss the farthest. Raises Cancelled.
    """
    progress = progress or silent()
    levels, measure = [Level(mesh, 0.0)], _Error(mesh, samples)
    while len(levels) < most and len(levels[-1].mesh.faces) >= FACTOR * LEAST:
        share = progress.part((len(levels) - 1) / most, len(levels) / most)
        last = levels[-1]
        made = decimate(last.mesh, 1 - 1 / FACTOR, boundary=boundary, progress=share.part(0.0, 0.5))
        if len(made.faces) > 0.8 * len(last.mesh.faces):
            break
        error = measure.of(made, share.part(0.5, 1.0))
        levels.append(Level(made, max(error, last.error)))
    return tuple(levels)


class _Error:
    """The two-sided distance of coarser levels to a mesh, mm. samples: as in `levels_of`."""

    def __init__(self, mesh: Mesh, samples: int | None) -> None:
        self._mesh, self._samples = mesh, samples
        quick = samples is not None and len(mesh.faces) > 0
        self._tree = tree_of(mesh) if quick else None

    def of(self, made: Mesh, progress: Progress) -> float:
        """Of one level."""
        if self._tree is None:
            return two_sided(made, self._mesh, progress=progress).hausdorff
        there = self._greatest(made.vertices, self._tree, progress)
        return max(there, self._greatest(self._mesh.vertices, tree_of(made), progress))

    def _greatest(self, vertices: NDArray[np.float32], tree: Tree, progress: Progress) -> float:
        step = max(len(vertices) // (self._samples or 1), 1)
        some = vertices[::step].astype(np.float64)
        out = np.empty(len(some))
        for first in range(0, len(some), _SOME):
            progress(None, "measuring the distance")
            part = slice(first, first + _SOME)
            point_distances(some[part], *tree, out[part])
        return float(out.max())
