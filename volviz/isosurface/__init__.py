"""Surfaces where a grid crosses an isovalue: finders say which cells, extractors what is in them.

Any finder feeds any extractor that works cell by cell, and every pair gives the same mesh as
looking at all cells. Kernels are compiled on first use (`warm.py` does it ahead, on a thread).
"""

from __future__ import annotations

from dataclasses import fields
from typing import Any
from weakref import WeakKeyDictionary

from volviz.errors import UsageError, did_you_mean
from volviz.isosurface.cells import CellRanges
from volviz.isosurface.extractors import EXTRACTORS
from volviz.isosurface.finder import Finder
from volviz.isosurface.finders import FINDERS
from volviz.isosurface.finders.bricks import Bricks
from volviz.model.mesh import Mesh
from volviz.model.surface import Surface
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

_finders: WeakKeyDictionary[Volume, dict[str, Finder | None]] = WeakKeyDictionary()


def extract_surface(
    volume: Volume, isovalue: float, *, progress: Progress | None = None, **knobs: Any
) -> Mesh:
    """The surface where the volume crosses an isovalue.

    knobs: fields of `volviz.Surface`, such as method (a key of EXTRACTORS), finder (a key of
    FINDERS), ambiguity and normals. The mesh is in world mm; it is empty where the volume has no
    such value. What a finder builds is kept with the volume. Raises UsageError for unknown names
    and an isovalue that is not finite, LimitError for a surface too large to be numbered,
    Cancelled.
    """
    return extract(volume, surface_of(isovalue, **knobs), progress)


def surface_of(isovalue: float, **knobs: Any) -> Surface:
    """A `Surface` of these knobs; UsageError with the nearest name for one that there is not."""
    names = [f.name for f in fields(Surface)]
    for name in knobs:
        if name not in names:
            raise UsageError(
                f"a surface has no knob '{name}'", field=name, fix=did_you_mean(name, names)
            )
    return Surface(isovalue=isovalue, **knobs)


def extract(volume: Volume, surface: Surface, progress: Progress | None = None) -> Mesh:
    """The mesh of a surface's knobs."""
    if not isinstance(volume, Volume):
        raise UsageError(f"a surface needs a Volume, not {type(volume).__name__}", field="volume")
    report = progress or silent()
    row = EXTRACTORS[surface.method]
    knobs = {name: getattr(surface, name) for name in row.knobs}
    cells = None
    known = finder_of(volume, surface.finder, report.part(0, 0.2))
    if isinstance(known, Bricks) and row.by_word:
        knobs["rows"] = known.rows
    elif known is not None:
        cells = known(surface.isovalue, report.part(0.2, 0.3))
    return row.extract(volume, surface.isovalue, cells, progress=report.part(0.3, 1), **knobs)


def finder_of(volume: Volume, name: str, progress: Progress | None = None) -> Finder | None:
    """The finder of this name, kept with the volume; None where looking at all cells is quicker.

    That is so for "bricks" in a volume that is looked at for the first time: the ranges of the
    bricks cost as much as the signs of all samples. They pay from the second isovalue on.
    """
    kept = _finders.setdefault(volume, {})
    if name == "bricks" and name not in kept:
        kept[name] = None
        return None
    if kept.get(name) is None:
        kept[name] = FINDERS[name].build(CellRanges.of(volume), progress)
    return kept[name]
