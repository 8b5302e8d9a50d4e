"""Which part of which picture, and where in its pixel a sample's ray goes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

PLASTIC = (0.7548776662466927, 0.5698402909980532)


@dataclass(frozen=True)
class View:
    """Which part of which picture. size: whole picture, pixels. tile: x, y, width, height of the
    part, y from below. sample: its number in the accumulation. step_scale: larger steps. layers: of
    translucent surfaces over one pixel, at most; those behind are left out."""

    size: tuple[int, int]
    tile: tuple[int, int, int, int]
    sample: int = 0
    antialias: bool = True
    step_scale: float = 1.0
    layers: int = 32

    @classmethod
    def whole(cls, size: tuple[int, int], **more: Any) -> View:
        """The whole picture as one tile."""
        return cls(size, (0, 0, *size), **more)

    def at_sample(self, sample: int) -> View:
        """The same part, another sample of the accumulation."""
        return replace(self, sample=sample)

    def rows(self, first: int, count: int) -> View:
        """Some rows of the same part."""
        x, y, width, _ = self.tile
        return replace(self, tile=(x, y + first, width, count))


def subpixel(sample: int) -> tuple[float, float]:
    """Where in its pixel a sample's ray goes, −½..½: the first in the middle, then the R2
    sequence (Roberts 2018)."""
    x, y = ((0.5 + sample * p) % 1.0 - 0.5 for p in PLASTIC)
    return x, y
