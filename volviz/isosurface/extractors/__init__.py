"""What to build in a cell: one extractor per file, one row here."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from volviz.isosurface.extractors import marching_cubes
from volviz.model.mesh import Mesh


@dataclass(frozen=True)
class Row:
    """A way to build a surface. knobs: the fields of `model.surface.Surface` that it takes.

    guarantee: what it promises, for people.
    """

    extract: Callable[..., Mesh]
    knobs: tuple[str, ...]
    guarantee: str


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
    ),
}
