"""A hierarchy of resolutions by decimation; `choose` says which of them a picture needs."""

from __future__ import annotations

from volviz.meshes.decimate import decimate
from volviz.meshes.distance import distances, two_sided
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
    levels = [Level(mesh, 0.0)]
    while len(levels) < most and len(levels[-1].mesh.faces) >= FACTOR * LEAST:
        share = progress.part((len(levels) - 1) / most, len(levels) / most)
        last = levels[-1]
        made = decimate(last.mesh, 1 - 1 / FACTOR, boundary=boundary, progress=share.part(0.0, 0.5))
        if len(made.faces) > 0.8 * len(last.mesh.faces):
            break
        error = _error(made, mesh, samples, share.part(0.5, 1.0))
        levels.append(Level(made, max(error, last.error)))
    return tuple(levels)


def _error(made: Mesh, mesh: Mesh, samples: int | None, progress: Progress) -> float:
    """mm, two-sided."""
    if samples is None:
        return two_sided(made, mesh, progress=progress).hausdorff
    progress(0.0, "measuring the distance")
    greatest = 0.0
    for one, other in ((made, mesh), (mesh, made)):
        step = max(len(one.vertices) // samples, 1)
        some = one.vertices[::step]
        for first in range(0, len(some), _SOME):
            greatest = max(greatest, float(distances(some[first : first + _SOME], other).max()))
            progress(None, "measuring the distance")
    return greatest
