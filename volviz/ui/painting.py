"""What the transfer-function editor draws: histogram, coloured curve, points, ruler, colour bar."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.classify.hounsfield import HOUNSFIELD
from volviz.fields.statistics import Statistics
from volviz.model.transfer import TransferFunction
from volviz.ui import value_axis
from volviz.ui.control_points import height_of
from volviz.ui.im import ImVec2, imgui
from volviz.ui.value_axis import Axis

POINT = 0.36
"""Radius of a control point, in font sizes."""


@dataclass(frozen=True)
class Pane:
    """A rectangle of pixels with the value axis along it."""

    axis: Axis
    top: float
    height: float

    @property
    def bottom(self) -> float:
        """The lower edge, in pixels."""
        return self.top + self.height

    def rise(self, heights: NDArray[np.float64]) -> NDArray[np.float64]:
        """Heights 0..1 as pixels."""
        return self.bottom - self.height * heights


def packed(rgb: NDArray[np.float64], alpha: NDArray[np.float64] | float = 1.0) -> NDArray[np.int64]:
    """int64[n]: sRGB float[n, 3] and opacity as imgui's draw lists take them."""
    codes = np.rint(np.clip(rgb, 0, 1) * 255).astype(np.int64)
    opaque = np.rint(np.clip(np.broadcast_to(alpha, codes.shape[:1]), 0, 1) * 255).astype(np.int64)
    packed_: NDArray[np.int64] = codes[:, 0] | codes[:, 1] << 8 | codes[:, 2] << 16 | opaque << 24
    return packed_


def histogram(draw: Any, pane: Pane, statistics: Statistics, *, log: bool) -> None:
    """Columns of two pixels behind everything."""
    axis = pane.axis
    count = max(int(axis.width / 2), 1)
    columns = value_axis.bars(statistics, (axis.low, axis.high), count)
    tops = pane.rise(0.96 * value_axis.heights(columns, log=log))
    ends = axis.left + axis.width / count * np.arange(count + 1)
    paint = imgui.get_color_u32(imgui.Col_.text, 0.17)
    for i in np.flatnonzero(columns):
        draw.add_rect_filled(ImVec2(ends[i], tops[i]), ImVec2(ends[i + 1], pane.bottom), paint)
    corners = zip(np.repeat(ends, 2)[1:-1], np.repeat(tops, 2), strict=True)
    edge = imgui.get_color_u32(imgui.Col_.text, 0.3)
    draw.add_polyline([ImVec2(float(x), float(y)) for x, y in corners], edge, 1.0, 0)


def area(draw: Any, pane: Pane, transfer: TransferFunction, *, log: bool) -> None:
    """What lies under the curve, in the colours of the values: upright strips of two pixels."""
    axis = pane.axis
    count = max(int(axis.width / 2), 1)
    ends = np.rint(np.linspace(axis.left, axis.left + axis.width, count + 1))
    middles = axis.low + (axis.high - axis.low) * (np.arange(count) + 0.5) / count
    tops = pane.rise(height_of(transfer.opacity_at(middles), log=log))
    colors = packed(transfer.color_at(middles), 0.55)
    for i in np.flatnonzero(tops < pane.bottom - 0.25):
        low, high = ImVec2(ends[i], tops[i]), ImVec2(ends[i + 1], pane.bottom)
        draw.add_rect_filled(low, high, int(colors[i]))


def curve(draw: Any, pane: Pane, transfer: TransferFunction, *, log: bool) -> None:
    """The line of the opacity over the values: its corners, and samples between them."""
    axis = pane.axis
    count = max(int(axis.width / 3), 2)
    even = np.linspace(axis.low, axis.high, count)
    own = np.array(transfer.opacities)
    inside = (own[:, 0] > axis.low) & (own[:, 0] < axis.high)
    if inside.sum() > 2 * axis.width:  # more points than pixels: samples say as much
        inside[:] = False
    between = even[~np.isin(even, own[:, 0])]
    values = np.concatenate([between, own[inside, 0]])
    opacities = np.concatenate([transfer.opacity_at(between), own[inside, 1]])
    order = np.argsort(values, kind="stable")  # two points at one value: an upright step
    x = axis.pixels(values[order])
    y = pane.rise(height_of(opacities[order], log=log))
    line = [ImVec2(float(a), float(b)) for a, b in zip(x, y, strict=True)]
    paint = imgui.get_color_u32(imgui.Col_.text, 0.9)
    draw.add_polyline(line, paint, max(imgui.get_font_size() * 0.11, 1.0), 0)


def opacity_marks(pane: Pane, transfer: TransferFunction, *, log: bool) -> NDArray[np.float64]:
    """float64[n, 2]: where the opacity points stand, in pixels."""
    points = np.array(transfer.opacities)
    heights = pane.rise(height_of(points[:, 1], log=log))
    return np.stack([pane.axis.pixels(points[:, 0]), heights], axis=1)


def color_marks(pane: Pane, transfer: TransferFunction) -> NDArray[np.float64]:
    """float64[n, 2]: where the colour points stand, in pixels."""
    x = pane.axis.pixels([p[0] for p in transfer.colors])
    return np.stack([x, np.full(x.size, pane.top + pane.height / 2)], axis=1)


def points(
    draw: Any,
    places: NDArray[np.float64],
    fills: NDArray[np.int64],
    selected: frozenset[int],
    hovered: int | None,
) -> None:
    """Round points: ringed, those selected in the accent colour, larger under the mouse.

    Of points that would hide each other (labels have thousands) only one is drawn.
    """
    radius = POINT * imgui.get_font_size()
    ring = imgui.get_color_u32(imgui.Col_.text)
    dark = imgui.get_color_u32(imgui.Col_.window_bg)
    accent = imgui.get_color_u32(imgui.Col_.check_mark)
    cells = np.rint(places / (0.5 * radius))
    _, kept = np.unique(cells, axis=0, return_index=True)
    crowded = kept.size > 60
    shown: set[int] = {*kept.tolist(), *sorted(selected)[:500]}
    if hovered is not None:
        shown.add(hovered)
    for i in sorted(shown):
        size = radius * (1.25 if i == hovered else 0.5 if crowded else 1.0)
        middle = ImVec2(float(places[i, 0]), float(places[i, 1]))
        if i in selected:
            draw.add_circle_filled(middle, size * 1.5, accent)
        draw.add_circle_filled(middle, size * 1.15, dark)
        draw.add_circle_filled(middle, size, ring)
        draw.add_circle_filled(middle, size * 0.72, int(fills[i]))


def color_bar(draw: Any, pane: Pane, transfer: TransferFunction) -> None:
    """The colours along the values."""
    axis = pane.axis
    count = max(int(axis.width / 4), 2)
    own = [p[0] for p in transfer.colors if axis.low < p[0] < axis.high]
    if len(own) > axis.width / 2:  # more points than pixels: samples say as much
        count, own = int(axis.width), []
    values = np.unique(np.concatenate([np.linspace(axis.low, axis.high, count), own]))
    x, codes = axis.pixels(values), packed(transfer.color_at(values))
    for i in range(values.size - 1):
        a, b = int(codes[i]), int(codes[i + 1])
        low, high = ImVec2(x[i], pane.top), ImVec2(x[i + 1], pane.bottom)
        draw.add_rect_filled_multi_color(low, high, a, b, b, a)
    frame = imgui.get_color_u32(imgui.Col_.border)
    draw.add_rect(ImVec2(axis.left, pane.top), ImVec2(axis.left + axis.width, pane.bottom), frame)


def ruler(draw: Any, pane: Pane, offset: float) -> None:
    """The materials of the Hounsfield table: a band each, with its name where there is room."""
    axis, size = pane.axis, imgui.get_font_size()
    free = [axis.left - size]
    frame = imgui.get_color_u32(imgui.Col_.text_disabled)
    paint = imgui.get_color_u32(imgui.Col_.text, 0.8)
    edge = imgui.get_color_u32(imgui.Col_.text, 0.35)
    band = pane.height * 0.3
    for material in HOUNSFIELD:
        low, high = (float(axis.pixels(v + offset)) for v in _ends(material.low, material.high))
        left, right = max(low, axis.left), min(max(high, low + 2), axis.left + axis.width)
        if right <= left:
            continue
        fill = int(packed(np.array([material.rgb]))[0])
        corner, end = ImVec2(left, pane.top), ImVec2(right, pane.top + band)
        draw.add_rect_filled(corner, end, fill)
        if right - left > 3:
            draw.add_rect(corner, end, edge)
        width = imgui.calc_text_size(material.name).x
        start = (left + right - width) / 2
        if start > free[-1] + 0.6 * size and start + width < axis.left + axis.width:
            draw.add_text(ImVec2(start, pane.top + band), paint, material.name)
            free.append(start + width)
    y = pane.top + band
    draw.add_line(ImVec2(axis.left, y), ImVec2(axis.left + axis.width, y), frame)


def materials_at(value: float, offset: float, reach: float) -> str:
    """Names and ranges of the materials at a value (and `reach` around), a line each."""
    hu = value - offset
    found = [m for m in HOUNSFIELD if m.low - reach <= hu <= m.high + reach]
    lines = [f"{hu:.0f} HU"]
    for m in found:
        span = f"{m.low:g}" if m.low == m.high else f"{m.low:g} to {m.high:g}"
        lines.append(f"{m.name}: {span.replace('to inf', 'and more')} HU")
    return "\n".join(lines)


def _ends(low: float, high: float) -> tuple[float, float]:
    return low, high if high < 1e6 else 1e6
