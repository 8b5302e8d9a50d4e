"""Normals from triangles, and triangles that agree which side is out."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.compiled import kernel
from volviz.errors import UsageError, did_you_mean
from volviz.meshes.adjacency import vertex_faces
from volviz.meshes.attributes import unit
from volviz.model.mesh import Mesh

WEIGHTS = ("area", "angle", "uniform")


def face_normals(mesh: Mesh) -> NDArray[np.float64]:
    """float64[m, 3]: normal of each face times twice its area, by the right-hand rule."""
    a, b, c = np.moveaxis(mesh.vertices.astype(np.float64)[mesh.faces], 1, 0)
    return np.cross(b - a, c - a)


def face_areas(mesh: Mesh) -> NDArray[np.float64]:
    """float64[m]: mm²."""
    return np.linalg.norm(face_normals(mesh), axis=1) / 2


def with_normals(mesh: Mesh, weight: str = "angle") -> Mesh:
    """The mesh with vertex normals from its triangles.

    weight of a face at a vertex: its "area"; its "angle" there (Thürmer and Wüthrich 1998), which
    does not depend on how a flat part is cut; or "uniform" (Gouraud 1971).
    """
    if weight not in WEIGHTS:
        raise UsageError(
            f"unknown weight '{weight}'", field="weight", fix=did_you_mean(weight, WEIGHTS)
        )
    normals = face_normals(mesh)
    if weight != "area":
        normals = unit(normals).astype(np.float64)
    angles = _angles(mesh) if weight == "angle" else np.ones(mesh.faces.shape)
    sums = np.zeros((len(mesh.vertices), 3))
    for k in range(3):
        share = normals * angles[:, k : k + 1]
        for axis in range(3):
            sums[:, axis] += np.bincount(mesh.faces[:, k], share[:, axis], len(sums))
    return replace(mesh, normals=unit(sums))


def _angles(mesh: Mesh) -> NDArray[np.float64]:
    """float64[m, 3]: the angle of each face at each corner."""
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
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
