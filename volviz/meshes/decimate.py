"""Fewer triangles by quadric error, with the topology kept.

Garland and Heckbert 1997: an edge is collapsed to the point nearest to the planes of the faces
that its ends stand for, the cheapest edges first. As in meshoptimizer the cheapest are taken in
rounds, from tables, not one by one from a heap, which is faster.

Kept: the topology, since no edge is collapsed that fails the link condition (components, holes,
handles stay: χ, genus, and the number of boundary loops); triangles do not turn over; the boundary
stays where it is (`fixed`) or is simplified along itself. What is not a manifold (more than two
faces at an edge, fans that touch in a vertex) is left as it is. Colours, values and normals go
along. The error of quadrics is a mean over planes, so the distance is measured: see `max_error`.
"""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError, did_you_mean
from volviz.meshes.adjacency import Ints, edge_table, fans, proper_faces, vertex_pairs
from volviz.meshes.attributes import faces_kept, packed, unpacked
from volviz.meshes.collapse import (
    BORDER,
    FIXED,
    INSIDE,
    LOCKED,
    Round,
    State,
    cheapest,
    collapse,
    edge_costs,
    renamed,
)
from volviz.meshes.distance import two_sided
from volviz.meshes.quadrics import add_borders, add_folds, face_quadrics, mean_area, share_places
from volviz.model.mesh import Mesh
from volviz.model.refining import BOUNDARIES
from volviz.progress import Progress, silent

Around = tuple[Ints, Ints, Ints, Ints]
"""`vertex_pairs` of the faces, and the ends and uses of their edges."""
_KINDS = dict(zip(BOUNDARIES, (FIXED, BORDER), strict=True))
_SHARE = 0.45  # of the edges, that are looked at in a round: more is faster, fewer nearer to a heap
_LATE = 0.1
"""The worst shape of a triangle (`collapse`) in late rounds: what a coarse mesh looks like is
decided then. Early any shape will do: an edge that may not go because of a needle beside it stays
to the end with all its faces, and they lack elsewhere (a fifth more error where a surface is saddle
shaped)."""
_WORTH = 0.05  # of what is to go: a round that takes less looks at all edges, of any shape
_LATE_FROM = 0.2  # of the triangles that there were
_RANGE = 50_000  # edges between two looks at the cancel flag
_RUN = 1 << 14  # edges that are put in order together: what is known of their ends fits a cache
_TRIES = 8
_FLOOR = 0.3  # of the mean area: what a face counts for at least, above its own
_THREADS = 2


def decimate(
    mesh: Mesh,
    reduction: float = 1.0,
    *,
    max_error: float = 0.0,
    boundary: str = "fixed",
    progress: Progress | None = None,
) -> Mesh:
    """A mesh with fewer triangles, near the given one.

    reduction: share of the triangles to take away, 0 to 1; fewer go where the topology, the
    boundary or max_error hold them. max_error: mm that the two meshes may be apart, measured by
    `two_sided` (0: not limited); the result is the given mesh if nothing else is near enough.
    boundary: "fixed" (not moved at all) or "simplified" (along itself, to the same error). Raises
    UsageError for other values, Cancelled.
    """
    _check(reduction, max_error, boundary)
    progress = progress or silent()
    if not len(mesh.faces):
        return mesh
    if not max_error:
        return _reduced(mesh, reduction, np.inf, boundary, progress)
    limit = max_error
    for k in range(_TRIES):
        share = progress.part(k / _TRIES, (k + 1) / _TRIES)
        made = _reduced(mesh, reduction, limit, boundary, share.part(0.0, 0.5))
        apart = two_sided(made, mesh, progress=share.part(0.5, 1.0)).hausdorff
        if apart <= max_error:
            return made
        limit *= min(0.9 * max_error / apart, 0.7)
    return mesh


def _check(reduction: float, max_error: float, boundary: str) -> None:
    if not 0 <= reduction <= 1:
        raise UsageError(
            f"{reduction} is no share of the triangles",
            field="--decimate",
            fix="give a number from 0 (keep all) to 1",
        )
    if not 0 <= max_error < np.inf:
        raise UsageError(f"{max_error} is no length in mm", field="--max-error")
    if boundary not in BOUNDARIES:
        raise UsageError(
            f"unknown boundary '{boundary}'",
            field="--boundary",
            fix=did_you_mean(boundary, BOUNDARIES),
        )


def _reduced(mesh: Mesh, reduction: float, limit: float, boundary: str, progress: Progress) -> Mesh:
    faces = proper_faces(mesh)
    goal = round(len(mesh.faces) * (1 - reduction))
    if len(faces) <= goal or not len(faces):
        return mesh
    # around the middle and about 1 in size: products of coordinates keep their digits
    low, high = mesh.bounds
    scale = float(np.max(high - low)) or 1.0
    points = (mesh.vertices.astype(np.float64) - (low + high) / 2) / scale
    state, around = _start(points, faces, packed(mesh), boundary)
    total = len(faces)
    while len(faces) > goal:
        progress((total - len(faces)) / max(total - goal, 1), "decimating")
        surplus, left = len(faces) - goal, len(faces)
        shape = 0.0 if left > _LATE_FROM * total else _LATE
        names, gone = _round(around, surplus, left, shape, state, limit / scale, progress)
        if not gone:
            break
        faces = renamed(faces, names)
        if gone < surplus:
            around = _around(faces, len(points))
    points = state.points * scale + (low + high) / 2
    made = replace(
        mesh,
        vertices=points.astype(np.float32),
        faces=faces.astype(np.uint32),
        **unpacked(mesh, state.packs),
    )
    return faces_kept(made, np.ones(len(faces), bool))


def _start(
    points: NDArray[np.float64], faces: Ints, packs: NDArray[np.float32], boundary: str
) -> tuple[State, Around]:
    """The mesh as the rounds change it, and what meets what in it."""
    around = _around(faces, len(points))
    kinds = np.array([INSIDE, INSIDE, _KINDS[boundary], LOCKED], np.uint8)
    normals = np.zeros_like(points)
    quadrics = face_quadrics(points, faces, _FLOOR * mean_area(points, faces), normals)
    add_folds(quadrics, points, *around[:2], normals)
    share_places(quadrics, points, around[2])
    if boundary == "simplified":
        add_borders(quadrics, points, *around)
    return State(points, quadrics, packs, kinds[fans(*around[:2])]), around


def _around(faces: Ints, count: int) -> Around:
    pairs = vertex_pairs(faces, count)
    return (*pairs, *edge_table(*pairs)[:2])


def _round(
    around: Around,
    surplus: int,
    left: int,
    shape: float,
    state: State,
    limit: float,
    progress: Progress,
) -> tuple[NDArray[np.int32], int]:
    """New names of the vertices after a round that takes at most `surplus` of the `left` faces;
    how many went."""
    starts, pairs, ends, uses = around
    costs = np.empty(len(ends), np.float32)

    def cost(first: int) -> None:
        last = min(first + _RANGE, len(ends))
        edge_costs(first, last, ends, uses, state, limit, costs)

    with ThreadPoolExecutor(_THREADS) as pool:
        for _ in pool.map(cost, range(0, len(ends), _RANGE)):
            progress()
    work = Round.of(len(state.points), int(np.diff(starts).max()))
    gone, tick = 0, 0
    for share, sliver in ((_SHARE, shape), (1.0, 0.0)):
        # a round takes at most every other vertex, and so half of the faces, about
        chosen = cheapest(costs, share, _RUN if 2 * surplus >= left else len(costs))
        for first in range(0, len(chosen), _RANGE):
            some = chosen[first : first + _RANGE]
            at = (surplus - gone, sliver, tick)
            gone += collapse(some, *at, (starts, pairs), (ends, uses), state, work)
            tick += len(some)
            progress()
        if gone >= _WORTH * surplus:
            break
    return work.names, gone
