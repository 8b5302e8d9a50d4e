"""Which part of which picture, and where in its pixel a sample's ray goes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

PLASTIC = (0.7548776662466927, 0.5698402909980532)
BLOCK_PIXELS, BLOCK_WIDTH = 1 << 20, 2048
"""Of the parts in which surfaces are drawn: up to 104 bytes a pixel are needed beside it."""

Tile = tuple[int, int, int, int]


@dataclass(frozen=True)
class View:
    """Which part of which picture. size: whole picture, pixels. tile: x, y, width, height of the
    part, y from below. sample: its number in the accumulation. step_scale: larger steps. layers: of
    translucent surfaces over one pixel, at most; those behind are left out. stride, first: only
    every so-many-th pixel along each side from that one on, whose number the tile is in; not for
    surfaces."""

    size: tuple[int, int]
    tile: Tile
    sample: int = 0
    antialias: bool = True
    step_scale: float = 1.0
    layers: int = 32
    stride: int = 1
    first: tuple[int, int] = (0, 0)

    @classmethod
    def whole(cls, size: tuple[int, int], **more: Any) -> View:
        """The whole picture as one tile."""
        return cls(size, (0, 0, *size), **more)

    @classmethod
    def quarters(cls, size: tuple[int, int]) -> list[View]:
        """Four views of every second pixel, of one size (the last may lie outside)."""
        half = (0, 0, uneven(-(-size[0] // 2)), uneven(-(-size[1] // 2)))
        return [cls(size, half, stride=2, first=at) for at in ((0, 0), (1, 1), (1, 0), (0, 1))]

    def at_sample(self, sample: int) -> View:
        """The same part, another sample of the accumulation."""
        return replace(self, sample=sample)

    def part(self, tile: Tile) -> View:
        """Another part of the same picture."""
        return replace(self, tile=tile)


def uneven(side: int) -> int:
    """No power of two: llvmpipe would compile all shaders once more for such textures."""
    return side + 1 if side > 2 and side & (side - 1) == 0 else max(side, 3)


def blocks(view: View) -> Iterator[Tile]:
    """The parts in which surfaces are drawn, those that begin in the view's tile.

    They hang on the picture's size alone. Triangles cut by another edge are rounded otherwise: so
    the window, a file and a scene opened again show the same bits.
    """
    width, height = view.size
    x, y, w, h = view.tile
    wide = min(width, BLOCK_WIDTH)
    rows = max(min(BLOCK_PIXELS // wide, height), 1)
    for bottom in range(0, height, rows):
        for left in range(0, width, wide):
            if x <= left < x + w and y <= bottom < y + h:
                yield left, bottom, min(wide, width - left), min(rows, height - bottom)


def subpixel(sample: int) -> tuple[float, float]:
    """Where in its pixel a sample's ray goes, −½..½: the first in the middle, then the R2
    sequence (Roberts 2018)."""
    x, y = ((0.5 + sample * p) % 1.0 - 0.5 for p in PLASTIC)
    return x, y
