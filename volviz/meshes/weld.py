"""One vertex where several lie together."""

from __future__ import annotations

from dataclasses import replace
from math import floor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.compiled import inline, kernel
from volviz.errors import UsageError
from volviz.meshes.attributes import packed, taken, unpacked
from volviz.model.mesh import Mesh
from volviz.progress import Progress, silent

_CELLS = 1 << 18  # along an axis, at most
_RANGE = 100_000  # vertices between two looks at the cancel flag


def weld(mesh: Mesh, tolerance: float = 0.0, progress: Progress | None = None) -> Mesh:
    """Vertices at most `tolerance` mm apart become one; 0: only equal positions.

    Each goes to the nearest of those kept before it, so none moves farther than the tolerance,
    and those kept are farther apart than it. Normals, values and colours are averaged. Faces that
    lose a corner go; vertices without a face stay. Raises UsageError for a tolerance < 0,
    Cancelled.
    """
    if not 0 <= tolerance < np.inf:
        raise UsageError(f"{tolerance} is no length in mm", field="--weld")
    points = mesh.vertices.astype(np.float64)
    extent = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    owner = owners(points, float(tolerance), max(tolerance, extent / _CELLS) or 1.0, progress)
    report = progress or silent()
    report(None, "welding")
    kept = np.flatnonzero(owner == np.arange(len(owner)))
    if len(kept) == len(owner):
        return mesh
    number = np.zeros(len(owner), np.int64)
    number[kept] = np.arange(len(kept))
    group = number[owner]
    packs = packed(mesh)
    sums = np.zeros((len(kept), packs.shape[1]))
    for k in range(packs.shape[1]):
        report(None, "welding")
        sums[:, k] = np.bincount(group, packs[:, k], len(kept))
    means = (sums / np.bincount(group, minlength=len(kept))[:, None]).astype(np.float32)
    faces = group[mesh.faces].astype(np.uint32)
    a, b, c = faces.T
    return replace(
        taken(mesh, kept),
        faces=faces[(a != b) & (b != c) & (c != a)],
        **unpacked(mesh, means),
    )


@inline
def _slot(x: int, y: int, z: int, size: int) -> int:
    """Where the chain of a cell begins; size: a power of two."""
    mixed = x * 73856093 ^ y * 19349663 ^ z * 83492791
    return (mixed ^ (mixed >> 15)) & (size - 1)


def owners(
    points: NDArray[np.float64], tolerance: float, cell: float, progress: Progress | None = None
) -> NDArray[np.int64]:
    """int64[n]: the vertex that each goes to, itself if it is kept. A hash of grid cells."""
    count = len(points)
    size = 1
    while size < 2 * count:
        size *= 2
    chains = np.full(size, -1, np.int64), np.full(count, -1, np.int64)
    owner = np.arange(count)
    for start in range(0, count, _RANGE):
        if progress is not None:
            progress(start / count, "welding")
        find_owners(start, min(start + _RANGE, count), points, tolerance, cell, *chains, owner)
    return owner


@kernel
def find_owners(
    start: int,
    end: int,
    points: Any,
    tolerance: float,
    cell: float,
    first: Any,
    following: Any,
    owner: Any,
) -> None:
    """Of the vertices start to end, after all those before them. first, following: the chains of
    the kept ones."""
    size = first.shape[0]
    reach = 1 if tolerance > 0.0 else 0
    for i in range(start, end):
        x, y, z = points[i, 0], points[i, 1], points[i, 2]
        cx, cy, cz = floor(x / cell), floor(y / cell), floor(z / cell)
        best, least = -1, tolerance * tolerance
        for dx in range(-reach, reach + 1):
            for dy in range(-reach, reach + 1):
                for dz in range(-reach, reach + 1):
                    j = first[_slot(cx + dx, cy + dy, cz + dz, size)]
                    while j >= 0:
                        ox, oy, oz = points[j, 0] - x, points[j, 1] - y, points[j, 2] - z
                        square = ox * ox + oy * oy + oz * oz
                        if max(abs(ox), abs(oy), abs(oz)) > tolerance:  # squares may be 0 alone
                            square = np.inf
                        if square < least or (square == least and (best < 0 or j < best)):
                            best, least = j, square
                        j = following[j]
        if best >= 0:
            owner[i] = best
        else:
            slot = _slot(cx, cy, cz, size)
            following[i], first[slot] = first[slot], i
