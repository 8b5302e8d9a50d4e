"""One picture with all variants: each as it was drawn, its values and numbers below it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from volviz._version import __version__
from volviz.errors import safe_text
from volviz.image import Image, check_size
from volviz.lab import measure
from volviz.resources import font

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont

    from volviz.lab.compare import Comparison

Color = tuple[int, int, int]
GROUND: Color = (27, 29, 33)
EMPTY: Color = (34, 37, 42)
TEXT: Color = (226, 229, 234)
FAINT: Color = (150, 157, 168)
ACCENT: Color = (120, 176, 245)
LEAST, MOST = 11.0, 26.0
"""Pixels of a font."""
NARROWEST = 132
"""Pixels of a column, so that numbers have room below a small picture."""
MOST_COLUMNS = 8
WIDE = 1.6
"""Width / height that a sheet of one axis is near to."""
MOST_GAIN = 64
BRIGHT = 200
"""How bright the largest differences but a few are made, at most."""


@dataclass(frozen=True)
class Sheet:
    """The picture; where each variant's lies on it, and each difference's: left, top."""

    image: Image
    places: tuple[tuple[int, int], ...]
    differences: tuple[tuple[int, int], ...] = ()
    gain: int = 1


@dataclass(frozen=True)
class _Cell:
    """What is shown of one variant: pictures from top to bottom, a title, lines of numbers."""

    pictures: tuple[NDArray[np.uint8], ...]
    title: str
    lines: tuple[str, ...]


@dataclass(frozen=True)
class _Plan:
    """Measures of a sheet, in pixels. wide: of a column; tall: of a row."""

    picture: tuple[int, int]
    columns: int
    rows: int
    stacked: int
    font: float
    titles: int
    lines: int
    heads: int
    feet: int

    @property
    def gap(self) -> int:
        return round(self.font * 1.3)

    @property
    def wide(self) -> int:
        return max(self.picture[0], NARROWEST)

    @property
    def line(self) -> int:
        return round(self.font * 1.4)

    @property
    def pictures_tall(self) -> int:
        return self.stacked * self.picture[1] + (self.stacked - 1) * (self.gap // 3)

    @property
    def tall(self) -> int:
        return self.pictures_tall + self.gap // 2 + (self.titles + self.lines) * self.line

    @property
    def top(self) -> int:
        return self.gap + round(self.font * 2.2) + self.heads * self.line + self.gap // 2

    @property
    def size(self) -> tuple[int, int]:
        width = self.gap + self.columns * (self.wide + self.gap)
        height = self.top + self.rows * (self.tall + self.gap) + self.feet * self.line
        return width, height + (self.gap if self.feet else 0)

    def corner(self, index: int) -> tuple[int, int]:
        """Left, top of a cell's first picture."""
        row, column = divmod(index, self.columns)
        return (
            self.gap + column * (self.wide + self.gap),
            self.top + row * (self.tall + self.gap),
        )


def draw(comparison: Comparison, *, difference: bool = False) -> Sheet:
    """The contact sheet of a comparison. Raises UsageError for one larger than a picture may be."""
    difference = difference and bool(comparison.references)
    gain = _gain(comparison) if difference else 1
    cells = [
        _cell(comparison, i, gain if difference else 0) for i in range(len(comparison.variants))
    ]
    if len(comparison.references) == 1 < len(comparison.variants):
        cells.append(_reference(comparison, stacked=difference))
    feet = [comparison.setting, comparison.against]
    if difference:
        feet.append(f"below each picture: its difference from the reference, × {gain}")
    plan, wrapped, feet = _planned(comparison, cells, [f for f in feet if f])
    pixels = _painted(comparison, plan, cells, wrapped, feet)
    places = tuple(plan.corner(i) for i in range(len(comparison.variants)))
    under = plan.picture[1] + plan.gap // 3
    apart = tuple((x, y + under) for x, y in places) if difference else ()
    facts = {"Software": f"volviz {__version__}", "Renderer": comparison.renderer}
    image = Image(pixels, comparison.renderer, comparison.notes, facts)
    return Sheet(image, places, apart, gain)


def columns_of(counts: list[int], extra: int, aspect: float) -> int:
    """Columns for axes of so many values: with two axes the last one's values stand side by side,
    one axis fills a sheet that is wider than high. extra: further cells. aspect: of a cell."""
    total = math.prod(counts) + extra
    if len(counts) > 1 and 1 < counts[-1] <= MOST_COLUMNS:
        return counts[-1]
    if total <= 5:
        return total

    def badness(columns: int) -> tuple[float, int]:
        rows = math.ceil(total / columns)
        empty = rows * columns - total
        return abs(math.log(columns * aspect / rows / WIDE)) + 0.25 * empty, columns

    return min(range(2, MOST_COLUMNS + 1), key=badness)


# --- what is shown -------------------------------------------------------------------------------


def _cell(comparison: Comparison, index: int, gain: int) -> _Cell:
    found = comparison.variants[index]
    numbers = [] if found.ms is None else [measure.time_text(found.ms)]
    if found.rmse is not None:
        numbers += [f"RMSE {found.rmse:.2f}", f"max {found.largest}"]
    if "triangles" in found.facts:
        numbers.append(f"{found.facts['triangles']:,.0f} triangles")
    if "truth_rms" in found.facts:
        numbers.append(f"{found.facts['truth_rms']:.3g} mm RMS from the truth")
    pictures = [found.image.pixels]
    if gain and found.reference is not None:
        apart = measure.difference(found.image, comparison.references[found.reference].image)
        pictures.append(_visible(apart, gain))
    return _Cell(tuple(pictures), found.variant.label, tuple(numbers))


def _reference(comparison: Comparison, *, stacked: bool) -> _Cell:
    (reference,) = comparison.references
    return _Cell((reference.image.pixels,), "reference", tuple(reference.label.split(" · ")))


def _gain(comparison: Comparison) -> int:
    """A power of two that makes all but the largest fiftieth of the differences visible."""
    worst = 0.0
    for found in comparison.variants:
        if found.reference is not None:
            apart = measure.difference(found.image, comparison.references[found.reference].image)
            worst = max(worst, float(np.percentile(apart.max(axis=-1), 98.0)))
    if worst <= 0:
        return MOST_GAIN
    return int(min(max(2 ** math.floor(math.log2(BRIGHT / worst)), 1), MOST_GAIN))


def _visible(apart: NDArray[np.uint8], gain: int) -> NDArray[np.uint8]:
    colors = np.minimum(apart.astype(np.int32) * gain, 255).astype(np.uint8)
    return np.dstack([colors, np.full(colors.shape[:2], 255, np.uint8)])


def _heading(comparison: Comparison) -> str:
    return safe_text(comparison.scene.volume.name or "volume", 200)


def _sentence(comparison: Comparison) -> str:
    parts = [f"{a.short}: {', '.join(a.texts)}" for a in comparison.axes]
    return safe_text("  ·  ".join(parts), 2000)


# --- how it is laid out --------------------------------------------------------------------------


def _planned(
    comparison: Comparison, cells: list[_Cell], feet: list[str]
) -> tuple[_Plan, list[tuple[list[str], list[str]]], list[str]]:
    """The plan; titles and lines of each cell as they fit its width; the feet likewise."""
    width, height = comparison.size
    wide = max(width, NARROWEST)
    em = min(max(wide / 21, LEAST), MOST)
    counts = [len(a.values) for a in comparison.axes]
    stacked = max(len(c.pictures) for c in cells)
    aspect = wide / (height * stacked + 4 * em)
    columns = columns_of(counts, len(cells) - math.prod(counts), aspect)
    plain, bold = _font(em), _font(em, bold=True)
    wrapped = [
        (_folded(c.title, " · ", bold, wide), _folded(" · ".join(c.lines), " · ", plain, wide))
        for c in cells
    ]
    small = _font(em * 0.86)
    room = columns * wide + (columns - 1) * round(em * 1.3)
    feet = [line for foot in feet for line in _folded(foot, " ", small, room)]
    heads = len(_folded(_sentence(comparison), " ", plain, room))
    plan = _Plan(
        (width, height),
        columns,
        math.ceil(len(cells) / columns),
        stacked,
        em,
        max(len(titles) for titles, _ in wrapped),
        max(len(lines) for _, lines in wrapped),
        heads,
        len(feet),
    )
    check_size(plan.size)
    return plan, wrapped, feet


def _painted(
    comparison: Comparison,
    plan: _Plan,
    cells: list[_Cell],
    wrapped: list[tuple[list[str], list[str]]],
    feet: list[str],
) -> NDArray[np.uint8]:
    from PIL import Image as Pillow
    from PIL import ImageDraw

    sheet = Pillow.new("RGBA", plan.size, (*GROUND, 255))
    pen = ImageDraw.Draw(sheet)
    left, width = plan.gap, plan.size[0] - 2 * plan.gap
    title = _font(plan.font * 1.5, bold=True)
    pen.text((left, plan.gap), _cut(_heading(comparison), title, width), TEXT, title)
    y = plan.gap + round(plan.font * 2.2)
    plain = _font(plan.font)
    lines = _folded(_sentence(comparison), " ", plain, width)
    _write(pen, (left, y), lines, (plain, FAINT), plan.line)
    for i, (cell, (titles, lines)) in enumerate(zip(cells, wrapped, strict=True)):
        x, y = plan.corner(i)
        for picture in cell.pictures:
            sheet.alpha_composite(Pillow.fromarray(np.ascontiguousarray(picture)), (x, y))
            y += plan.picture[1] + plan.gap // 3
        y = plan.corner(i)[1] + plan.pictures_tall + plan.gap // 2
        if i >= len(comparison.variants):  # the reference: beside its one picture there is room
            y = plan.corner(i)[1] + plan.picture[1] + plan.gap // 2
        tint = TEXT if i < len(comparison.variants) else ACCENT
        y = _write(pen, (x, y), titles, (_font(plan.font, bold=True), tint), plan.line)
        _write(pen, (x, y), lines, (plain, FAINT), plan.line)
    y = plan.top + plan.rows * (plan.tall + plan.gap)
    _write(pen, (left, y), feet, (_font(plan.font * 0.86), FAINT), plan.line)
    return np.asarray(sheet)


def _write(
    pen: ImageDraw,
    at: tuple[int, int],
    lines: list[str],
    style: tuple[FreeTypeFont, Color],
    line: int,
) -> int:
    """Lines below each other, so far apart; the y below them."""
    face, color = style
    for text in lines:
        pen.text(at, text, color, face)
        at = (at[0], at[1] + line)
    return at[1]


def _font(size: float, *, bold: bool = False) -> FreeTypeFont:
    from PIL import ImageFont

    path = font(bold=bold)
    if path is None:
        return ImageFont.load_default(round(size))  # type: ignore[return-value]  # with FreeType it is
    return ImageFont.truetype(str(path), round(size))


def _folded(text: str, between: str, face: FreeTypeFont, width: int) -> list[str]:
    """Lines of at most this width, broken between parts; a part that is longer is cut."""
    lines: list[str] = []
    for part in text.split(between) if text else []:
        longer = f"{lines[-1]}{between}{part}" if lines else part
        if lines and face.getlength(longer) <= width:
            lines[-1] = longer
        else:
            lines.append(_cut(part, face, width))
    return lines


def _cut(text: str, face: FreeTypeFont, width: int) -> str:
    """The text, or as much of it as fits with an ellipsis."""
    if face.getlength(text) <= width:
        return text
    while text and face.getlength(text + "…") > width:
        text = text[:-1]
    return text + "…"
