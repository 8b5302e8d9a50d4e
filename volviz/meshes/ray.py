"""Where a line meets a mesh: for a click, on the processor."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.model.mesh import Mesh

BLOCK = 1 << 18
"""Triangles that are looked at together: what is kept of them stays in the cache."""


def crossings(mesh: Mesh, origin: ArrayLike, direction: ArrayLike) -> NDArray[np.float64]:
    """float64[k], ascending: origin + t · direction is on the mesh. Behind the origin t is
    negative. direction: any length but 0.

    Across the line the triangles lie round the origin or not: what lies wholly on one side of an
    axis there is left out first, so that two million triangles take some tens of milliseconds.
    """
    start, way = (np.asarray(v, np.float64) for v in (origin, direction))
    if not len(mesh.faces):
        return np.empty(0)
    square = float(way @ way)
    least = np.eye(3)[int(np.argmin(np.abs(way)))]
    one = np.cross(way, least)
    frame = np.stack([one, np.cross(way, one)], axis=1)
    frame = frame / np.linalg.norm(frame, axis=0)
    sides = np.zeros(len(mesh.vertices), np.uint8)
    for k, bit in enumerate((1, 4)):
        across = mesh.vertices @ frame[:, k].astype(np.float32)
        level = np.float32(start @ frame[:, k])
        sides |= (across >= level) * np.uint8(bit) | (across <= level) * np.uint8(2 * bit)
    found = []
    for first in range(0, len(mesh.faces), BLOCK):
        faces = mesh.faces[first : first + BLOCK]
        a, b, c = (sides[faces[:, k]] for k in range(3))
        found.append(faces[(a & b & c) == 0])
    corners = mesh.vertices[np.concatenate(found)].astype(np.float64) - start
    flat = corners @ frame
    turns = [_turn(flat[:, (k + 1) % 3], flat[:, (k + 2) % 3]) for k in range(3)]
    shares = np.stack(turns, axis=1)
    total = shares.sum(axis=1)
    inside = ((shares >= 0).all(axis=1) | (shares <= 0).all(axis=1)) & (total != 0)
    shares = shares[inside] / total[inside, None]
    at = (shares[:, :, None] * corners[inside]).sum(axis=1)
    return np.sort(at @ way / square)


def _turn(p: NDArray[np.float64], q: NDArray[np.float64]) -> NDArray[np.float64]:
    return p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]
