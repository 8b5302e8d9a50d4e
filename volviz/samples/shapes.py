"""Signed distance functions on open grids: the clay that the sample volumes are modelled from.

Distances are in mm, negative inside, float32. A `Shape` knows the box that holds it, so that
`carve` touches only the samples near it. Coordinates come as a `Grid` of three open axes, which
keeps most of the arithmetic in one or two dimensions until the last sum.

Sources: ellipsoid bound and round cone after I. Quilez, "Distance functions"; polynomial smooth
minimum after the same author; Catmull–Rom splines for curved tubes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float32]
Point = Sequence[float]
Distance = Callable[[Array, Array, Array], Array]
FAR = np.float32(1e3)


@dataclass(frozen=True, eq=False)
class Grid:
    """Sample positions as open axes: x float32[1, 1, nx], y [1, ny, 1], z [nz, 1, 1], ascending."""

    x: Array
    y: Array
    z: Array

    @classmethod
    def of(cls, x: ArrayLike, y: ArrayLike, z: ArrayLike) -> Grid:
        """The grid of three one-dimensional axes in mm."""
        a, b, c = (np.asarray(axis, dtype=np.float32) for axis in (x, y, z))
        return cls(a[None, None, :], b[None, :, None], c[:, None, None])

    @property
    def shape(self) -> tuple[int, int, int]:
        """Samples along z, y, x."""
        return self.z.size, self.y.size, self.x.size

    def window(self, low: Point, high: Point, reach: float) -> tuple[slice, slice, slice] | None:
        """Slices [z, y, x] of the samples within `reach` of a box, None if there are none."""
        found = []
        for axis, a, b in zip((self.x, self.y, self.z), low, high, strict=True):
            start, stop = np.searchsorted(axis.ravel(), (a - reach, b + reach))
            if start == stop:
                return None
            found.append(slice(int(start), int(stop)))
        return found[2], found[1], found[0]

    def part(self, window: tuple[slice, slice, slice]) -> Grid:
        """The grid of a window."""
        return Grid(self.x[:, :, window[2]], self.y[:, window[1]], self.z[window[0]])


@dataclass(frozen=True, eq=False)
class Shape:
    """A body: `distance(x, y, z)` in mm, and the box low..high (x, y, z order) that holds it."""

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    distance: Distance


@dataclass(frozen=True, eq=False)
class Part:
    """One stroke of the modeller: add a shape or cut it out.

    blend: width in mm of the rounding along the seam; 0 is a sharp seam.
    """

    shape: Shape
    how: Literal["add", "cut"] = "add"
    blend: float = 0.0


def add(shape: Shape, blend: float = 0.0) -> Part:
    """The union with `shape`."""
    return Part(shape, "add", blend)


def cut(shape: Shape, blend: float = 0.0) -> Part:
    """What is left when `shape` is taken away."""
    return Part(shape, "cut", blend)


def carve(grid: Grid, parts: Iterable[Part], start: Array | None = None) -> Array:
    """float32[z, y, x]: the distance to the body that the parts make, in order.

    Right near the surface and inside; far outside it is only known to be positive. `start` is a
    body to go on from, it is not changed.
    """
    body = np.full(grid.shape, FAR) if start is None else start.copy()
    for part in parts:
        shape = part.shape
        window = grid.window(shape.low, shape.high, 2 * part.blend + 2)
        if window is None:
            continue
        near = grid.part(window)
        distance = shape.distance(near.x, near.y, near.z)
        if part.how == "add":
            body[window] = smooth_min(body[window], distance, part.blend)
        else:
            body[window] = -smooth_min(-body[window], distance, part.blend)
    return body


def smooth_min(a: Array, b: Array, blend: float) -> Array:
    """The smaller of two distances, rounded over `blend` mm."""
    if blend <= 0:
        return np.minimum(a, b)
    seam = np.abs(a - b)
    np.subtract(np.float32(blend), seam, out=seam)
    np.maximum(seam, 0, out=seam)
    seam *= seam
    seam *= np.float32(0.25 / blend)
    return np.subtract(np.minimum(a, b), seam, out=seam)


def ellipsoid(centre: Point, radii: Point, turn: Point = (0.0, 0.0, 0.0)) -> Shape:
    """An ellipsoid; `turn` rotates it about x, then y, then z, in degrees."""
    c = [np.float32(v) for v in centre]
    inverse = [np.float32(1 / r) for r in radii]

    def distance(x: Array, y: Array, z: Array) -> Array:
        u, v, w = ((p - q) * s for p, q, s in zip((x, y, z), c, inverse, strict=True))
        k0 = np.sqrt((u * u + v * v) + w * w)
        u, v, w = u * inverse[0], v * inverse[1], w * inverse[2]
        k1 = (u * u + v * v) + w * w
        np.maximum(k1, np.float32(1e-12), out=k1)
        np.sqrt(k1, out=k1)
        np.divide(k0, k1, out=k1)
        k0 -= 1
        return np.multiply(k0, k1, out=k0)

    return _turned(centre, radii, turn, distance)


def box(centre: Point, half: Point, rounding: float, turn: Point = (0.0, 0.0, 0.0)) -> Shape:
    """A box with rounded edges; `half` are its half lengths, rounding included."""
    c = [np.float32(v) for v in centre]
    inner = [np.float32(max(h - rounding, 0.0)) for h in half]

    def distance(x: Array, y: Array, z: Array) -> Array:
        q = [np.abs(p - o) - h for p, o, h in zip((x, y, z), c, inner, strict=True)]
        out = [np.maximum(v, 0) for v in q]
        outside = np.sqrt((out[0] ** 2 + out[1] ** 2) + out[2] ** 2)
        inside = np.minimum(np.maximum(np.maximum(q[0], q[1]), q[2]), 0)
        return outside + inside - np.float32(rounding)

    return _turned(centre, half, turn, distance)


def cone(a: Point, b: Point, ra: float, rb: float) -> Shape:
    """A round cone: a capsule from a (radius ra) to b (radius rb)."""
    low = tuple(min(p - ra, q - rb) for p, q in zip(a, b, strict=True))
    high = tuple(max(p + ra, q + rb) for p, q in zip(a, b, strict=True))
    axis = [np.float32(q - p) for p, q in zip(a, b, strict=True)]
    length2 = np.float32(max(sum(float(v) ** 2 for v in axis), 1e-12))
    start = [np.float32(p) for p in a]

    def distance(x: Array, y: Array, z: Array) -> Array:
        u, v, w = x - start[0], y - start[1], z - start[2]
        t = (u * (axis[0] / length2) + v * (axis[1] / length2)) + w * (axis[2] / length2)
        np.clip(t, 0, 1, out=t)
        square = np.square(u - t * axis[0])
        square += np.square(v - t * axis[1])
        square += np.square(w - t * axis[2])
        np.sqrt(square, out=square)
        square -= np.float32(ra) + t * np.float32(rb - ra)
        return square

    return Shape(low, high, distance)  # type: ignore[arg-type]


def tube(points: Sequence[Point], radius: float | Sequence[float], steps: int = 3) -> Shape:
    """A tube along a Catmull–Rom spline; one radius, or one per point."""
    nodes = np.asarray(points, float)
    radii = np.broadcast_to(np.asarray(radius, float), (len(nodes),))
    path = spline(np.column_stack([nodes, radii]), steps)
    return union(cone(p[:3], q[:3], float(p[3]), float(q[3])) for p, q in pairwise(path))


def ribbon(nodes: Sequence[Sequence[float]], steps: int = 3) -> Shape:
    """A band that stands upright along a spline: nodes are (x, y, z, half height, radius)."""
    path = spline(np.asarray(nodes, float), steps)
    return union(_band(p, q) for p, q in pairwise(path))


def _band(p: NDArray[np.float64], q: NDArray[np.float64]) -> Shape:
    """One straight piece of a ribbon."""
    margin = np.maximum(p[4], q[4]) * np.ones(3)
    margin[2] += max(p[3], q[3])
    low, high = np.minimum(p[:3], q[:3]) - margin, np.maximum(p[:3], q[:3]) + margin
    start, along = p.astype(np.float32), (q - p).astype(np.float32)
    run = np.float32(max(float(along[0]) ** 2 + float(along[1]) ** 2, 1e-12))

    def distance(x: Array, y: Array, z: Array) -> Array:
        u, v = x - start[0], y - start[1]
        t = np.clip((u * along[0] + v * along[1]) / run, 0, 1)
        plan = np.square(u - t * along[0]) + np.square(v - t * along[1])
        up = np.abs(z - (start[2] + t * along[2])) - (start[3] + t * along[3])
        return np.sqrt(plan + np.square(np.maximum(up, 0))) - (start[4] + t * along[4])

    return Shape(tuple(low.tolist()), tuple(high.tolist()), distance)


def union(shapes: Iterable[Shape]) -> Shape:
    """The sharp union of shapes, as one shape."""
    members = list(shapes)
    corners = np.array([[s.low, s.high] for s in members])
    low, high = corners[:, 0].min(0).tolist(), corners[:, 1].max(0).tolist()

    def distance(x: Array, y: Array, z: Array) -> Array:
        nearest = members[0].distance(x, y, z)
        for member in members[1:]:
            np.minimum(nearest, member.distance(x, y, z), out=nearest)
        return nearest

    return Shape(tuple(low), tuple(high), distance)


def spline(nodes: NDArray[np.float64], steps: int) -> NDArray[np.float64]:
    """float64[(n−1)·steps+1, k]: a Catmull–Rom curve through `nodes` [n, k], ends included."""
    ends = np.concatenate([2 * nodes[:1] - nodes[1:2], nodes, 2 * nodes[-1:] - nodes[-2:-1]])
    t = (np.arange(steps) / steps)[None, :, None]
    p0, p1, p2, p3 = (ends[i : i + len(nodes) - 1, None] for i in range(4))
    curve = 0.5 * (
        2 * p1
        + (p2 - p0) * t
        + (2 * p0 - 5 * p1 + 4 * p2 - p3) * t**2
        + (3 * p1 - p0 - 3 * p2 + p3) * t**3
    )
    return np.concatenate([curve.reshape(-1, nodes.shape[1]), nodes[-1:]])


def surface(nodes: Sequence[Sequence[float]], grid: Grid) -> Array:
    """float32[1, y, x]: a smooth height z over (x, y) through nodes (x, y, z).

    Nodes have x ≥ 0, their mirror images count too. A thin-plate spline (Duchon) with a little
    slack, so that close nodes make no ripples.
    """
    table = np.array(nodes, float)
    mirror = table[table[:, 0] > 0] * [-1, 1, 1]
    table = np.concatenate([table, mirror])
    places = table[:, :2] / 50
    count = len(table)
    system = np.zeros((count + 3, count + 3))
    system[:count, :count] = _plate(((places[:, None] - places[None]) ** 2).sum(-1))
    system[:count, :count] += 2e-3 * np.eye(count)
    system[:count, count:] = np.column_stack([np.ones(count), places])
    system[count:, :count] = system[:count, count:].T
    weights = np.linalg.solve(system, np.concatenate([table[:, 2], np.zeros(3)]))
    x, y = grid.x.astype(np.float64) / 50, grid.y.astype(np.float64) / 50
    height = weights[count] + weights[count + 1] * x + weights[count + 2] * y
    for (px, py), weight in zip(places, weights[:count], strict=True):
        height = height + weight * _plate((x - px) ** 2 + (y - py) ** 2)
    return height.astype(np.float32)


def _plate(square: NDArray[np.float64]) -> NDArray[np.float64]:
    """r² log r of squared distances."""
    return 0.5 * square * np.log(square + 1e-12)


def _turned(centre: Point, radii: Point, turn: Point, distance: Distance) -> Shape:
    """The shape turned about its centre, with the box that then holds it."""
    if not any(turn):
        low = tuple(c - r for c, r in zip(centre, radii, strict=True))
        high = tuple(c + r for c, r in zip(centre, radii, strict=True))
        return Shape(low, high, distance)  # type: ignore[arg-type]
    rotation = rotation_of(turn)
    extent = np.abs(rotation) @ np.asarray(radii, float)
    middle = np.asarray(centre, float)
    m = rotation.T.astype(np.float32)
    c = middle.astype(np.float32)

    def turned(x: Array, y: Array, z: Array) -> Array:
        u, v, w = x - c[0], y - c[1], z - c[2]
        p = [(m[i, 0] * u + m[i, 1] * v) + m[i, 2] * w + c[i] for i in range(3)]
        return distance(p[0], p[1], p[2])

    low_corner, high_corner = (middle - extent).tolist(), (middle + extent).tolist()
    return Shape(tuple(low_corner), tuple(high_corner), turned)


def rotation_of(turn: Point) -> NDArray[np.float64]:
    """float64[3, 3]: rotation about x, then y, then z, by degrees."""
    result: NDArray[Any] = np.eye(3)
    for axis, degrees in enumerate(turn):
        i, j = (axis + 1) % 3, (axis + 2) % 3
        one = np.eye(3)
        one[i, i] = one[j, j] = math.cos(math.radians(degrees))
        one[j, i] = math.sin(math.radians(degrees))
        one[i, j] = -one[j, i]
        result = one @ result
    return result
