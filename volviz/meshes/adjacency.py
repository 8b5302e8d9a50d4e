"""Who meets whom in a triangle mesh: faces around vertices, edges and their faces, components."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volviz.compiled import inline, kernel
from volviz.model.mesh import Mesh

Ints = NDArray[np.int32]
FEW = 16  # faces around a vertex up to which comparing all is quicker than marking


class Edges(NamedTuple):
    """Undirected edges. ends: int32[e, 2], the lower vertex first. uses: int32[e], faces at the
    edge. balance: int32[e], faces that walk it from the lower vertex to the higher less those
    that walk it back; 0 where neighbours agree which side is out."""

    ends: Ints
    uses: Ints
    balance: Ints


def proper_faces(mesh: Mesh) -> Ints:
    """int32[m, 3]: the faces whose corners are three vertices."""
    faces = mesh.faces.astype(np.int32)
    a, b, c = faces.T
    good = (a != b) & (b != c) & (c != a)
    return faces if good.all() else np.ascontiguousarray(faces[good])


def edges_of(faces: Ints, count: int) -> Edges:
    """The edges of proper faces, int32[m, 3], of `count` vertices; sorted by their lower end."""
    return Edges(*edge_table(*vertex_pairs(faces, count)))


@inline
def _starts(faces: Any, count: int) -> Any:
    """Where what is round each vertex begins, one entry per corner: int32[count + 1]."""
    starts = np.zeros(count + 1, np.int32)
    for f in range(faces.shape[0]):
        for k in range(3):
            starts[faces[f, k] + 1] += 1
    for v in range(count):
        starts[v + 1] += starts[v]
    return starts


@kernel
def vertex_faces(faces: Any, count: int) -> Any:
    """Faces around each vertex: members[starts[v] : starts[v + 1]], in the order of the faces."""
    starts = _starts(faces, count)
    place = starts[:-1].copy()
    members = np.empty(3 * faces.shape[0], np.int32)
    for f in range(faces.shape[0]):
        for k in range(3):
            v = faces[f, k]
            members[place[v]] = f
            place[v] += 1
    return starts, members


@kernel
def vertex_pairs(faces: Any, count: int) -> Any:
    """What is across from each vertex, starts and pairs: int32[count + 1] and int32[3m, 2].

    pairs[starts[v] : starts[v + 1]] are the two other corners of each face around v, in the
    order in which the face has them.
    """
    starts = _starts(faces, count)
    place = starts[:-1].copy()
    pairs = np.empty((3 * faces.shape[0], 2), np.int32)
    for f in range(faces.shape[0]):
        a, b, c = faces[f, 0], faces[f, 1], faces[f, 2]
        i, j, k = place[a], place[b], place[c]
        place[a], place[b], place[c] = i + 1, j + 1, k + 1
        pairs[i, 0], pairs[i, 1] = b, c
        pairs[j, 0], pairs[j, 1] = c, a
        pairs[k, 0], pairs[k, 1] = a, b
    return starts, pairs


@kernel
def edge_table(starts: Any, pairs: Any) -> Any:
    """ends, uses and balance of every edge (see Edges)."""
    ends = np.empty((pairs.shape[0], 2), np.int32)
    uses = np.empty(pairs.shape[0], np.int32)
    balance = np.empty(pairs.shape[0], np.int32)
    slot = np.full(starts.size - 1, -1, np.int32)  # of the edge between u and w, if >= first
    total = 0
    for u in range(starts.size - 1):
        first = total
        for i in range(starts[u], starts[u + 1]):
            for k in range(2):
                w = pairs[i, k]
                if w <= u:
                    continue
                e = slot[w]
                if e < first:
                    e = slot[w] = total
                    ends[e, 0], ends[e, 1] = u, w
                    uses[e], balance[e] = 0, 0
                    total += 1
                uses[e] += 1
                balance[e] += 1 - 2 * k
    return ends[:total], uses[:total], balance[:total]


@inline
def find(parent: Any, i: int) -> int:
    """The root of i's tree, with the way to it halved."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@kernel
def joined(pairs: Any, count: int) -> Any:
    """int32[count]: the least member of the component of each of `count` things in pairs."""
    parent = np.arange(count).astype(np.int32)
    for i in range(pairs.shape[0]):
        a, b = find(parent, pairs[i, 0]), find(parent, pairs[i, 1])
        if a != b:
            parent[max(a, b)] = min(a, b)
    for v in range(count):
        parent[v] = find(parent, v)
    return parent


@kernel
def fans(starts: Any, pairs: Any) -> Any:
    """uint8[count]: what the faces around a vertex are (`vertex_pairs`).

    0: no face; 1: one closed fan; 2: one open fan, the vertex is on a boundary; 3: anything else
    (several fans, or an edge at it with more than two faces).
    """
    count = starts.size - 1
    kind = np.zeros(count, np.uint8)
    stamp = np.full(count, -1, np.int32)
    slot = np.empty(count, np.int32)
    most = 0
    for v in range(count):
        most = max(most, starts[v + 1] - starts[v])
    parent = np.empty(2 * most, np.int32)
    uses = np.empty(2 * most, np.int32)
    for v in range(count):
        around = pairs[starts[v] : starts[v + 1]]
        if 0 < around.shape[0] <= FEW and _closed(around):
            kind[v] = 1
        elif around.shape[0] > 0:
            kind[v] = _fan(v, around, stamp, slot, parent, uses)
    return kind


@inline
def _closed(around: Any) -> bool:
    """True if every second corner is the first of one other face, all in one ring.

    A first corner that there is twice is found once, and the ring is too short.
    """
    at = around[0, 1]
    steps = 1
    while at != around[0, 0]:
        i = 1
        while i < around.shape[0] and around[i, 0] != at:
            i += 1
        if i == around.shape[0]:
            return False
        at = around[i, 1]
        steps += 1
        if steps > around.shape[0]:
            return False
    return steps == around.shape[0]


@inline
def _fan(v: int, around: Any, stamp: Any, slot: Any, parent: Any, uses: Any) -> int:
    """The kind of one vertex: its link is a cycle, a path, or neither."""
    nodes, parts = 0, 0
    for i in range(around.shape[0]):
        for k in range(2):
            w = around[i, k]
            if stamp[w] != v:
                stamp[w], slot[w] = v, nodes
                parent[nodes], uses[nodes] = nodes, 0
                nodes += 1
                parts += 1
            uses[slot[w]] += 1
        a, b = find(parent, slot[around[i, 0]]), find(parent, slot[around[i, 1]])
        if a != b:
            parent[a] = b
            parts -= 1
    ends = 0
    for i in range(nodes):
        if uses[i] > 2:
            return 3
        ends += uses[i] == 1
    if parts > 1:
        return 3
    return 2 if ends else 1
