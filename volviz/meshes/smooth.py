"""Smoothing without shrinkage: Taubin's λ|μ filter ("A signal processing approach to fair surface
design", 1995)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.compiled import kernel
from volviz.errors import UsageError
from volviz.meshes.adjacency import Edges, Ints, edges_of, joined, proper_faces
from volviz.meshes.attributes import unit
from volviz.meshes.normals import with_normals
from volviz.model.mesh import Mesh
from volviz.progress import Progress, silent

PASS_BAND = 0.1
"""Frequency of the uniform Laplacian (0 to 2) that is kept as it is; lower ones grow a little."""
LAMBDA = 0.5
MU = 1 / (PASS_BAND - 1 / LAMBDA)
NEWTON = 6
"""Steps, at most, to the volume that a part had."""
LOST = 1e-6
"""Share of its volume below which nothing is left of a part's shape: it stays as it was."""


def smooth(
    mesh: Mesh,
    iterations: int = 10,
    *,
    fixed_boundary: bool = True,
    progress: Progress | None = None,
) -> Mesh:
    """A smoother mesh of the same triangles; the normals, where there are any, are made anew.

    An iteration moves each vertex towards the mean of its neighbours (λ = 0.5) and then back
    (μ ≈ −0.526), which takes off what is rougher than some edges and keeps the rest, but for
    large shapes, which grow by some percent in a hundred iterations. So at the end the surface of
    each closed part is moved along its normals until it encloses what it did: the volume stays
    within 0.1 %. Parts so small that nothing would be left of them stay as they are. Boundary
    vertices stay, or (fixed_boundary false) are smoothed along the boundary alone. Raises
    UsageError for iterations < 0, Cancelled.
    """
    if iterations < 0:
        raise UsageError(f"{iterations} is no number of iterations", field="--smooth")
    if not iterations or not len(mesh.faces):
        return mesh
    progress = progress or silent()
    faces = proper_faces(mesh)
    progress(0.0, "smoothing")
    edges = edges_of(faces, len(mesh.vertices))
    boundary = np.zeros(len(mesh.vertices), bool)
    boundary[edges.ends[edges.uses == 1]] = True
    points = mesh.vertices.astype(np.float64)
    for k in range(iterations):
        for factor in (LAMBDA, MU):
            progress(k / iterations, "smoothing")
            points = relaxed(points, edges.ends, edges.uses, boundary, factor, fixed_boundary)
    points = _with_volume(points, mesh, faces, edges, progress)
    made = replace(mesh, vertices=points.astype(np.float32))
    return with_normals(made, progress=progress) if len(mesh.normals) else made


def _with_volume(
    points: NDArray[np.float64], mesh: Mesh, faces: Ints, edges: Edges, progress: Progress
) -> NDArray[np.float64]:
    """The points moved along the normals, so that each closed part encloses what `mesh` does."""
    roots = joined(edges.ends, len(points))
    of_face = roots[faces[:, 0]]
    closed = np.ones(len(points), bool)
    closed[roots[edges.ends[edges.balance != 0]]] = False
    given = mesh.vertices.astype(np.float64)
    progress(1.0, "smoothing")
    before, spans = _volumes(given, faces, of_face)
    reach = 2 * np.abs(before) / np.maximum(_growth(spans, roots)[0], 1e-300)  # of a ball: ⅔ radius
    now, _ = _volumes(points, faces, of_face)
    lost = closed & (np.abs(now) < LOST * np.abs(before))
    points = np.where(lost[roots][:, None], given, points)
    for turn in range(NEWTON):  # two are enough but for small parts: a step is 0.01 of an edge
        progress(1.0, "smoothing")
        now, spans = _volumes(points, faces, of_face)
        growth, normals = _growth(spans, roots)
        step = (before - now) / np.where(closed & (growth > 0), growth, np.inf)
        points = points + np.clip(step, -reach, reach)[roots][:, None] * normals
        if turn and (np.abs(before - now) <= 0.01 * np.abs(before))[closed].all():
            break
    return points


def _growth(
    spans: NDArray[np.float64], roots: Ints
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """How the volume of each part, at its root, grows with a step along its normals; those."""
    normals = unit(spans).astype(np.float64)
    growth = np.bincount(roots, (normals * spans).sum(axis=1), len(roots))
    return growth.astype(np.float64), normals


def _volumes(
    points: NDArray[np.float64], faces: Ints, of_face: Ints
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Signed volume of each part, at the place of its root; how it grows with each vertex."""
    volumes, spans = np.zeros(len(points)), np.zeros_like(points)
    summed_volumes(points - points.mean(axis=0), faces, of_face, volumes, spans)
    return volumes, spans


@kernel
def summed_volumes(at: Any, faces: Any, of_face: Any, volumes: Any, spans: Any) -> None:
    """Adds what each face does to the volume of its part, and to how that grows."""
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        for k in range(3):
            i, j = (k + 1) % 3, (k + 2) % 3
            cross = at[b, i] * at[c, j] - at[b, j] * at[c, i]
            volumes[of_face[f]] += at[a, k] * cross / 6
            p, q = at[b, i] - at[a, i], at[b, j] - at[a, j]
            span = (p * (at[c, j] - at[a, j]) - q * (at[c, i] - at[a, i])) / 6
            spans[a, k] += span
            spans[b, k] += span
            spans[c, k] += span


@kernel
def relaxed(points: Any, ends: Any, uses: Any, boundary: Any, factor: float, fixed: bool) -> Any:
    """Each point moved by a factor of the way to the mean of its neighbours."""
    sums = np.zeros_like(points)
    counts = np.zeros(points.shape[0], np.int32)
    for e in range(ends.shape[0]):
        u, v = ends[e, 0], ends[e, 1]
        for a, b in ((u, v), (v, u)):
            if boundary[a] and (fixed or uses[e] != 1):
                continue
            counts[a] += 1
            for k in range(3):
                sums[a, k] += points[b, k]
    out = points.copy()
    for v in range(points.shape[0]):
        if counts[v]:
            for k in range(3):
                out[v, k] += factor * (sums[v, k] / counts[v] - points[v, k])
    return out
