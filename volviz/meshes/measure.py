"""What a mesh is: sizes in mm, mm² and mm³, and its topology, as a report."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.meshes.adjacency import (
    Edges,
    Ints,
    edge_table,
    fans,
    joined,
    proper_faces,
    vertex_pairs,
)
from volviz.meshes.components import components
from volviz.model.mesh import Mesh
from volviz.progress import Progress, silent

LISTED = 100
"""Components that a report lists one by one, the largest."""


@dataclass(frozen=True)
class Component:
    """One connected part. volume: mm³, signed (negative: a cavity, or inside out), None unless
    closed. genus: handles, None where it is no orientable manifold."""

    triangles: int
    vertices: int
    area: float
    volume: float | None
    closed: bool
    euler: int
    boundary_loops: int
    genus: int | None


@dataclass(frozen=True)
class MeshReport:
    """Counts, mm, mm², mm³. Euler characteristic and genus are of the faces with three corners
    and their vertices. closed: every edge is walked as often one way as the other, so that there
    is an inside; else volume is None. genus: the sum, None if one component has none. low, high:
    corners of the bounding box, None if empty. parts: the largest components, by area."""

    vertices: int
    triangles: int
    unused_vertices: int
    area: float
    volume: float | None
    closed: bool
    components: int
    euler: int
    genus: int | None
    boundary_edges: int
    boundary_loops: int
    non_manifold_edges: int
    non_manifold_vertices: int
    inconsistent_edges: int
    duplicate_faces: int
    degenerate_faces: int
    low: tuple[float, ...] | None
    high: tuple[float, ...] | None
    space: str | None
    skipped_cells: int
    parts: tuple[Component, ...]

    def as_dict(self) -> dict[str, Any]:
        """JSON-ready, the names with their units."""
        units = {"area": "area_mm2", "volume": "volume_mm3", "low": "low_mm", "high": "high_mm"}
        facts = {units.get(k, k): v for k, v in asdict(self).items()}
        facts["parts"] = [{units.get(k, k): v for k, v in p.items()} for p in facts["parts"]]
        return facts


def measure(mesh: Mesh, progress: Progress | None = None) -> MeshReport:
    """The report of a mesh. Areas and volumes are summed in float64 about its middle.

    Raises Cancelled.
    """
    report = progress or silent()
    report(0.0, "measuring")
    faces = proper_faces(mesh)
    count = len(mesh.vertices)
    pairs = vertex_pairs(faces, count)
    edges = Edges(*edge_table(*pairs))
    report(0.3, "measuring")
    kinds = fans(*pairs)
    report(0.5, "measuring")
    areas, volumes = _sizes(mesh, faces)
    report(0.6, "measuring")
    parts = _parts(mesh, faces, edges, kinds, areas, volumes)
    report(0.8, "measuring")
    closed = bool(len(faces)) and not edges.balance.any()
    genera = [p.genus for p in parts]
    bounds = None if mesh.empty else mesh.bounds.tolist()
    order = sorted(range(len(parts)), key=lambda i: -parts[i].area)[:LISTED]
    return MeshReport(
        vertices=count,
        triangles=len(mesh.faces),
        unused_vertices=count - len(np.unique(mesh.faces)),
        area=float(areas.sum()),
        volume=float(volumes.sum()) if closed else None,
        closed=closed,
        components=len(parts),
        euler=sum(p.euler for p in parts),
        genus=None if None in genera else sum(g for g in genera if g is not None),
        boundary_edges=int((edges.uses == 1).sum()),
        boundary_loops=sum(p.boundary_loops for p in parts),
        non_manifold_edges=int((edges.uses > 2).sum()),
        non_manifold_vertices=int((kinds == 3).sum()),
        inconsistent_edges=int(((edges.uses == 2) & (edges.balance != 0)).sum()),
        duplicate_faces=_duplicates(mesh),
        degenerate_faces=len(mesh.faces) - len(faces) + int((areas == 0).sum()),
        low=None if bounds is None else tuple(bounds[0]),
        high=None if bounds is None else tuple(bounds[1]),
        space=mesh.space,
        skipped_cells=mesh.skipped,
        parts=tuple(parts[i] for i in order),
    )


def _sizes(mesh: Mesh, faces: Ints) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Area and signed volume (of the tetrahedron with the mesh's middle) of each face."""
    if not len(faces):
        return np.zeros(0), np.zeros(0)
    points = mesh.vertices.astype(np.float64) - mesh.bounds.mean(axis=0)
    a, b, c = points[faces[:, 0]], points[faces[:, 1]], points[faces[:, 2]]
    cross = np.cross(b - a, c - a)
    return np.linalg.norm(cross, axis=1) / 2, (a * cross).sum(axis=1) / 6


def _parts(
    mesh: Mesh,
    faces: Ints,
    edges: Edges,
    kinds: NDArray[np.uint8],
    areas: NDArray[np.float64],
    volumes: NDArray[np.float64],
) -> list[Component]:
    """Every component, in the order of their first vertices."""
    if not len(faces):
        return []
    proper = Mesh(mesh.vertices, faces.astype(np.uint32))
    labels, count = components(proper)
    of_vertex = np.zeros(len(mesh.vertices), np.int32)
    of_vertex[faces] = labels[:, None]
    of_edge = of_vertex[edges.ends[:, 0]]

    def per_part(where: NDArray[Any], weights: Any = None) -> list[Any]:
        return np.bincount(where, weights, count).tolist()

    sums = zip(
        per_part(labels),
        per_part(of_vertex[kinds > 0]),
        per_part(of_edge),
        per_part(labels, areas),
        per_part(labels, volumes),
        per_part(of_edge[edges.balance != 0]),
        per_part(of_edge[(edges.uses == 2) & (edges.balance != 0)]),
        per_part(of_vertex[kinds == 3]),
        per_part(_loops(edges, of_vertex)),
        strict=True,
    )
    made = []
    for triangles, vertices, lines, area, volume, open_, one_sided, bad, loops in sums:
        euler = vertices - lines + triangles
        manifold = not bad and not one_sided
        genus = (2 - euler - loops) // 2 if manifold else None
        enclosed = volume if not open_ else None
        made.append(Component(triangles, vertices, area, enclosed, not open_, euler, loops, genus))
    return made


def _loops(edges: Edges, of_vertex: Ints) -> Ints:
    """The component of each boundary loop: what hangs together of the edges with one face."""
    ends = edges.ends[edges.uses == 1]
    roots = joined(ends, len(of_vertex))
    return of_vertex[np.unique(roots[ends])]


def _duplicates(mesh: Mesh) -> int:
    """Faces that are there before with the same corners, in whatever order."""
    if not len(mesh.faces):
        return 0
    a, b, c = np.sort(mesh.faces, axis=1).T.astype(np.uint64)
    order = np.lexsort((c, a << np.uint64(32) | b))
    key, last = (a << np.uint64(32) | b)[order], c[order]
    return int(((key[1:] == key[:-1]) & (last[1:] == last[:-1])).sum())
