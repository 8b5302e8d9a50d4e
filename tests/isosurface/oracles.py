"""What surfaces are measured against; none of it uses our extractors.

`solid_euler` is exact: Morse theory of the piecewise trilinear function. Its critical points are
samples, saddles of faces and saddles inside cells, and each changes the Euler characteristic of
{f ≥ c} by 1 − χ(the part of a small sphere round it where f is greater).
"""

from __future__ import annotations

from itertools import combinations

import numpy as np
from scipy import ndimage
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import connected_components


def directed_edges(faces):
    faces = np.asarray(faces, dtype=np.int64)
    return np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])


def assert_closed(mesh):
    """Every edge twice, in opposite directions; no face twice; no vertex without a face."""
    edges = directed_edges(mesh.faces)
    n = max(len(mesh.vertices), 1)
    there, back = edges[:, 0] * n + edges[:, 1], edges[:, 1] * n + edges[:, 0]
    assert len(np.unique(there)) == len(there)
    assert np.array_equal(np.sort(there), np.sort(back))
    assert len(np.unique(np.sort(mesh.faces, axis=1), axis=0)) == len(mesh.faces)
    assert np.array_equal(np.unique(mesh.faces), np.arange(len(mesh.vertices)))


def boundary_edges(mesh):
    """How many edges are not used once in each direction."""
    edges = directed_edges(mesh.faces)
    n = max(len(mesh.vertices), 1)
    there, back = edges[:, 0] * n + edges[:, 1], edges[:, 1] * n + edges[:, 0]
    return len(np.setxor1d(there, back))


def euler(mesh):
    return len(mesh.vertices) - len(mesh.faces) // 2


def parts(mesh):
    """(count, part of each vertex)."""
    n, edges = len(mesh.vertices), directed_edges(mesh.faces)
    graph = coo_matrix((np.ones(len(edges), bool), (edges[:, 0], edges[:, 1])), shape=(n, n))
    return connected_components(graph, directed=False)


def corners(mesh):
    return mesh.vertices.astype(np.float64)[mesh.faces]


def volume_inside(mesh):
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    return float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum() / 6)


def area(mesh):
    a, b, c = np.moveaxis(corners(mesh), 1, 0)
    return float(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2)


def solid_euler(blocks, level):
    """int[n]: χ of {f ≥ level} of each block float64[n, z, y, x] whose border is below."""
    return _of_samples(blocks, level) + _of_faces(blocks, level) + _of_cells(blocks, level)


def _of_samples(f, level):
    mid = f[:, 1:-1, 1:-1, 1:-1]
    up = {}
    for axis in range(3):
        for side in (0, 1):
            at = [slice(None)] + [slice(1, -1)] * 3
            at[1 + axis] = slice(2, None) if side else slice(None, -2)
            up[axis, side] = f[tuple(at)] > mid
    link = sum(u.astype(int) for u in up.values())
    for a, b in combinations(up, 2):
        if a[0] != b[0]:
            link -= up[a] & up[b]
    for i in (0, 1):
        for j in (0, 1):
            for k in (0, 1):
                link += up[0, i] & up[1, j] & up[2, k]
    return np.where(mid >= level, 1 - link, 0).sum(axis=(1, 2, 3))


def _of_faces(f, level):
    total = np.zeros(len(f), dtype=int)
    for axis in range(3):
        g = np.moveaxis(f, 1 + axis, 1)
        a, b = g[:, 1:-1, :-1, :-1], g[:, 1:-1, 1:, :-1]
        c, d = g[:, 1:-1, 1:, 1:], g[:, 1:-1, :-1, 1:]
        low, high = np.minimum(a, c) > np.maximum(b, d), np.minimum(b, d) > np.maximum(a, c)
        with np.errstate(divide="ignore", invalid="ignore"):
            span = a + c - b - d
            value, u, v = (a * c - b * d) / span, (a - d) / span, (a - b) / span
            rises = 0
            for part in (slice(2, None), slice(None, -2)):
                w = g[:, part]
                across = w[:, :, :-1, :-1] * (1 - u) * (1 - v) + w[:, :, 1:, :-1] * u * (1 - v)
                across = across + w[:, :, 1:, 1:] * u * v + w[:, :, :-1, 1:] * (1 - u) * v
                rises = rises + (across > value)
            there = (low | high) & (value >= level)
        total += np.where(there, rises - 1, 0).sum(axis=(1, 2, 3))
    return total


def _of_cells(f, level):
    v = {
        (x, y, z): f[:, z : f.shape[1] - 1 + z, y : f.shape[2] - 1 + y, x : f.shape[3] - 1 + x]
        for x in (0, 1)
        for y in (0, 1)
        for z in (0, 1)
    }
    a = v[0, 0, 0]
    b, c, d = v[1, 0, 0] - a, v[0, 1, 0] - a, v[0, 0, 1] - a
    e, g, p = v[1, 1, 0] - a - b - c, v[0, 1, 1] - a - c - d, v[1, 0, 1] - a - b - d
    h = v[1, 1, 1] - a - b - c - d - e - g - p
    total = np.zeros(len(f), dtype=int)
    with np.errstate(divide="ignore", invalid="ignore"):
        al, be, ga = b - e * p / h, c - e * g / h, d - p * g / h
        rest = a - (b * g + c * p + d * e) / h + 2 * e * p * g / h**2
        for sign in (1, -1):
            prod = sign * np.sqrt(-al * be * ga / h**3)
            x, y, z = (-prod * h / k - m / h for k, m in ((al, g), (be, p), (ga, e)))
            inside = (x > 0) & (x < 1) & (y > 0) & (y < 1) & (z > 0) & (z < 1)
            there = inside & (rest - 2 * h * prod >= level)
            total += np.where(there, np.where(h * prod < 0, 1, -1), 0).sum(axis=(1, 2, 3))
    return total


def sampled(block, level, refine):
    """(χ, surfaces) of {f ≥ level} on a finer lattice; None for the count if it is in doubt.

    The lattice is much finer near the samples and the planes through them: where a sample nearly
    equals the level, what there is to see is small and there.
    """
    even = np.arange(refine) / refine
    within = even**3 * (10 - 15 * even + 6 * even**2)
    for axis in range(3):
        n = block.shape[axis]
        at = (np.arange(n - 1)[:, None] + within).reshape(-1)
        low = at.astype(int)
        weights = np.zeros((len(at), n))
        weights[np.arange(len(at)), low] = 1 - (at - low)
        weights[np.arange(len(at)), low + 1] = at - low
        block = np.moveaxis(np.tensordot(weights, block, (1, axis)), 0, axis)
    solid = block >= level
    full = np.ones((3, 3, 3))
    counts = [ndimage.label(solid, s)[1] + ndimage.label(~solid, s)[1] - 1 for s in (None, full)]
    return _lattice_euler(solid), counts[0] if counts[0] == counts[1] else None


def _lattice_euler(solid):
    total = 0
    for dims in range(4):
        for axes in combinations(range(3), dims):
            part = solid
            for axis in axes:
                n = part.shape[axis]
                part = part.take(range(1, n), axis) & part.take(range(n - 1), axis)
            total += (-1) ** dims * int(part.sum())
    return total
