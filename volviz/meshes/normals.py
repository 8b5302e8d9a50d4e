"""Normals from triangles, and triangles that agree which side is out."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.compiled import kernel
from volviz.errors import UsageError, did_you_mean
from volviz.meshes.adjacency import vertex_faces
from volviz.meshes.attributes import unit
from volviz.model.mesh import Mesh
from volviz.progress import Progress

WEIGHTS = ("area", "angle", "uniform")
NORMALS = "normals"
_RANGE = 1 << 16


def face_normals(mesh: Mesh) -> NDArray[np.float64]:
    """float64[m, 3]: normal of each face times twice its area, by the right-hand rule."""
    out = np.empty((len(mesh.faces), 3))
    for some in _ranges(mesh):
        a, b, c = _corners(mesh, some)
        out[some] = np.cross(b - a, c - a)
    return out


def face_areas(mesh: Mesh, progress: Progress | None = None) -> NDArray[np.float64]:
    """float64[m]: mm². Raises Cancelled."""
    out = np.empty(len(mesh.faces))
    for some in _ranges(mesh, progress):
        a, b, c = _corners(mesh, some)
        out[some] = np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2
    return out


def with_normals(mesh: Mesh, weight: str = "angle", progress: Progress | None = None) -> Mesh:
    """The mesh with vertex normals from its triangles.

    weight of a face at a vertex: its "area"; its "angle" there (Thürmer and Wüthrich 1998), which
    does not depend on how a flat part is cut; or "uniform" (Gouraud 1971). Raises Cancelled.
    """
    if weight not in WEIGHTS:
        raise UsageError(
            f"unknown weight '{weight}'", field="weight", fix=did_you_mean(weight, WEIGHTS)
        )
    normals, angles = np.empty((len(mesh.faces), 3)), np.ones(mesh.faces.shape)
    for some in _ranges(mesh, progress):
        a, b, c = _corners(mesh, some)
        normals[some] = np.cross(b - a, c - a)
        if weight != "area":
            normals[some] = unit(normals[some])
        if weight == "angle":
            angles[some] = _angles(np.stack([a, b, c], axis=1))
    sums = np.zeros((len(mesh.vertices), 3))
    for k in range(3):
        if progress is not None:
            progress(None, NORMALS)
        share = normals * angles[:, k : k + 1]
        for axis in range(3):
            sums[:, axis] += np.bincount(mesh.faces[:, k], share[:, axis], len(sums))
    return replace(mesh, normals=unit(sums))


def _ranges(mesh: Mesh, progress: Progress | None = None) -> Iterator[slice]:
    """So many faces that what is computed of them stays in a cache; a cancel is heard between."""
    for first in range(0, len(mesh.faces), _RANGE):
        if progress is not None:
            progress(None, NORMALS)
        yield slice(first, first + _RANGE)


def _corners(mesh: Mesh, some: slice) -> NDArray[np.float64]:
    """float64[3, n, 3]: the three corners of some faces."""
    return np.moveaxis(mesh.vertices[mesh.faces[some]].astype(np.float64), 1, 0)


def _angles(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """float64[n, 3]: the angle at each corner of triangles, float64[n, 3, 3]."""
    ahead = np.roll(corners, -1, axis=1) - corners
    back = np.roll(corners, 1, axis=1) - corners
    cross = np.linalg.norm(np.cross(ahead, back), axis=2)
    return np.arctan2(cross, (ahead * back).sum(axis=2))


def turned(mesh: Mesh) -> Mesh:
    """Inside out: every triangle walked the other way, every normal reversed."""
    return replace(mesh, faces=mesh.faces[:, ::-1], normals=-mesh.normals)


def oriented(mesh: Mesh) -> tuple[Mesh, int]:
    """Triangles turned so that neighbours agree which side is out, and how many were turned.

    In each connected part the smaller number is turned. Over an edge with more than two faces
    nothing is carried. On a one-sided surface (a Möbius strip) some edge stays in disagreement.
    """
    faces = mesh.faces.astype(np.int32)
    flips = flipped_faces(faces, *vertex_faces(faces, len(mesh.vertices)))
    count = int(flips.sum())
    if not count:
        return mesh, 0
    faces[flips] = faces[flips][:, ::-1]
    return replace(mesh, faces=faces.astype(np.uint32)), count


@kernel
def flipped_faces(faces: Any, starts: Any, members: Any) -> Any:
    """bool[m]: the faces to turn; breadth first over the edges of exactly two faces."""
    count = faces.shape[0]
    flips, seen = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    queue = np.empty(count, np.int32)
    for seed in range(count):
        if seen[seed]:
            continue
        seen[seed] = True
        queue[0], head, tail, turned_here = seed, 0, 1, 0
        while head < tail:
            f = queue[head]
            head += 1
            for k in range(3):
                a, b = faces[f, k - 1], faces[f, k]
                other, shared, same = -1, 0, False
                for i in range(starts[a], starts[a + 1]):
                    g = members[i]
                    for j in range(3):
                        c, d = faces[g, j - 1], faces[g, j]
                        if (c == a and d == b) or (c == b and d == a):
                            shared += 1
                            if g != f:
                                other, same = g, c == a
                if shared == 2 and other >= 0 and not seen[other]:
                    seen[other] = True
                    flips[other] = flips[f] != same
                    turned_here += flips[other]
                    queue[tail] = other
                    tail += 1
        if 2 * turned_here > tail:
            for i in range(tail):
                flips[queue[i]] = not flips[queue[i]]
    return flips
