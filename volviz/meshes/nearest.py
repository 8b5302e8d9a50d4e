"""The nearest triangle to a point: a tree of boxes over the triangles of a mesh.

The triangles are sorted along a Morton curve and lie, a few to a leaf, in a complete binary tree
whose boxes are made from the leaves up. Points are sought one after the other; the triangle that
was nearest to the last one bounds the search for the next.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volviz.compiled import inline, kernel
from volviz.model.mesh import Mesh
from volviz.progress import Progress, silent

LEAF = 4
BUILDING = "measuring the distance"
_RANGE = 1 << 16  # triangles between two looks at the cancel flag
_BITS = 16  # of each coordinate in the Morton order; 48 in all


class Tree(NamedTuple):
    """corners: float64[m, 3, 3], the triangles in the order of the leaves. boxes: float64[2k, 6],
    low and high corner of node i, whose children are 2i and 2i + 1; node 1 is the root and the
    leaves are k to 2k − 1, of LEAF triangles each."""

    corners: NDArray[np.float64]
    boxes: NDArray[np.float64]


def tree_of(mesh: Mesh, progress: Progress | None = None) -> Tree:
    """The tree of a mesh that has faces. Raises Cancelled."""
    report = progress or silent()
    corners = mesh.vertices.astype(np.float64)[mesh.faces]
    report(None, BUILDING)
    middles = corners.mean(axis=1)
    low = middles.min(axis=0)
    size = float((middles.max(axis=0) - low).max()) or 1.0
    code = np.empty(len(corners), np.uint64)
    for first in range(0, len(corners), _RANGE):
        report(None, BUILDING)
        some = slice(first, first + _RANGE)
        cells = ((middles[some] - low) * ((2**_BITS - 1) / size)).astype(np.uint64)
        code[some] = _spread(cells[:, 0]) | _spread(cells[:, 1]) << 1 | _spread(cells[:, 2]) << 2
    report(None, BUILDING)
    order = np.argsort(code, kind="stable")
    report(None, BUILDING)
    corners = np.ascontiguousarray(corners[order])
    report(None, BUILDING)
    leaves = 1
    while leaves * LEAF < len(corners):
        leaves *= 2
    boxes = np.empty((2 * leaves, 6))
    fill_boxes(corners, boxes)
    return Tree(corners, boxes)


def _spread(bits: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """Bit i of a number of 16 bits goes to bit 3i."""
    for shift, mask in (
        (16, 0xFF0000FF),
        (8, 0xF00F00F00F),
        (4, 0xC30C30C30C3),
        (2, 0x249249249249),
    ):
        bits = (bits | bits << np.uint64(shift)) & np.uint64(mask)
    return bits


@kernel
def fill_boxes(corners: Any, boxes: Any) -> None:
    """The boxes of all nodes; a node without triangles has one that nothing is near to."""
    leaves = boxes.shape[0] // 2
    boxes[:, :3], boxes[:, 3:] = np.inf, -np.inf
    for i in range(corners.shape[0]):
        node = leaves + i // LEAF
        for k in range(3):
            for c in range(3):
                boxes[node, k] = min(boxes[node, k], corners[i, c, k])
                boxes[node, 3 + k] = max(boxes[node, 3 + k], corners[i, c, k])
    for node in range(leaves - 1, 0, -1):
        for k in range(3):
            boxes[node, k] = min(boxes[2 * node, k], boxes[2 * node + 1, k])
            boxes[node, 3 + k] = max(boxes[2 * node, 3 + k], boxes[2 * node + 1, 3 + k])


@inline
def box_square(boxes: Any, node: int, x: float, y: float, z: float) -> float:
    """Squared distance to a box, 0 inside."""
    dx = max(boxes[node, 0] - x, 0.0, x - boxes[node, 3])
    dy = max(boxes[node, 1] - y, 0.0, y - boxes[node, 4])
    dz = max(boxes[node, 2] - z, 0.0, z - boxes[node, 5])
    return dx * dx + dy * dy + dz * dz


@inline
def segment_square(px: float, py: float, pz: float, dx: float, dy: float, dz: float) -> float:
    """Squared distance of a point p to the segment from 0 to d."""
    length = dx * dx + dy * dy + dz * dz
    t = min(max((px * dx + py * dy + pz * dz) / length, 0.0), 1.0) if length > 0.0 else 0.0
    ex, ey, ez = px - t * dx, py - t * dy, pz - t * dz
    return ex * ex + ey * ey + ez * ez


@inline
def triangle_square(corners: Any, i: int, x: float, y: float, z: float) -> float:
    """Squared distance of a point to a triangle, a degenerate one too."""
    ax, ay, az = corners[i, 0, 0], corners[i, 0, 1], corners[i, 0, 2]
    ux, uy, uz = corners[i, 1, 0] - ax, corners[i, 1, 1] - ay, corners[i, 1, 2] - az
    vx, vy, vz = corners[i, 2, 0] - ax, corners[i, 2, 1] - ay, corners[i, 2, 2] - az
    px, py, pz = x - ax, y - ay, z - az
    nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    square = nx * nx + ny * ny + nz * nz
    if square > 0.0:
        # barycentric coordinates of the point's foot in the plane, times `square`
        s = (py * vz - pz * vy) * nx + (pz * vx - px * vz) * ny + (px * vy - py * vx) * nz
        t = (uy * pz - uz * py) * nx + (uz * px - ux * pz) * ny + (ux * py - uy * px) * nz
        if s >= 0.0 and t >= 0.0 and s + t <= square:
            height = px * nx + py * ny + pz * nz
            return height * height / square
    return min(
        segment_square(px, py, pz, ux, uy, uz),
        segment_square(px, py, pz, vx, vy, vz),
        segment_square(px - ux, py - uy, pz - uz, vx - ux, vy - uy, vz - uz),
    )


@inline
def nearest(
    corners: Any, boxes: Any, stack: Any, hint: int, x: float, y: float, z: float
) -> tuple[float, int]:
    """Squared distance to the nearest triangle, and which; hint: any triangle, best a near one."""
    leaves = boxes.shape[0] // 2
    best, which = triangle_square(corners, hint, x, y, z), hint
    stack[0], depth = 1, 1
    while depth:
        depth -= 1
        node = stack[depth]
        if not box_square(boxes, node, x, y, z) < best:
            continue
        if node >= leaves:
            first = (node - leaves) * LEAF
            for i in range(first, min(first + LEAF, corners.shape[0])):
                square = triangle_square(corners, i, x, y, z)
                if square < best:
                    best, which = square, i
            continue
        left = box_square(boxes, 2 * node, x, y, z)
        right = box_square(boxes, 2 * node + 1, x, y, z)
        near = 2 * node + (right < left)
        if max(left, right) < best:
            stack[depth] = near ^ 1
            depth += 1
        if min(left, right) < best:
            stack[depth] = near
            depth += 1
    return best, which


@kernel
def point_distances(points: Any, corners: Any, boxes: Any, out: Any) -> None:
    """float64[n]: distance of each point, float64[n, 3], to the nearest triangle."""
    stack = np.empty(128, np.int64)
    hint = 0
    for i in range(points.shape[0]):
        square, hint = nearest(
            corners, boxes, stack, hint, points[i, 0], points[i, 1], points[i, 2]
        )
        out[i] = np.sqrt(square)


@kernel
def face_samples(
    vertices: Any, faces: Any, step: float, corners: Any, boxes: Any, sums: Any
) -> None:
    """Distances from points spread over faces: adds to `sums`, float64[8].

    A face is cut into k² equal triangles, none longer than `step`, and sampled at their middles.
    sums: area, area · distance, area · distance², greatest distance, where (x, y, z), samples.
    """
    stack = np.empty(128, np.int64)
    hint = 0
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        ux, uy, uz = (
            vertices[b, 0] - vertices[a, 0],
            vertices[b, 1] - vertices[a, 1],
            vertices[b, 2] - vertices[a, 2],
        )
        vx, vy, vz = (
            vertices[c, 0] - vertices[a, 0],
            vertices[c, 1] - vertices[a, 1],
            vertices[c, 2] - vertices[a, 2],
        )
        nx, ny, nz = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        longest = max(
            ux * ux + uy * uy + uz * uz,
            vx * vx + vy * vy + vz * vz,
            (ux - vx) ** 2 + (uy - vy) ** 2 + (uz - vz) ** 2,
        )
        parts = max(1, int(np.ceil(np.sqrt(longest) / step)))
        weight = 0.5 * np.sqrt(nx * nx + ny * ny + nz * nz) / (parts * parts)
        for i in range(parts):
            for j in range(2 * (parts - i) - 1):
                upper = j & 1  # the triangles of a row point up and down in turn
                s = (j // 2 + (2.0 if upper else 1.0) / 3) / parts
                t = (i + (2.0 if upper else 1.0) / 3) / parts
                x = vertices[a, 0] + s * ux + t * vx
                y = vertices[a, 1] + s * uy + t * vy
                z = vertices[a, 2] + s * uz + t * vz
                square, hint = nearest(corners, boxes, stack, hint, x, y, z)
                distance = np.sqrt(square)
                sums[0] += weight
                sums[1] += weight * distance
                sums[2] += weight * square
                sums[7] += 1
                if distance > sums[3]:
                    sums[3], sums[4], sums[5], sums[6] = distance, x, y, z
