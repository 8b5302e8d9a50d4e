"""What the surfaces of a variant are: the cost of making them, their topology, their distance.

All is of the meshes as they are drawn, after what is done to them. The distance is that to the same
isovalue by marching cubes with the topology of the trilinear function, whose vertices lie on the
surface, of which the same parts are chosen (the largest, those of so many triangles); of the first
surface of a scene, in mm, sampled both ways (`meshes.distance`). Of samples with a closed form that
surface is compared with it as well (`lab/truth.py`).
"""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from volviz.fields.pyramid import level_of
from volviz.isosurface import adaptive, extract, finder_of
from volviz.isosurface.extractors import EXTRACTORS
from volviz.lab.truth import TruthError, truth_error
from volviz.meshes.distance import two_sided
from volviz.meshes.measure import measure
from volviz.meshes.refine import prepare, refine
from volviz.model.lens import SeenSurface, plain
from volviz.model.mesh import Mesh
from volviz.model.refining import Refining
from volviz.model.scene import SceneState
from volviz.model.surface import Surface
from volviz.model.volume import Volume
from volviz.model.wanted import Wanted
from volviz.progress import Progress, silent
from volviz.resolve_surfaces import wanted_of, warm
from volviz.samples import field_of
from volviz.samples.closed_form import Field


@dataclass(frozen=True)
class SurfaceFacts:
    """extract_ms: median of the times of all visible surfaces together, None untimed.
    refine_ms: that of what is done after extraction, None where nothing is. euler: V − E + F.
    visited: cells and nodes that the finder looked at (of the level that was made; all cells
    for a method that no finder helps), None under a lens and for a level by pixels. distance:
    mm, None without triangles. truth_…: mm and degrees against the closed form, None where
    there is none; truth_missed: None for 0."""

    extract_ms: float | None
    refine_ms: float | None
    triangles: int
    euler: int
    boundary_edges: int
    visited: int | None
    distance: float | None
    truth_mean: float | None = None
    truth_rms: float | None = None
    truth_max: float | None = None
    truth_back: float | None = None
    truth_angle: float | None = None
    truth_angle_max: float | None = None
    truth_missed: float | None = None


def surface_facts(
    scenes: Sequence[SceneState], repeat: int, progress: Progress | None = None
) -> list[SurfaceFacts | None]:
    """For each scene what its visible surfaces are; None where it has none.

    All scenes take turns: once untimed, for finders and kernels are made then, and `repeat` times
    more. Raises Cancelled through `progress`.
    """
    progress = progress or silent()
    shown = [[s.surface for s in scene.surfaces if s.look.visible] for scene in scenes]
    wanted = [
        [w for s, w in zip(scene.surfaces, wanted_of(scene), strict=True) if s.look.visible]
        for scene in scenes
    ]
    times: list[list[tuple[float, float]]] = [[] for _ in scenes]
    meshes: list[list[Mesh]] = [[] for _ in scenes]
    rounds = repeat + 1
    for turn in range(rounds * len(scenes)):
        which = turn % len(scenes)
        part = progress.part(*(0.7 * (turn + k) / (rounds * len(scenes)) for k in (0, 1)))
        volume = scenes[which].volume
        for one in wanted[which]:
            warm(volume, one.surface, part.part(0, 0))
            prepare(one.refining)
        start = time.perf_counter()
        made = [extract(volume, w.surface, part.part(0, 0.5)) for w in wanted[which]]
        between = time.perf_counter()
        meshes[which] = [
            refine(mesh, w.refining, part.part(0.5, 1))
            for mesh, w in zip(made, wanted[which], strict=True)
        ]
        if turn >= len(scenes):  # the first ones build what later ones find there
            times[which].append((between - start, time.perf_counter() - between))
    found: list[SurfaceFacts | None] = []
    fields = {id(s.volume): field_of(s.volume) for s in scenes if any(wanted)}
    for i, scene in enumerate(scenes):
        part = progress.part(0.7 + 0.3 * i / len(scenes), 0.7 + 0.3 * (i + 1) / len(scenes))
        ms = [1000 * statistics.median(column) for column in zip(*times[i], strict=True)]
        facts = None
        if wanted[i]:
            facts = _facts(scene, wanted[i], meshes[i], ms, part.part(0.0, 0.5))
            error = _error(scene, shown[i][0], meshes[i][0], fields[id(scene.volume)], part)
            facts = replace(facts, **error)  # type: ignore[arg-type]  # names and types are its
        found.append(facts)
    return found


def _facts(
    scene: SceneState,
    wanted: Sequence[Wanted],
    meshes: Sequence[Mesh],
    milliseconds: Sequence[float],
    progress: Progress,
) -> SurfaceFacts:
    reports = [measure(mesh) for mesh in meshes]
    refines = any(w.refining != Refining() for w in wanted)
    return SurfaceFacts(
        extract_ms=milliseconds[0] if milliseconds else None,
        refine_ms=milliseconds[1] if milliseconds and refines else None,
        triangles=sum(r.triangles for r in reports),
        euler=sum(r.euler for r in reports),
        boundary_edges=sum(r.boundary_edges for r in reports),
        visited=_visited(scene, [w.surface for w in wanted]),
        distance=_distance(scene, wanted[0], meshes[0], progress),
    )


def _visited(scene: SceneState, wanted: Sequence[Surface]) -> int | None:
    """Cells and nodes looked at for these surfaces; None where no finder decides what is."""
    counts = [_looked_at(scene.volume, surface) for surface in wanted]
    known = [count for count in counts if count is not None]
    return sum(known) if len(known) == len(counts) else None


def _looked_at(volume: Volume, surface: Surface) -> int | None:
    if isinstance(surface, SeenSurface) and adaptive.under_lens(surface):
        return None
    if surface.level_pixels:
        return None
    if surface.level:
        volume = level_of(volume, surface.level)
    finder = None
    if EXTRACTORS[surface.method].by_cell:
        finder = finder_of(volume, surface.finder)
    if finder is None:  # all cells
        return math.prod(max(n - 1, 0) for n in volume.dims)
    return finder.followed(surface.isovalue, None)[1].visited


def _distance(scene: SceneState, wanted: Wanted, mesh: Mesh, progress: Progress) -> float | None:
    knobs: Any = {"method": "marching-cubes", "ambiguity": "trilinear", "normals": "none"}
    exact = replace(plain(wanted.surface), **knobs, level=0, level_pixels=0.0)
    truth = refine(extract(scene.volume, exact), wanted.refining.choosing, progress.part(0, 0.1))
    if not len(mesh.faces) or not len(truth.faces):
        return None
    same = (np.array_equal(getattr(mesh, k), getattr(truth, k)) for k in ("vertices", "faces"))
    if all(same):
        return 0.0
    return two_sided(mesh, truth, progress=progress.part(0.1, 1)).hausdorff


def _error(
    scene: SceneState, surface: Surface, mesh: Mesh, field: Field | None, progress: Progress
) -> dict[str, float | None]:
    """The fields of `SurfaceFacts` that need the truth."""
    found: TruthError | None = None
    if field is not None:
        part = progress.part(0.5, 1.0)
        found = truth_error(mesh, scene.volume, surface.isovalue, field, progress=part)
    if found is None:
        return {}
    return {
        "truth_mean": found.mean,
        "truth_rms": found.rms,
        "truth_max": found.greatest,
        "truth_back": found.back,
        "truth_angle": found.angle_mean,
        "truth_angle_max": found.angle_greatest,
        "truth_missed": found.missed or None,
    }
