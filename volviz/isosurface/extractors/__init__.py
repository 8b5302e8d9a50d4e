"""What to build in a cell: one extractor per file, one row here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from volviz.isosurface.extractors import (
    contour_tracing,
    cuberille,
    discretized_marching_cubes,
    dividing_cubes,
    marching_cubes,
    marching_tetrahedra,
)
from volviz.model.mesh import Mesh


@dataclass(frozen=True)
class Row:
    """A way to build a surface. knobs: the fields of `model.surface.Surface` that it takes.

    guarantee: what it promises, for people. by_cell: it works cell by cell, so that a finder helps;
    otherwise the ids of cells are not used. tetrahedra: it takes a `TetMesh` as well. by_word: it
    also takes rows=, `Bricks.rows`.
    """

    extract: Callable[..., Mesh]
    knobs: tuple[str, ...]
    guarantee: str
    by_cell: bool = True
    tetrahedra: bool = False
    by_word: bool = False


EXTRACTORS: dict[str, Row] = {
    "marching-cubes": Row(
        marching_cubes.extract,
        ("ambiguity", "normals"),
        "Vertices lie on the crossed edges of the grid, where linear interpolation has the "
        "isovalue, each shared by the triangles round it. The mesh is a manifold, closed but for "
        "the border of the volume and of cells that are not valid, and wound so that normals "
        "point to lower values. With ambiguity trilinear it has the components, handles and "
        "tubes of the trilinear function in every cell; with asymptotic its faces decide and "
        "tubes are cut; with table15 it may have holes. A sample equal to the isovalue counts as "
        "inside everywhere; triangles next to it may have no area, so that the mesh stays closed.",
        by_word=True,
    ),
    "marching-tetrahedra": Row(
        marching_tetrahedra.extract,
        ("tetrahedra",),
        "Exactly the surface of the function that is linear in each of the 5 or 6 tetrahedra of a "
        "cell: a manifold, closed but for the border of the volume and of cells that are not "
        "valid, its vertices shared and on edges of tetrahedra, wound so that normals point to "
        "lower values. No case is ambiguous, but which tetrahedra there are decides the topology "
        "inside cells, which may differ from the trilinear function's. About 2.5 (5) or 3 (6) "
        "times the triangles of marching cubes.",
        tetrahedra=True,
    ),
    "cuberille": Row(
        cuberille.extract,
        ("size", "normals"),
        "Exactly the faces between voxels inside and outside, two triangles each (of the voxels, "
        "or of finer ones resampled near the surface): a manifold, closed but for the border of "
        "the volume and of cells that are not valid, with the Euler characteristic of the solid "
        "whose voxels are joined by faces only, those outside by faces and edges. Its volume "
        "converges to the true one, its area does not. Normals are those of the volume's gradient "
        "at the vertices and point to lower values.",
    ),
    "dividing-cubes": Row(
        dividing_cubes.extract,
        ("size", "normals"),
        "Points without faces, one in each part of a cell with corners on both sides: where the "
        "trilinear function is the isovalue, down the slope from the part's middle and never out "
        "of the part. To a smooth surface they come with the square of the spacing. Normals are "
        "interpolated there from those of the samples and point to lower values.",
    ),
    "discretized-marching-cubes": Row(
        discretized_marching_cubes.extract,
        (),
        "The surface of marching cubes (ambiguity asymptotic, with its manifold and its topology) "
        "with vertices in the middle of edges and cells only, and its coplanar triangles merged: "
        "fewer triangles, at most half a cell's diagonal from marching cubes. Its area and its "
        "normals do not converge to the true ones.",
    ),
    "contour-tracing": Row(
        contour_tracing.extract,
        ("axis",),
        "A closed surface through the contours of every slice, wound so that normals point to "
        "lower values, capped half a slice beyond the last ones, also at the border of the volume "
        "and of samples that are not valid. Every edge is used twice. It branches and has handles "
        "and components as the trilinear function; what touches at a sample is linked. One "
        "contour with one contour is tiled with the least area, which may cut neighbours where "
        "the two are far from alike; branches lie over what changes from slice to slice. "
        "Finders do not help it.",
        by_cell=False,
    ),
}
