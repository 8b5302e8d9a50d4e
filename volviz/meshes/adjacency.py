"""Who meets whom in a triangle mesh: faces around vertices, edges and their faces, components."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from volviz.compiled import inline, kernel
from volviz.model.mesh import Mesh

Ints = NDArray[np.int32]


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
    starts, members = vertex_faces(faces, count)
    ends, uses, balance = edge_table(faces, starts, members)
    return Edges(ends, uses, balance)


@kernel
def vertex_faces(faces: Any, count: int) -> Any:
    """Faces around each vertex: members[starts[v] : starts[v + 1]], in the order of the faces."""
    starts = np.zeros(count + 1, np.int32)
    for f in range(faces.shape[0]):
        for k in range(3):
            starts[faces[f, k] + 1] += 1
    for v in range(count):
        starts[v + 1] += starts[v]
    place = starts[:-1].copy()
    members = np.empty(3 * faces.shape[0], np.int32)
    for f in range(faces.shape[0]):
        for k in range(3):
            v = faces[f, k]
            members[place[v]] = f
            place[v] += 1
    return starts, members


@kernel
def edge_table(faces: Any, starts: Any, members: Any) -> Any:
    """ends, uses and balance of every edge (see Edges)."""
    count = starts.size - 1
    ends = np.empty((3 * faces.shape[0], 2), np.int32)
    uses = np.empty(3 * faces.shape[0], np.int32)
    balance = np.empty(3 * faces.shape[0], np.int32)
    stamp = np.full(count, -1, np.int32)
    slot = np.empty(count, np.int32)
    total = 0
    for u in range(count):
        for i in range(starts[u], starts[u + 1]):
            f = members[i]
            for k in range(3):
                w = faces[f, k]
                if w <= u:
                    continue
                if stamp[w] != u:
                    stamp[w], slot[w] = u, total
                    ends[total, 0], ends[total, 1] = u, w
                    uses[total], balance[total] = 0, 0
                    total += 1
                uses[slot[w]] += 1
                balance[slot[w]] += 1 if faces[f, k - 1] == u else -1
    return ends[:total].copy(), uses[:total].copy(), balance[:total].copy()


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
def fans(faces: Any, starts: Any, members: Any) -> Any:
    """uint8[count]: what the faces around a vertex are.

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
        first, last = starts[v], starts[v + 1]
        if last > first:
            kind[v] = _fan(v, faces, members[first:last], stamp, slot, parent, uses)
    return kind


@inline
def _fan(v: int, faces: Any, around: Any, stamp: Any, slot: Any, parent: Any, uses: Any) -> int:
    """The kind of one vertex: its link is a cycle, a path, or neither."""
    nodes, parts = 0, 0
    for f in around:
        pair = -1
        for k in range(3):
            w = faces[f, k]
            if w == v:
                continue
            if stamp[w] != v:
                stamp[w], slot[w] = v, nodes
                parent[nodes], uses[nodes] = nodes, 0
                nodes += 1
                parts += 1
            uses[slot[w]] += 1
            if pair < 0:
                pair = slot[w]
            else:
                a, b = find(parent, pair), find(parent, slot[w])
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
