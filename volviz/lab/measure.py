"""What the variants of a scene look like, what they cost, and how far they are from the truth.

The reference of a variant is the same scene finely sampled: what only decides how exactly the
picture is computed (`Knob.fine`: step, samples, early termination, …) is set finer than in any
variant, what approximates one thing in several ways (gradient, interpolation) is as in the scene
before it was varied, and what decides what the picture shows (mode, shading, light, camera, the
transfer function) is the variant's own. So variants of the step share one reference, and each
variant of the shading has its own.

Errors are of the finished pictures, in steps of 1/255 of sRGB, over black where they are
transparent. Times are of whole pictures: all variants are drawn in turn, several times, and the
median counts; the graphics have then seen each of them before.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError, did_you_mean
from volviz.image import Image, check_size
from volviz.lab import vary
from volviz.lab.vary import Variant
from volviz.model.frame import Frame
from volviz.model.scene import SceneState
from volviz.progress import Progress, silent
from volviz.scene import drawn, renderer_of

REFERENCES = ("fine", "none")
TINY = (16, 16)
"""Drawn before each timed picture: tables that depend on the step are then on the GPU."""
REFERENCE_SHARE = 0.6


@dataclass(frozen=True)
class Column:
    """A number that a table shows of each variant."""

    title: str
    help: str
    text: Callable[[float], str]


@dataclass(frozen=True)
class Measure(Column):
    """A fact of a frame. of: frame and size of the picture to a number."""

    of: Callable[[Frame, tuple[int, int]], float]


def texture_bytes(frame: Frame, size: tuple[int, int]) -> float:
    """Bytes of all textures that the frame needs."""
    empty = 0 if frame.emptiness is None else frame.emptiness.distance.nbytes
    return frame.voxels.nbytes + frame.table.entries.nbytes + empty


def lattice(frame: Frame, size: tuple[int, int]) -> float:
    """Samples that the rays of a picture take if none ends early and nothing is leapt over."""
    width, height = size
    x = (2 * np.arange(width) + 1) / width - 1
    y = (2 * np.arange(height) + 1) / height - 1
    at = np.stack(np.broadcast_arrays(1.0, x[None, :], y[:, None]), axis=-1)
    origin, direction = frame.camera.rays(width / height)
    to_index = np.linalg.inv(frame.affine)
    start = at @ (to_index[:3, :3] @ origin).T + to_index[:3, 3] + 0.5
    along = at @ (to_index[:3, :3] @ direction).T
    along = np.where(np.abs(along) < 1e-12, 1e-12, along)
    ends = np.stack([-start / along, (frame.voxels.dims - start) / along])
    enter, leave = ends.min(axis=0).max(axis=-1), ends.max(axis=0).min(axis=-1)
    if frame.camera.projection == "perspective":
        enter = np.maximum(enter, 0.0)
    length = np.maximum(leave - enter, 0.0) * np.linalg.norm(at @ direction.T, axis=-1)
    taken = length.sum() / (frame.step * frame.spacing) * frame.raycast.samples
    return float(round(taken))


MEASURES: dict[str, Measure] = {
    "texture_bytes": Measure(
        "texture", "memory of the textures", lambda v: f"{v / 2**20:.1f} MiB", texture_bytes
    ),
    "samples": Measure(
        "samples", "along all rays, if none ends early", lambda v: f"{v / 1e6:.1f} M", lattice
    ),
}


SURFACE_COLUMNS: dict[str, Column] = {
    "extract_ms": Column("extract ms", "time to make the surfaces", lambda v: f"{v:.1f}"),
    "refine_ms": Column("refine ms", "time of what is done to them then", lambda v: f"{v:.1f}"),
    "triangles": Column("triangles", "of all visible surfaces", lambda v: f"{v:,.0f}"),
    "euler": Column("χ", "Euler characteristic V − E + F", lambda v: f"{v:.0f}"),
    "boundary_edges": Column("open edges", "edges of one triangle", lambda v: f"{v:,.0f}"),
    "visited": Column("visited", "cells and nodes looked at", lambda v: f"{v:,.0f}"),
    "distance": Column("distance mm", "greatest, to trilinear marching cubes", "{:.3g}".format),
    "truth_mean": Column("truth mean mm", "mean distance to the closed form", "{:.3g}".format),
    "truth_rms": Column("truth RMS mm", "root mean square of that distance", "{:.3g}".format),
    "truth_max": Column("truth max mm", "greatest distance to the closed form", "{:.3g}".format),
    "truth_back": Column("back max mm", "greatest from the closed form to it", "{:.3g}".format),
    "truth_angle": Column("normals mean °", "mean angle to the true normals", "{:.3g}".format),
    "truth_angle_max": Column("normals max °", "greatest angle to them", "{:.3g}".format),
    "truth_missed": Column(
        "no truth", "share without a true surface nearby", lambda v: f"{100 * v:.2g} %"
    ),
}
"""Columns for scenes with surfaces (`lab/surfaces.py`)."""


def columns_of(facts: Sequence[Mapping[str, float]]) -> dict[str, Column]:
    """What was measured of some variant: the surfaces first, where there are any."""
    known = {**SURFACE_COLUMNS, **MEASURES}
    return {n: column for n, column in known.items() if any(n in one for one in facts)}


@dataclass(frozen=True, eq=False)
class Reference:
    """A finely sampled picture. label: what is fine in it."""

    label: str
    scene: SceneState
    image: Image


@dataclass(frozen=True, eq=False)
class Measured:
    """A variant and what was found. times: seconds of each draw. rmse, largest: of the picture
    against its reference, 1/255 of sRGB. reference: its number. facts: by name of `MEASURES`."""

    variant: Variant
    image: Image
    times: tuple[float, ...] = ()
    rmse: float | None = None
    largest: int | None = None
    reference: int | None = None
    facts: dict[str, float] = field(default_factory=dict)

    @property
    def ms(self) -> float | None:
        """Median of the times, milliseconds."""
        return 1000 * statistics.median(self.times) if self.times else None


def time_text(ms: float) -> str:
    """Three digits of a time, for people."""
    return f"{ms:.3g} ms" if ms < 999.5 else f"{ms / 1000:.3g} s"


def difference(one: Image, other: Image) -> NDArray[np.uint8]:
    """uint8[h, w, 3]: how far two pictures are apart, 1/255 of sRGB, over black."""
    a, b = (_over_black(i.pixels) for i in (one, other))
    return np.abs(a - b).astype(np.uint8)


def rmse(apart: NDArray[np.uint8]) -> float:
    """Root of the mean square over all pixels and colours."""
    return float(np.sqrt(np.mean(np.square(apart, dtype=np.float64))))


def _over_black(pixels: NDArray[np.uint8]) -> NDArray[np.int16]:
    whole = pixels.astype(np.int32)
    return ((whole[..., :3] * whole[..., 3:] + 127) // 255).astype(np.int16)


def check_reference(kind: str) -> None:
    """Raise UsageError unless it is one of `REFERENCES`."""
    if kind not in REFERENCES:
        fix = did_you_mean(kind, REFERENCES)
        raise UsageError(f"unknown reference '{kind}'", field="--reference", fix=fix)


def fine_label(scene: SceneState) -> str:
    """What is fine in a reference: `step 0.125 · samples 32 · termination 1`."""
    known = vary.places(scene)
    parts = [
        f"{place.knob.name} {vary.value_text(vary.value_of(scene, place))}"
        for place in known.values()
        if place.knob.fine not in (None, vary.AS_SCENE)
        and vary.value_of(scene, place) != place.knob.default
    ]
    return " · ".join(parts)


class Bench:
    """Draws and times the variants of one comparison on one OpenGL."""

    def __init__(self, size: Sequence[int], backend: str | None) -> None:
        from volviz.gpu.contexts import shared_gpu

        self.size = check_size(size)
        self.backend = backend
        self.gpu = shared_gpu(backend)
        self.renderer = renderer_of(self.gpu)

    @property
    def threads(self) -> int | None:
        """Threads that a software rasteriser has; None for hardware."""
        if not self.gpu.software:
            return None
        told = os.environ.get("LP_NUM_THREADS", "")
        if told.isdigit() and int(told) > 0:
            return int(told)
        usable = getattr(os, "sched_getaffinity", None)
        return len(usable(0)) if usable is not None else os.cpu_count()

    def picture(self, scene: SceneState, progress: Progress) -> tuple[Image, Frame]:
        """As `volviz.render` draws it."""
        return drawn(scene, self.size, backend=self.backend, progress=progress)

    def times(self, frames: Sequence[Frame], repeat: int, progress: Progress) -> list[list[float]]:
        """Seconds of `repeat` whole pictures of each frame, drawn in turn."""
        found: list[list[float]] = [[] for _ in frames]
        total = repeat * len(frames)
        for count in range(total):
            which = count % len(frames)
            part = progress.part(count / total, (count + 1) / total)
            self.renderer.image(frames[which], TINY, samples=1)
            start = time.perf_counter()
            self.renderer.image(frames[which], self.size, progress=part)
            found[which].append(time.perf_counter() - start)
        return found


def measured(
    bench: Bench,
    scene: SceneState,
    variants: Sequence[Variant],
    *,
    reference: str,
    repeat: int,
    progress: Progress | None = None,
) -> tuple[list[Measured], list[Reference]]:
    """Draw and measure all variants. scene: before it was varied. reference: "fine" or "none".

    repeat: timed draws of each; 0 times nothing. Raises Cancelled through `progress`.
    """
    progress = progress or silent()
    share = REFERENCE_SHARE if reference == "fine" else 0.0
    first = (1 - share) / (1 + repeat)
    drawing, timing = progress.part(0.0, first), progress.part(first, 1 - share)
    pictures = [
        bench.picture(v.scene, drawing.part(i / len(variants), (i + 1) / len(variants)))
        for i, v in enumerate(variants)
    ]
    times = bench.times([frame for _, frame in pictures], repeat, timing)
    references, numbers = _references(
        bench, scene, variants, reference, progress.part(1 - share, 0.9)
    )
    surfaces = surfaces_of([v.scene for v in variants], repeat, progress.part(0.9, 1.0))
    found = []
    for variant, (image, frame), took, number, extra in zip(
        variants, pictures, times, numbers, surfaces, strict=True
    ):
        facts: dict[str, float] = {k: m.of(frame, bench.size) for k, m in MEASURES.items()}
        facts |= extra
        error: dict[str, Any] = {}
        if number is not None:
            apart = difference(image, references[number].image)
            error = {"rmse": rmse(apart), "largest": int(apart.max()), "reference": number}
        found.append(Measured(variant, image, tuple(took), facts=facts, **error))
    progress(1.0, "compared")
    return found, references


def surfaces_of(
    scenes: Sequence[SceneState], repeat: int, progress: Progress
) -> list[dict[str, float]]:
    """Facts of the surfaces of each variant, by name of `SURFACE_COLUMNS`: none without any."""
    if not any(s.look.visible for scene in scenes for s in scene.surfaces):
        return [{} for _ in scenes]
    from volviz.lab.surfaces import surface_facts  # brings the compiler with it

    return [
        {} if facts is None else {k: v for k, v in asdict(facts).items() if v is not None}
        for facts in surface_facts(scenes, repeat, progress)
    ]


def _references(
    bench: Bench,
    scene: SceneState,
    variants: Sequence[Variant],
    kind: str,
    progress: Progress,
) -> tuple[list[Reference], list[int | None]]:
    """The different references, and which of them each variant has."""
    if kind == "none":
        return [], [None] * len(variants)
    everything = [v.scene for v in variants]
    wanted = [vary.fine(scene, v.scene, everything) for v in variants]
    different: list[SceneState] = []
    for one in wanted:
        if one not in different:
            different.append(one)
    made = []
    for i, one in enumerate(different):
        part = progress.part(i / len(different), (i + 1) / len(different))
        made.append(Reference(fine_label(one), one, bench.picture(one, part)[0]))
    return made, [different.index(one) for one in wanted]
