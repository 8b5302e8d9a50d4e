"""Span space as a picture: cells by least and greatest value, and what a query looks at.

How many cells a bin has is its brightness, logarithmic; what the search did there is its colour.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from volviz.ui import painting, theme, tips, widgets
from volviz.ui.im import ImVec2, imgui, implot

if TYPE_CHECKING:
    from volviz.isosurface.span_space import SpanSpace
    from volviz.isosurface.visits import Visits

TEXT = """Every cell is a point: its least value to the right, its greatest upwards.
Active are those in the rectangle, whose corner is the isovalue.
Drag or click: the corner, and with it the isovalue, follows along the diagonal.
The outermost bins also hold what lies beyond the axes."""
SHADES = 48
"""Of brightness, per colour."""
KINDS = ("rest", "tested", "reported")
COLORS = {
    "rest": {"dark": (0.62, 0.66, 0.72), "light": (0.36, 0.4, 0.46)},
    "tested": {"dark": (0.98, 0.66, 0.22), "light": (0.75, 0.42, 0.0)},
    "reported": {"dark": (0.35, 0.78, 0.62), "light": (0.0, 0.5, 0.36)},
}
NAMES = {
    "rest": "not looked at",
    "tested": "tested",
    "reported": "taken untested",
}
ABOUT = {
    "rest": "Bins of which the finder looks at no cell.",
    "tested": "Bins in which most cells that the finder looks at are compared with the isovalue.",
    "reported": "Bins in which most cells that the finder looks at are active and are taken with "
    "others, without a test of their own.",
}
TALLEST = 24.0
"""Of the plot, in font sizes."""


def kinds(
    counts: NDArray[np.int64], tested: NDArray[np.int64], reported: NDArray[np.int64]
) -> NDArray[np.int64]:
    """int64[high, low]: number in KINDS per bin, −1 where there is no cell."""
    kind = np.where(reported >= np.maximum(tested, 1), 2, np.where(tested > 0, 1, 0))
    return np.where(counts > 0, kind, -1)


def codes(space: SpanSpace, seen: Visits | None) -> NDArray[np.float64]:
    """float64[high, low], the highest row first: place of each bin in `_colormap`."""
    counts = space.counts
    none = np.zeros_like(counts)
    pair = (none, none) if seen is None else (seen.tested, seen.reported)
    kind = kinds(counts, *pair)
    tall = np.log1p(counts) / max(np.log1p(counts.max(initial=0)), 1e-9)
    shade = np.minimum((SHADES * tall).astype(np.int64), SHADES - 1)
    code = np.where(kind < 0, 0, 1 + kind * SHADES + shade)
    return np.ascontiguousarray(code[::-1] + 0.5, dtype=np.float64)


def draw(
    id_: str,
    space: SpanSpace,
    seen: Visits | None,
    isovalue: float | None,
    *,
    color: Sequence[float],
    unit: str | None,
) -> float | None:
    """The plot; the isovalue that the mouse drags it to, None where it does not.

    isovalue: where the rectangle stands. color: of the surface. unit: of the values.
    """
    low, high = float(space.edges[0]), float(space.edges[-1])
    width = imgui.get_content_region_avail().x
    height = min(max(width * 0.86, widgets.em(9)), widgets.em(TALLEST))
    quiet = implot.Flags_.canvas_only | implot.Flags_.no_inputs | implot.Flags_.no_frame
    if not implot.begin_plot(f"###{id_}.axes", ImVec2(width, height), quiet):
        return None
    text = f", {unit}" if unit else ""
    plain = implot.AxisFlags_.no_grid_lines | implot.AxisFlags_.no_menus
    implot.setup_axes(f"least value of a cell{text}", f"greatest value{text}", plain, plain)
    implot.setup_axes_limits(low, high, low, high, implot.Cond_.always)
    table, ends = _colormap(), 1.0 + len(KINDS) * SHADES
    implot.push_colormap(table)
    points = implot.Point(low, low), implot.Point(high, high)
    implot.plot_heatmap(f"###{id_}.bins", codes(space, seen), 0.0, ends, "", *points)
    implot.pop_colormap()
    place, extent = implot.get_plot_pos(), implot.get_plot_size()
    if isovalue is not None:
        _rectangle(space, isovalue, color)
    mouse = implot.get_plot_mouse_pos()
    implot.end_plot()
    return _hand(id_, place, extent, ((mouse.x + mouse.y) / 2, low, high))


def legend(seen: Visits | None, cells: int) -> None:
    """What the colours are, with how many cells have each."""
    counts = [0, 0, 0]
    if seen is not None:
        counts[1], counts[2] = int(seen.tested.sum()), int(seen.reported.sum())
    counts[0] = max(cells - counts[1] - counts[2], 0)
    size = widgets.em(0.8)
    for i, kind in enumerate(KINDS):
        text = f"{counts[i]:,} {NAMES[kind]}"
        if i:
            widgets.beside(text, box=True)
        corner, line = imgui.get_cursor_screen_pos(), imgui.get_text_line_height()
        top = corner.y + (line - size) / 2
        paint = theme.packed(COLORS[kind][theme.name()])
        end = ImVec2(corner.x + size, top + size)
        imgui.get_window_draw_list().add_rect_filled(ImVec2(corner.x, top), end, paint, size / 5)
        imgui.dummy(ImVec2(size, line))
        imgui.same_line()
        imgui.text_unformatted(text)
        tips.tip(f"span.legend.{kind}", ABOUT[kind])


def _colormap() -> Any:
    """Nothing, then the shades of each kind in the theme in use."""
    name = f"volviz span {theme.name()}"
    known = implot.get_colormap_index(name)
    if known >= 0:
        return known
    faint = np.linspace(0.28, 1.0, SHADES)
    parts = [
        painting.packed(np.tile(COLORS[kind][theme.name()], (SHADES, 1)), faint) for kind in KINDS
    ]
    table = np.concatenate([[0], *parts]).astype(np.uint32)
    return implot.add_colormap(name, table, True)


def _rectangle(space: SpanSpace, isovalue: float, color: Sequence[float]) -> None:
    """The query: cells that begin below the isovalue and end at it or above."""
    left, corner, _, top = space.rectangle(isovalue)
    low, high = (implot.plot_to_pixels(x, y) for x, y in ((left, top), (corner, corner)))
    end = implot.plot_to_pixels(space.edges[-1], space.edges[-1])
    start = implot.plot_to_pixels(space.edges[0], space.edges[0])
    list_ = implot.get_plot_draw_list()
    implot.push_plot_clip_rect()
    ink = imgui.get_color_u32(imgui.Col_.text)
    list_.add_line(start, end, imgui.get_color_u32(imgui.Col_.text, 0.35), 1.0)
    list_.add_rect_filled(low, high, imgui.get_color_u32(imgui.Col_.text, 0.05))
    list_.add_rect(low, high, ink, 0.0, max(widgets.em(0.1), 1.0))
    list_.add_circle_filled(high, widgets.em(0.42), ink)
    paint = int(painting.packed(np.array([color]))[0])
    list_.add_circle_filled(high, widgets.em(0.3), paint)
    implot.pop_plot_clip_rect()


def _hand(id_: str, place: Any, extent: Any, under: tuple[float, float, float]) -> float | None:
    """The mouse on the plot. under: the value below it on the diagonal, the ends of the axes."""
    after = imgui.get_cursor_screen_pos()
    imgui.set_cursor_screen_pos(place)
    imgui.invisible_button(f"###{id_}", ImVec2(max(extent.x, 1.0), max(extent.y, 1.0)))
    held = imgui.is_item_active()
    tips.tip(id_, TEXT, show=not held)
    if held or imgui.is_item_hovered():
        imgui.set_mouse_cursor(imgui.MouseCursor_.resize_nesw)
    imgui.set_cursor_screen_pos(after)
    imgui.dummy(ImVec2(0, 0))
    if not (held and (imgui.is_mouse_dragging(0, 0.0) or imgui.is_item_activated())):
        return None
    value, low, high = under
    return widgets.rounded(min(max(value, low), high))
