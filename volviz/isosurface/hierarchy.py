"""One surface at all resolutions of its volume, each with its measured error.

Every level of the pyramid (`fields/pyramid.py`) is extracted like the volume itself, by any
method, and measured against the finest, both ways. The pyramid's means lose what is small, so
the errors, unlike those of a decimated mesh, are not bounded by the size of a cell: an island that
a level does not have any more is as far away as the nearest one that it has.
"""

from __future__ import annotations

from dataclasses import fields
from weakref import WeakKeyDictionary

import numpy as np

from volviz.errors import UsageError
from volviz.fields.pyramid import depth, level_of
from volviz.meshes.distance import two_sided
from volviz.model.lens import SeenSurface
from volviz.model.levels import Level, choose
from volviz.model.mesh import Mesh
from volviz.model.surface import Surface
from volviz.model.volume import Volume
from volviz.progress import Progress, silent

MOST = 6
KEPT = 2
"""Surfaces of a volume whose levels are kept: the one before is a slider's way back."""
_known: WeakKeyDictionary[Volume, dict[Surface, tuple[Level, ...]]] = WeakKeyDictionary()


def hierarchy(
    volume: Volume, surface: Surface, *, most: int = MOST, progress: Progress | None = None
) -> tuple[Level, ...]:
    """The surface at every level, finest first, until one is empty; the errors grow.

    The error of a level is its two-sided distance to the finest in mm, and no sample of either
    surface can be farther: the distance that `meshes.distance` measures at samples, and as much as
    a point may be away from the nearest sample. Levels of points (dividing cubes) end with the
    first. Raises Cancelled.
    """
    report = progress or silent()
    plain = _of_level(surface, 0)
    kept = _known.setdefault(volume, {})
    if plain not in kept:
        made = _made(volume, plain, min(most, depth(volume) + 1), report)
        while len(kept) >= KEPT:
            del kept[next(iter(kept))]
        kept[plain] = made
    return kept[plain][:most]


def chosen(volume: Volume, surface: Surface, progress: Progress | None = None) -> Mesh:
    """The coarsest level of a `SeenSurface` whose error is at most `level_pixels` in its picture.

    Raises UsageError for a surface of no picture, Cancelled.
    """
    viewing = surface.viewing if isinstance(surface, SeenSurface) else None
    if viewing is None:
        raise UsageError(
            "a level by pixels needs a camera", field="--level-pixels", fix="give --level"
        )
    levels = hierarchy(volume, surface, progress=progress)
    best = choose(levels, viewing.camera, viewing.size, surface.level_pixels)
    return levels[best].mesh


def _made(volume: Volume, plain: Surface, most: int, report: Progress) -> tuple[Level, ...]:
    from volviz.isosurface import extract  # which asks us for levels by pixels

    finest = extract(volume, plain, report.part(0.0, 0.2))
    levels = [Level(finest, 0.0)]
    while len(levels) < most and len(finest.faces):
        share = report.part(0.2 + 0.8 * len(levels) / most, 0.2 + 0.8 * (len(levels) + 1) / most)
        coarser = level_of(volume, len(levels), share.part(0.0, 0.2))
        mesh = extract(coarser, plain, share.part(0.2, 0.4))
        if not len(mesh.faces):
            break
        step = _edge(finest)
        apart = two_sided(mesh, finest, step=step, progress=share.part(0.4, 1.0))
        # the middle of a triangle is at most 2/3 of its longest side away from any of its points
        error = apart.hausdorff + 2 / 3 * apart.step
        levels.append(Level(mesh, max(error, levels[-1].error)))
    return tuple(levels)


def _edge(mesh: Mesh) -> float:
    """Half the mean length of the edges, mm."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return float(lengths.mean()) / 2 or 1.0


def _of_level(surface: Surface, level: int) -> Surface:
    """The plain surface at a level, of no picture."""
    values = {f.name: getattr(surface, f.name) for f in fields(Surface)}
    plain = {"level": level, "level_pixels": 0.0, "size_pixels": 0.0, "front_faces": False}
    return Surface(**{**values, **plain})
