"""One scene, some of its knobs over several values: `volviz.compare`, and what it found."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, SupportsIndex

from volviz.errors import LimitError, UsageError
from volviz.image import MAX_PIXELS, Image, check_size, image_format
from volviz.lab import measure, vary
from volviz.lab.measure import Bench, Column, Measured, Reference
from volviz.lab.vary import Axis
from volviz.model.scene import SceneState
from volviz.model.volume import Volume
from volviz.progress import Progress
from volviz.scene import Scene

MOST_REPEATS = 1000
MOST_PIXELS = MAX_PIXELS // 3
"""Of all variants together: a sheet has room for each, its difference and the words."""
UNIT = "1/255 of sRGB"


@dataclass(frozen=True, eq=False)
class Comparison:
    """What was found. variants: in the order of the values, the last axis changing first.

    repeat: timed draws of each variant. threads: of a software rasteriser, None for hardware.
    """

    scene: SceneState
    axes: tuple[Axis, ...]
    variants: tuple[Measured, ...]
    references: tuple[Reference, ...]
    size: tuple[int, int]
    repeat: int
    renderer: str
    threads: int | None

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should be told about the pictures."""
        found = [note for v in self.variants for note in v.image.notes]
        found += [
            w for v in self.variants if (w := vary.preset_warning(self.scene, v.variant.changed))
        ]
        scenes = [v.variant.scene for v in self.variants]
        found += [w for a in self.axes if (w := vary.idle_warning(a, scenes))]
        return tuple(dict.fromkeys(found))

    @property
    def setting(self) -> str:
        """How it was measured: size, device, draws."""
        threads = "" if self.threads is None else f", {self.threads} threads"
        times = f" · ms: median of {self.repeat}" if self.repeat else ""
        return f"{self.size[0]}×{self.size[1]} · {self.renderer}{threads}{times}"

    @property
    def against(self) -> str:
        """What the errors are against; empty without references."""
        if not self.references:
            return ""
        labels = " or ".join(dict.fromkeys(r.label for r in self.references))
        one = len(self.references) == 1 < len(self.variants)
        which = "all against the scene" if one else "each against the same"
        return f"RMSE and max in {UNIT}, {which} with {labels}"

    def table(self) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
        """Column titles, and a row of texts for each variant. The numbers are `document`'s."""
        columns = [*(a.short for a in self.axes)]
        columns += ["ms"] if self.repeat else []
        columns += ["RMSE", "max"] if self.references else []
        known = self.scene.volume.info.length_unit is not None
        columns += [
            m.title if known else m.title.removesuffix(" mm") for m in self._measures.values()
        ]
        return tuple(columns), [tuple(self._row(v)) for v in self.variants]

    def _row(self, found: Measured) -> list[str]:
        row = [vary.value_text(found.variant.changed[a.name]) for a in self.axes]
        row += [] if found.ms is None else [f"{found.ms:.1f}"]
        row += [] if found.rmse is None else [f"{found.rmse:.2f}", str(found.largest)]
        return row + [
            m.text(found.facts[name]) if name in found.facts else "–"
            for name, m in self._measures.items()
        ]

    @property
    def _measures(self) -> dict[str, Column]:
        return measure.columns_of([v.facts for v in self.variants])

    def document(self) -> dict[str, Any]:
        """All numbers, ready for JSON."""
        return {
            "volume": self.scene.volume.name,
            "length_unit": self.scene.volume.info.length_unit,
            "size": list(self.size),
            "vary": {a.name: list(a.values) for a in self.axes},
            "renderer": self.renderer,
            "threads": self.threads,
            "repeat": self.repeat,
            "error_unit": UNIT,
            "references": [r.label for r in self.references],
            "variants": [_entry(v) for v in self.variants],
            "notes": list(self.notes),
        }

    def sheet(self, *, difference: bool = False) -> Image:
        """All pictures on one, with their labels and numbers. difference: below each, how far it
        is from its reference, made visible by a stated factor. Raises UsageError, LimitError."""
        from volviz.lab.sheet import draw

        return draw(self, difference=difference).image

    def save(self, path: str | Path, *, difference: bool = False, overwrite: bool = True) -> None:
        """Write the sheet as a picture, atomically. Raises OutputError."""
        image_format(path)
        self.sheet(difference=difference).save(path, overwrite=overwrite)

    def __str__(self) -> str:
        columns, rows = self.table()
        wide = [max(map(len, column)) for column in zip(columns, *rows, strict=True)]
        lines = [
            "  ".join(cell.rjust(width) for cell, width in zip(row, wide, strict=True))
            for row in (columns, *rows)
        ]
        return "\n".join([self.setting, *lines, *filter(None, [self.against])])

    def _repr_png_(self) -> bytes:
        return self.sheet().encoded()


def _entry(found: Measured) -> dict[str, Any]:
    return {
        "label": found.variant.label,
        "changed": dict(found.variant.changed),
        "ms": None if found.ms is None else round(found.ms, 3),
        "ms_each": [round(1000 * t, 3) for t in found.times],
        "rmse": None if found.rmse is None else round(found.rmse, 4),
        "max": found.largest,
        "reference": found.reference,
        **{n: _number(v) for n, v in found.facts.items()},
    }


def _number(value: float) -> float:
    """For JSON: whole ones without a point, others to seven digits however small they are."""
    return int(value) if float(value).is_integer() else float(f"{value:.7g}")


def compare(
    scene: SceneState | Volume,
    vary_over: Mapping[str, Iterable[Any]],
    *,
    size: Sequence[SupportsIndex] = (400, 400),
    reference: str = "fine",
    repeat: int = 3,
    backend: str | None = None,
    progress: Progress | None = None,
) -> Comparison:
    """Draw a scene once for every combination of values, and measure each.

    vary_over: values by the name of a knob (`step`, `raycast.step`), or of one of `preset`,
    `view`, `background`, `opacity`, `unit-distance`; "all" for all choices of a knob. reference:
    "fine" measures each picture against the same finely sampled (see `volviz.lab.measure`),
    "none" does not. repeat: timed draws of each, 0 for no times.

    >>> print(volviz.compare(scene, {"step": [0.25, 0.5, 1], "shading": ["none", "phong"]}))

    Raises UsageError for unknown names and values, LimitError for too many variants,
    GraphicsError without usable OpenGL, Cancelled through `progress`.
    """
    pixels = check_size(size)
    aspect = pixels[0] / pixels[1]
    if not isinstance(vary_over, Mapping):
        raise UsageError(
            f"{vary_over!r} does not say what to vary", field="vary_over", fix='e.g. {"step": [1]}'
        )
    if not isinstance(scene, SceneState):
        scene = Scene.of(scene, aspect=aspect)
    axes = [vary.axis_of(name, values, scene) for name, values in vary_over.items()]
    return measure_axes(
        scene,
        axes,
        size=pixels,
        reference=reference,
        repeat=repeat,
        backend=backend,
        progress=progress,
    )


def measure_axes(
    scene: SceneState,
    axes: Sequence[Axis],
    *,
    size: Sequence[int],
    reference: str,
    repeat: int,
    backend: str | None,
    progress: Progress | None,
) -> Comparison:
    """`compare` for axes that are known already."""
    if not isinstance(repeat, int) or not 0 <= repeat <= MOST_REPEATS:
        raise UsageError(
            f"{repeat} is no number of draws", field="--repeat", fix=f"give 0 to {MOST_REPEATS}"
        )
    variants = vary.variants(scene, axes, aspect=size[0] / max(size[-1], 1))
    measure.check_reference(reference)
    bench = Bench(size, backend)
    if len(variants) * bench.size[0] * bench.size[1] > MOST_PIXELS:
        raise LimitError(
            f"{len(variants)} pictures of {bench.size[0]}×{bench.size[1]} are too many pixels",
            field="--size",
            fix="make the pictures smaller, or give fewer values",
        )
    found, references = measure.measured(
        bench, scene, variants, reference=reference, repeat=repeat, progress=progress
    )
    return Comparison(
        scene,
        tuple(axes),
        tuple(found),
        tuple(references),
        bench.size,
        repeat,
        bench.gpu.renderer,
        bench.threads,
    )
