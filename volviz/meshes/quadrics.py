"""Quadric error (Garland and Heckbert 1997): how far a point is from the planes of its faces.

A quadric is 11 numbers: the symmetric matrix (xx, xy, xz, yy, yz, zz), the vector (x, y, z), the
constant, and the area that it stands for. Σ area · distance² of a point x to the planes is
xᵀAx + 2b·x + c. Quadrics are weighted by area, so that they depend little on how a flat part is
cut into triangles.
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from volviz.compiled import inline, kernel

SIZE = 11
STIFF = 1e-5
"""Weight of a pull to the middle of the edge: decides where along a flat part or a straight ridge
the point goes, where the planes leave it open."""
SHORT = 1e-8
"""Weight of the squared length of an edge in its cost: shorter first, where nothing else tells."""
BORDER = 10.0
"""Weight of the plane through a boundary edge, upright on its face, that holds the boundary."""


FOLDED, FOLD = 0.6, 0.3
"""Mean normal of a vertex below which its edges are looked at, and cosine between the normals at an
edge (less a sign) beyond which it is a fold."""


@inline
def add_plane(
    quadrics: Any, v: int, nx: float, ny: float, nz: float, d: float, weight: float
) -> None:
    """Add weight · (n·x + d)² to the quadric of v."""
    quadrics[v, 0] += weight * nx * nx
    quadrics[v, 1] += weight * nx * ny
    quadrics[v, 2] += weight * nx * nz
    quadrics[v, 3] += weight * ny * ny
    quadrics[v, 4] += weight * ny * nz
    quadrics[v, 5] += weight * nz * nz
    quadrics[v, 6] += weight * nx * d
    quadrics[v, 7] += weight * ny * d
    quadrics[v, 8] += weight * nz * d
    quadrics[v, 9] += weight * d * d


@inline
def normal_of(p: Any, a: int, b: int, c: int) -> tuple[float, float, float]:
    """Twice the area times the normal of a triangle."""
    ux, uy, uz = p[b, 0] - p[a, 0], p[b, 1] - p[a, 1], p[b, 2] - p[a, 2]
    vx, vy, vz = p[c, 0] - p[a, 0], p[c, 1] - p[a, 1], p[c, 2] - p[a, 2]
    return uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx


@kernel
def mean_area(points: Any, faces: Any) -> float:
    """Of the faces, of which there is one at least."""
    total = 0.0
    for f in range(faces.shape[0]):
        nx, ny, nz = normal_of(points, faces[f, 0], faces[f, 1], faces[f, 2])
        total += sqrt(nx * nx + ny * ny + nz * nz)
    return total / 2 / faces.shape[0]


@kernel
def face_quadrics(points: Any, faces: Any, least: float, normals: Any) -> Any:
    """float64[n, 11]: at each vertex a third of the quadric of every face around it.

    least: area that even a small face counts for, so that a thin tip is not thought little of.
    normals: float64[n, 3], zeros, to which the faces' normals are added with the same weights.
    """
    quadrics = np.zeros((points.shape[0], SIZE))
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        nx, ny, nz = normal_of(points, a, b, c)
        double = sqrt(nx * nx + ny * ny + nz * nz)
        if double == 0.0:
            continue
        nx, ny, nz = nx / double, ny / double, nz / double
        d = -(nx * points[a, 0] + ny * points[a, 1] + nz * points[a, 2])
        weight = (double / 2 + least) / 3
        for k in range(3):
            add_plane(quadrics, faces[f, k], nx, ny, nz, d, weight)
            quadrics[faces[f, k], 10] += weight
            normals[faces[f, k], 0] += weight * nx
            normals[faces[f, k], 1] += weight * ny
            normals[faces[f, k], 2] += weight * nz
    return quadrics


@kernel
def add_folds(quadrics: Any, points: Any, starts: Any, pairs: Any, normals: Any) -> None:
    """Add at the edges where the surface turns back on itself what `add_borders` adds at its rim.

    A thin fin or a needle has no plane across its edge, and could be cut back at no cost.
    """
    for v in range(starts.size - 1):
        nx, ny, nz = normals[v, 0], normals[v, 1], normals[v, 2]
        area = quadrics[v, 10]
        if nx * nx + ny * ny + nz * nz > FOLDED * FOLDED * area * area:
            continue
        for i in range(starts[v], starts[v + 1]):
            b, c = pairs[i, 0], pairs[i, 1]
            px, py, pz = normal_of(points, v, b, c)
            for j in range(starts[v], starts[v + 1]):
                if pairs[j, 1] != b:
                    continue
                qx, qy, qz = normal_of(points, v, pairs[j, 0], b)
                dot = px * qx + py * qy + pz * qz
                square = (px * px + py * py + pz * pz) * (qx * qx + qy * qy + qz * qz)
                if dot < 0.0 and dot * dot > FOLD * FOLD * square:
                    # upright on both faces: what is between them, seen along the edge
                    hold(quadrics, points, v, v, b, px - qx, py - qy, pz - qz, 0.5)


@kernel
def share_places(quadrics: Any, points: Any, ends: Any) -> None:
    """Vertices in one place, joined by an edge, know each other's planes.

    Where a sample equals the isovalue several are: each has but a part of the faces of a corner.
    """
    for e in range(ends.shape[0]):
        u, v = ends[e, 0], ends[e, 1]
        if points[u, 0] != points[v, 0] or points[u, 1] != points[v, 1]:
            continue
        if points[u, 2] == points[v, 2]:
            for k in range(SIZE):
                one, other = quadrics[u, k], quadrics[v, k]
                quadrics[u, k], quadrics[v, k] = one + other, other + one


@inline
def hold(
    quadrics: Any,
    points: Any,
    v: int,
    a: int,
    b: int,
    nx: float,
    ny: float,
    nz: float,
    weight: float,
) -> None:
    """Add to v the plane through the edge a–b along n."""
    ex, ey, ez = (
        points[b, 0] - points[a, 0],
        points[b, 1] - points[a, 1],
        points[b, 2] - points[a, 2],
    )
    ux, uy, uz = ey * nz - ez * ny, ez * nx - ex * nz, ex * ny - ey * nx
    length = sqrt(ux * ux + uy * uy + uz * uz)
    if length > 0.0:
        ux, uy, uz = ux / length, uy / length, uz / length
        d = -(ux * points[a, 0] + uy * points[a, 1] + uz * points[a, 2])
        square = ex * ex + ey * ey + ez * ez
        add_plane(quadrics, v, ux, uy, uz, d, weight * BORDER * square)


@kernel
def add_borders(quadrics: Any, points: Any, starts: Any, pairs: Any, ends: Any, uses: Any) -> None:
    """Add to both ends of a boundary edge the plane through it that is upright on its face."""
    for e in range(uses.size):
        if uses[e] != 1:
            continue
        a, b, c = ends[e, 0], ends[e, 1], np.int32(-1)
        for i in range(starts[a], starts[a + 1]):
            if pairs[i, 0] == b:
                c = pairs[i, 1]
            elif pairs[i, 1] == b:
                c = pairs[i, 0]
        nx, ny, nz = normal_of(points, a, b, c)
        hold(quadrics, points, a, a, b, nx, ny, nz, 1.0)
        hold(quadrics, points, b, a, b, nx, ny, nz, 1.0)


@inline
def best_point(quadrics: Any, points: Any, u: int, v: int) -> tuple[float, float, float, float]:
    """Where the vertex of the collapsed edge u–v goes, and Σ area · distance² there.

    The point of least error, held a little to the middle of the edge; solved for the step from
    there, so that what is sought is small against the coordinates.
    """
    mx = (points[u, 0] + points[v, 0]) * 0.5
    my = (points[u, 1] + points[v, 1]) * 0.5
    mz = (points[u, 2] + points[v, 2]) * 0.5
    xx, xy = quadrics[u, 0] + quadrics[v, 0], quadrics[u, 1] + quadrics[v, 1]
    xz, yy = quadrics[u, 2] + quadrics[v, 2], quadrics[u, 3] + quadrics[v, 3]
    yz, zz = quadrics[u, 4] + quadrics[v, 4], quadrics[u, 5] + quadrics[v, 5]
    bx, by = quadrics[u, 6] + quadrics[v, 6], quadrics[u, 7] + quadrics[v, 7]
    bz, c = quadrics[u, 8] + quadrics[v, 8], quadrics[u, 9] + quadrics[v, 9]
    stiff = STIFF * (quadrics[u, 10] + quadrics[v, 10])
    gx = xx * mx + xy * my + xz * mz + bx
    gy = xy * mx + yy * my + yz * mz + by
    gz = xz * mx + yz * my + zz * mz + bz
    middle = mx * (gx + bx) + my * (gy + by) + mz * (gz + bz) + c
    sx, sy, sz = xx + stiff, yy + stiff, zz + stiff
    cxx, cxy, cxz = sy * sz - yz * yz, xz * yz - xy * sz, xy * yz - xz * sy
    det = sx * cxx + xy * cxy + xz * cxz
    if not det > 0.0:
        return mx, my, mz, max(middle, 0.0)
    cyy, cyz, czz = sx * sz - xz * xz, xy * xz - sx * yz, sx * sy - xy * xy
    part = -1.0 / det
    dx = part * (cxx * gx + cxy * gy + cxz * gz)
    dy = part * (cxy * gx + cyy * gy + cyz * gz)
    dz = part * (cxz * gx + cyz * gy + czz * gz)
    ex, ey = points[v, 0] - points[u, 0], points[v, 1] - points[u, 1]
    ez = points[v, 2] - points[u, 2]
    if dx * dx + dy * dy + dz * dz > 4 * (ex * ex + ey * ey + ez * ez):
        return mx, my, mz, max(middle, 0.0)
    # E(m + d) = E(m) + 2 g·d + dᵀAd, and (A + stiff) d = −g
    error = middle + gx * dx + gy * dy + gz * dz - stiff * (dx * dx + dy * dy + dz * dz)
    return mx + dx, my + dy, mz + dz, max(error, 0.0)


@inline
def error_at(quadrics: Any, u: int, v: int, x: float, y: float, z: float) -> float:
    """Σ area · distance² of a point to the planes of two vertices."""
    xx, xy = quadrics[u, 0] + quadrics[v, 0], quadrics[u, 1] + quadrics[v, 1]
    xz, yy = quadrics[u, 2] + quadrics[v, 2], quadrics[u, 3] + quadrics[v, 3]
    yz, zz = quadrics[u, 4] + quadrics[v, 4], quadrics[u, 5] + quadrics[v, 5]
    bx, by = quadrics[u, 6] + quadrics[v, 6], quadrics[u, 7] + quadrics[v, 7]
    bz, c = quadrics[u, 8] + quadrics[v, 8], quadrics[u, 9] + quadrics[v, 9]
    gx = xx * x + xy * y + xz * z + 2 * bx
    gy = xy * x + yy * y + yz * z + 2 * by
    gz = xz * x + yz * y + zz * z + 2 * bz
    return max(x * gx + y * gy + z * gz + c, 0.0)
