"""Surfaces where a grid crosses an isovalue: finders say which cells, extractors what is in them.

Any finder feeds any extractor that works cell by cell, and every pair gives the same mesh as
looking at all cells. Kernels are compiled on first use (`warm.py` does it ahead, on a thread).
"""

from __future__ import annotations

import threading
from copy import copy
from dataclasses import fields
from typing import Any
from weakref import WeakKeyDictionary

import numpy as np

from volviz.errors import LimitError, UsageError, did_you_mean
from volviz.fields.pyramid import level_of
from volviz.isosurface import adaptive, hierarchy
from volviz.isosurface.by_view import knobs_by_view
from volviz.isosurface.cells import CellRanges, Grid
from volviz.isosurface.extractors import EXTRACTORS
from volviz.isosurface.finder import Finder
from volviz.isosurface.finders import FINDERS
from volviz.isosurface.finders.bricks import Bricks
from volviz.model.grids import TetMesh
from volviz.model.lens import SeenSurface
from volviz.model.mesh import Mesh
from volviz.model.surface import Surface
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

_building = threading.Lock()
UNSTRUCTURED = "marching-tetrahedra"
"""What tetrahedra are cut by if nothing else is said."""
ELSEWHERE = {
    "spacing": "it is the volume's: volviz.Volume.from_array(array, spacing=(x, y, z))",
    "origin": "it is the volume's: volviz.Volume.from_array(array, origin=(x, y, z))",
    "affine": "it is the volume's: volviz.Volume.from_array(array, affine=…)",
    "mask": "make samples that do not count NaN, or the padding of the volume",
    "step_size": "level=1 takes every other sample, averaged",
    "gradient_direction": "volviz.meshes.normals.turned(mesh) turns a surface inside out",
    "allow_degenerate": "volviz.meshes.weld.weld(mesh, 1e-6) merges what has no area",
}
"""What others call knobs of a surface, and where that is here."""
_finders: WeakKeyDictionary[Grid, dict[str, Finder | None]] = WeakKeyDictionary()


def extract_surface(
    volume: Grid, isovalue: float, *, progress: Progress | None = None, **knobs: Any
) -> Mesh:
    """The surface where a volume, or a `volviz.TetMesh`, crosses an isovalue.

    knobs: fields of `volviz.Surface`, such as method (a key of EXTRACTORS; tetrahedra have
    marching-tetrahedra, other grids marching-cubes unless another is given), finder (a key of
    FINDERS), ambiguity and normals. The mesh is in world mm; it is empty where the volume has no
    such value. What a finder builds is kept with the volume. Raises UsageError for unknown names,
    a method that is not made for tetrahedra, and an isovalue that is not finite, LimitError for a
    surface too large to be numbered or of values too far apart for 64 bits, Cancelled.
    """
    if isinstance(volume, TetMesh):
        knobs = {"method": UNSTRUCTURED, **knobs}
    return extract(volume, surface_of(isovalue, **knobs), progress)


def surface_of(isovalue: float, **knobs: Any) -> Surface:
    """A `Surface` of these knobs; UsageError with the nearest name for one that there is not."""
    names = [f.name for f in fields(Surface)]
    for name in knobs:
        if name not in names:
            fix = ELSEWHERE.get(name) or did_you_mean(name, names)
            raise UsageError(f"a surface has no knob '{name}'", field=name, fix=fix)
    return Surface(isovalue=isovalue, **knobs)


def extract(volume: Grid, surface: Surface, progress: Progress | None = None) -> Mesh:
    """The mesh of a surface's knobs; of a `SeenSurface`, the one that its picture needs."""
    if not isinstance(volume, Volume | TetMesh):
        raise UsageError(
            f"a surface needs a Volume or a TetMesh, not {type(volume).__name__}",
            field="volume",
            fix="use volviz.load(path) or volviz.Volume.from_array(array)",
        )
    report = progress or silent()
    row = EXTRACTORS[surface.method]
    if isinstance(volume, Volume):
        if isinstance(surface, SeenSurface) and adaptive.under_lens(surface):
            return adaptive.extract(volume, surface, report).mesh
        if surface.level_pixels:
            return hierarchy.chosen(volume, surface, report)
        if surface.level:
            volume = level_of(volume, surface.level, report.part(0, 0.2))
            report = report.part(0.2, 1)
    elif not row.tetrahedra:
        raise UsageError(
            f"{surface.method} needs the regular grid of a Volume, this is a TetMesh",
            field="method",
            fix=f"use method='{UNSTRUCTURED}'",
        )
    elif surface.level or surface.level_pixels:
        raise UsageError("levels are of a Volume, this is a TetMesh", field="level")
    knobs = {name: getattr(surface, name) for name in row.knobs} | knobs_by_view(volume, surface)
    cells = None
    known = finder_of(volume, surface.finder, report.part(0, 0.2))
    if isinstance(known, Bricks) and row.by_word:
        knobs["rows"] = known.rows
    elif known is not None:
        cells = known(surface.isovalue, report.part(0.2, 0.3))
    with np.errstate(over="ignore", invalid="ignore"):
        mesh = row.extract(volume, surface.isovalue, cells, progress=report.part(0.3, 1), **knobs)
    dtype = volume.values.dtype if isinstance(volume, TetMesh) else volume.data.dtype
    if dtype.itemsize == 8 and not np.isfinite(mesh.vertices).all():
        raise LimitError(
            "values of the volume differ by more than 64 bits can hold", fix="scale them down"
        )
    return mesh


def finder_of(volume: Grid, name: str, progress: Progress | None = None) -> Finder | None:
    """The finder of this name, kept with the volume; None where looking at all cells is quicker.

    That is so for "bricks" in a volume that is looked at for the first time: the ranges of the
    bricks cost as much as the signs of all samples. They pay from the second isovalue on. Of the
    finders beyond bricks only the last one asked for is kept: a tree is many times as large as
    its volume.
    """
    kept = _finders.setdefault(volume, {})
    if name == "bricks" and name not in kept:
        kept[name] = None
        return None
    return built_finder(volume, name, progress)


def built_finder(volume: Grid, name: str, progress: Progress | None = None) -> Finder:
    """The finder of this name, kept with the volume, also where looking at all cells is quicker.

    Two threads that want the same one wait for each other. Raises Cancelled.
    """
    report = progress or silent()
    while not _building.acquire(timeout=0.1):
        report(None, "waiting for another finder")
    try:
        kept = _finders.setdefault(volume, {})
        found = kept.get(name)
        if found is None:
            for other in kept.keys() - {name, "bricks"}:
                del kept[other]
            # of a copy: what holds the volume itself would keep it alive for ever
            found = kept[name] = FINDERS[name].build(CellRanges.of(copy(volume)), report)
        return found
    finally:
        _building.release()
