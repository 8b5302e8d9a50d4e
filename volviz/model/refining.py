"""What is done to a mesh after extraction."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from volviz.errors import UsageError
from volviz.model.knobs import check_knobs, knob, knobs_of
from volviz.model.surface import METHODS

BOUNDARIES = ("fixed", "simplified")
TRIANGLES = {"method": tuple(m for m in METHODS if m != "dividing-cubes")}
"""Methods that make triangles; points can only be turned."""


@dataclass(frozen=True)
class Refining:
    """Steps in the order in which they are done; by default none."""

    weld: float = knob(
        0.0,
        "merge vertices at most so far apart; 0: none",
        low=0,
        unit="mm",
        used_with=TRIANGLES,
    )
    keep_largest: bool = knob(
        False, "keep only the connected part with the greatest area", used_with=TRIANGLES
    )
    min_triangles: int = knob(
        0, "drop connected parts of fewer triangles", low=0, used_with=TRIANGLES
    )
    min_area: float = knob(
        0.0, "drop connected parts of less area", low=0, unit="mm²", used_with=TRIANGLES
    )
    smooth: int = knob(
        0,
        "iterations of smoothing without shrinkage (Taubin)",
        low=0,
        high=1000,
        used_with=TRIANGLES,
    )
    decimate: float = knob(
        0.0,
        "share of the triangles to take away, 0.9: nine of ten",
        low=0,
        high=1,
        used_with=TRIANGLES,
    )
    max_error: float = knob(
        0.0,
        "how far decimation may go from the surface, measured; 0: any",
        low=0,
        unit="mm",
        used_with=TRIANGLES,
    )
    boundary: str = knob(
        "fixed",
        "where the surface ends: its rim stays as it is, or is smoothed and decimated along itself",
        choices=BOUNDARIES,
        used_with=TRIANGLES,
    )
    flip: bool = knob(
        False,
        "turn it inside out, normals to higher values: for what is darker than what is round it",
    )

    def __post_init__(self) -> None:
        check_knobs(self)
        for spec in knobs_of(type(self)):
            value = getattr(self, spec.name)
            if spec.type is float and not math.isfinite(value):
                raise UsageError(f"{value} is not a finite number", field=spec.flag, fix=spec.help)

    @property
    def choosing(self) -> Refining:
        """Only the steps that say what belongs to the mesh."""
        return replace(self, smooth=0, decimate=0.0, max_error=0.0, flip=False)

    @property
    def shaping(self) -> Refining:
        """Only the steps that move or turn the surface."""
        return replace(self, weld=0.0, keep_largest=False, min_triangles=0, min_area=0.0)

    @property
    def moves(self) -> bool:
        """True if a step moves the surface."""
        return bool(self.smooth or self.decimate or self.max_error)

    @property
    def acting(self) -> Refining:
        """The same without what has no effect beside the other steps: nothing moves, no rim does.

        Equal ones make equal meshes.
        """
        idle = self.boundary != "fixed" and not self.moves
        return replace(self, boundary="fixed") if idle else self

    @property
    def turning(self) -> Refining:
        """Only the step that points, and parts of a surface, can go through."""
        return Refining(flip=self.flip)

    def coarser(self, factor: float) -> Refining:
        """What does about the same to a surface whose triangles are so many times as long, and
        that is light enough as it is."""
        return replace(
            self,
            min_triangles=round(self.min_triangles / factor**2),
            smooth=round(self.smooth / factor**2),
            decimate=0.0,
            max_error=0.0,
        )

    @property
    def text(self) -> str:
        """What is done, for people: "keep largest, smooth 20"; "" for nothing."""
        words = []
        for spec in knobs_of(type(self)):
            value = getattr(self.acting, spec.name)
            if value != spec.default:
                name = spec.name.replace("_", " ")
                amount = f"{value:.6g}" if isinstance(value, float) else str(value)
                unit = f" {spec.unit}" if spec.unit else ""
                words.append(name if value is True else f"{name} {amount}{unit}")
        return ", ".join(words)
