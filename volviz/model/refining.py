"""What is done to a mesh after extraction."""

from __future__ import annotations

from dataclasses import dataclass

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
        "where the surface ends, its edge stays as it is, or is smoothed and decimated along itself",
        choices=BOUNDARIES,
    )

    def __post_init__(self) -> None:
        check_knobs(self)
