"""What is done to a mesh after extraction."""

from __future__ import annotations

from dataclasses import dataclass, replace

from volviz.model.knobs import check_knobs, knob

BOUNDARIES = ("fixed", "simplified")


@dataclass(frozen=True)
class Refining:
    """Steps in the order in which they are done; by default none."""

    weld: float = knob(0.0, "merge vertices at most so far apart; 0: none", low=0, unit="mm")
    keep_largest: bool = knob(False, "keep only the connected part with the greatest area")
    min_triangles: int = knob(0, "drop connected parts of fewer triangles", low=0)
    min_area: float = knob(0.0, "drop connected parts of less area", low=0, unit="mm²")
    smooth: int = knob(0, "iterations of smoothing without shrinkage (Taubin)", low=0, high=1000)
    decimate: float = knob(
        0.0, "share of the triangles to take away, 0.9: nine of ten", low=0, high=1
    )
    max_error: float = knob(
        0.0, "how far decimation may go from the surface, measured; 0: any", low=0, unit="mm"
    )
    boundary: str = knob(
        "fixed",
        "where the surface ends: its rim stays as it is, or is smoothed and decimated along itself",
        choices=BOUNDARIES,
    )
    flip: bool = knob(
        False,
        "turn it inside out, normals to higher values: for what is darker than what is round it",
    )

    def __post_init__(self) -> None:
        check_knobs(self)

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
