"""Marching cubes on the volume's own grid: two triangles here, five there, one surface.

Lorensen and Cline 1987, with our own cases (`cases.py`), bits instead of bytes (`signs.py`) and
the topology of the trilinear function (`ambiguity.py`).
"""

from __future__ import annotations

from functools import partial

import numpy as np
from numpy.typing import NDArray

from volviz.isosurface import marching, memory
from volviz.isosurface.ambiguity import RULES
from volviz.isosurface.cases import cases
from volviz.isosurface.classified import Ids, Rows, checked, classify, count_rows, placing
from volviz.isosurface.edges import vertices
from volviz.isosurface.kernel import threshold
from volviz.isosurface.plain import plain
from volviz.isosurface.samples import samples
from volviz.isosurface.triangles import triangles
from volviz.isosurface.turns import in_turns
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.progress import Progress, silent


def extract(
    volume: Volume,
    isovalue: float,
    cells: Ids | None = None,
    *,
    ambiguity: str = "trilinear",
    normals: str = "central",
    part: bool = False,
    rows: Rows | None = None,
    progress: Progress | None = None,
) -> Mesh:
    """The surface where the trilinear volume crosses the isovalue.

    cells: sorted ids of cells among which are all active ones, as a finder gives them; the mesh
    is the same, bit for bit, as with None, which looks at every cell. part: the cells are only
    some of them, and the surface ends where they do. ambiguity: a key of `ambiguity.RULES`.
    normals: a key of `slopes.OPERATORS`. Memory beyond the mesh: a bit per sample (two more,
    kept with the volume, where some sample is not valid, one more for a part) and 44 bytes per
    row. rows: `Bricks.rows` instead of cells. Raises UsageError for
    cells that are not there, LimitError where 32 bits do not number the vertices, Cancelled.
    """
    report = progress or silent()
    limit = threshold(volume.data.dtype, isovalue)
    if limit is None or min(volume.data.shape) < 2:
        return Mesh(np.empty((0, 3), np.float32), space=volume.info.space)
    ids = checked(cells, volume.data.shape)
    found = classify(volume, limit, ids, part, rows, report.part(0, 0.3))
    rule = RULES[ambiguity]
    bits = (found.signs, found.mask, found.valid)
    field = marching.Field(samples(volume.data), float(isovalue), *bits, rule)
    layout = count_rows(field, found, report.part(0.3, 0.5))
    arrays = _build(field, placing(volume, normals), layout, report.part(0.5, 1))
    found.scratch.give_back()
    return Mesh.of_right_arrays(*arrays, space=volume.info.space, skipped=found.skipped)


def _build(
    field: marching.Field, place: marching.Placing, layout: marching.Layout, report: Progress
) -> tuple[NDArray[np.float32], NDArray[np.uint32], NDArray[np.float32]]:
    rows, nx = len(layout.rows), field.data.shape[2]
    count = int(layout.vertices[-1])
    points, normals, faces = memory.empty(
        ((count, 3), np.float32),
        ((count if place.operator >= 0 else 0, 3), np.float32),
        ((int(layout.triangles[-1]), 3), np.uint32),
    )
    first = partial(vertices, field, place, layout)
    pair, out = (points, normals), (points, normals, faces)
    part = report.part(0, 0.5)
    in_turns(lambda turns, most: first(turns, most, pair), rows, nx, part, "vertices")
    second = partial(triangles, field, cases(), plain(), place, layout)
    part = report.part(0.5, 1)
    in_turns(lambda turns, most: second(turns, most, out), rows, nx, part, "triangles")
    return points, faces, normals
