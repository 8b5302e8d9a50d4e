"""Sample volumes that code makes, with known truth.

`sample("ct-head")` is a head in Hounsfield units; `names()` lists the others; `truth(name)` is
what a sample shows, free of blur and noise, to measure against, and `field_of(volume)` the same as
a function with its gradient. Only numpy is needed.
"""

from __future__ import annotations

import operator
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from volviz.errors import UsageError, did_you_mean
from volviz.model.volume import Volume
from volviz.progress import Progress, silent
from volviz.samples.closed_form import Field

__all__ = ["SAMPLES", "Sample", "field_of", "names", "sample", "truth"]

SMALLEST, LARGEST = 8, 512


@dataclass(frozen=True)
class Sample:
    """A sample: what it is, the module and function that make it, the functions of its truth and
    of the field that was sampled."""

    about: str
    module: str
    make: str
    truth: str | None = None
    field: str | None = None


SAMPLES: dict[str, Sample] = {
    "ct-head": Sample(
        "CT of a head with known tissues, 1 mm", "ct_head", "head", "truth_upright", "field_upright"
    ),
    "ct-head-anisotropic": Sample(
        "the same head in slices of 2.5 mm",
        "ct_head",
        "anisotropic",
        "truth_anisotropic",
        "field_anisotropic",
    ),
    "ct-head-oblique": Sample(
        "the same head on a turned grid", "ct_head", "oblique", "truth_oblique", "field_oblique"
    ),
    "marschner-lobb": Sample(
        "the test signal for interpolation, rings at the limit of sampling",
        "marschner_lobb",
        "marschner_lobb",
        "truth",
        "field",
    ),
    "vessel": Sample(
        "branching vessel with known radii, as in CT angiography",
        "vessel",
        "vessel",
        "truth",
        "field",
    ),
    "orbital": Sample(
        "|ψ|² of a hydrogen orbital, very small float values",
        "orbital",
        "orbital",
        "truth",
        "field",
    ),
    "plume": Sample("turbulent plume of smoke, float density", "plume", "plume"),
    "sphere": Sample(
        "distance to a sphere of 40 mm, exact at every isovalue",
        "primitives",
        "sphere",
        "sphere_truth",
        "sphere_field",
    ),
    "torus": Sample(
        "distance to a torus, exact at every isovalue",
        "primitives",
        "torus",
        "torus_truth",
        "torus_field",
    ),
}


def names() -> tuple[str, ...]:
    """The names of all samples."""
    return tuple(SAMPLES)


def sample(
    name: str, *, size: int | None = None, seed: int = 0, progress: Progress | None = None
) -> Volume:
    """The sample called `name`.

    size: samples along the axis that has most of them, 8..512, the others in proportion; None
    for what suits the sample. seed: of the noise (of the flow for ``plume``); the same name, size
    and seed always give the same bytes. Raises UsageError for an unknown name, size or seed, and
    Cancelled through `progress`.
    """
    entry = _entry(name)
    size, seed = _size(size), _whole(seed, "seed")
    if seed < 0:
        raise UsageError(f"the seed must not be negative, this is {seed}", field="seed")
    make: Callable[..., Volume] = getattr(_module(entry), entry.make)
    volume = make(size, seed, progress or silent())
    fields = {"sample": entry.about, "seed": str(seed), **volume.info.fields}
    # a scene can name the sample only if its name alone makes it again
    source = Path(f"sample:{name}") if size is None and seed == 0 else None
    info = replace(volume.info, format="sample", name=name, fields=fields, source=source)
    return Volume(volume.data, info)


def truth(name: str, *, size: int | None = None) -> Any:
    """What the sample called `name` shows, exactly.

    - ``ct-head`` and its variants: a Volume of kind "labels" on the grid of `sample(name, size)`,
      uint8[z, y, x]; `volviz.samples.ct_head.MATERIALS` maps the names of materials to their
      numbers and Hounsfield units, `info.fields` tells the same.
    - ``marschner-lobb``, ``orbital``, ``sphere``, ``torus``: the function (x, y, z) → value, world
      positions in, float64 out, by broadcasting.
    - ``vessel``: a `volviz.samples.vessel.Tree` of centre lines and radii.

    Raises UsageError for an unknown name, and for ``plume``, whose only truth is itself.
    """
    entry = _entry(name)
    size = _size(size)
    if entry.truth is None:
        known = [n for n, s in SAMPLES.items() if s.truth]
        raise UsageError(
            f"the sample '{name}' has no separate truth", fix=f"these have: {', '.join(known)}"
        )
    return getattr(_module(entry), entry.truth)(size)


def field_of(volume: Volume) -> Field | None:
    """The function that a sample's volume was sampled from, before blur and noise: world positions
    float64[n, 3] to values float64[n] and gradients float64[n, 3] per mm. None for other volumes.

    It is a closed form for all but the heads, whose painting takes as long as making the sample and
    is trilinear between the samples.
    """
    entry = SAMPLES.get(volume.name or "") if volume.info.format == "sample" else None
    if entry is None or entry.field is None:
        return None
    make: Callable[[Volume], Field] = getattr(_module(entry), entry.field)
    return make(volume)


def _entry(name: str) -> Sample:
    if not isinstance(name, str):
        raise UsageError(f"a sample's name is a str, not {type(name).__name__}", field="sample")
    if name not in SAMPLES:
        raise UsageError(
            f"there is no sample '{name}'", field="sample", fix=did_you_mean(name, SAMPLES)
        )
    return SAMPLES[name]


def _module(entry: Sample) -> Any:
    return import_module(f"volviz.samples.{entry.module}")


def _size(size: int | None) -> int | None:
    if size is None:
        return None
    size = _whole(size, "size")
    if not SMALLEST <= size <= LARGEST:
        raise UsageError(f"{size} is not in {SMALLEST}..{LARGEST}", field="size")
    return size


def _whole(value: Any, field: str) -> int:
    try:
        return operator.index(value)
    except TypeError:
        raise UsageError(f"{value!r} is not a whole number", field=field) from None
