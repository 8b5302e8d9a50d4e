"""Tooltips, and the list of the widgets that were drawn, by which tests find them."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field

from volviz.ui.im import imgui


@dataclass
class Watch:
    """Widgets drawn while watched. where: their rectangles (left, top, right, bottom) by id."""

    ids: list[tuple[int, str]] = field(default_factory=list)
    tips: dict[str, str] = field(default_factory=dict)
    where: dict[str, tuple[float, float, float, float]] = field(default_factory=dict)


_watches: list[Watch] = []


@contextmanager
def watch() -> Iterator[Watch]:
    """Lists every widget that is drawn meanwhile."""
    seen = Watch()
    _watches.append(seen)
    try:
        yield seen
    finally:
        _watches.remove(seen)


def tip(id_: str, text: str, *, show: bool = True) -> None:
    """A tooltip for the widget just drawn. show: False where it would be in the way now."""
    for seen in _watches:
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        seen.ids.append((imgui.get_item_id(), id_))
        seen.tips[id_] = text
        seen.where[id_] = (low.x, low.y, high.x, high.y)
    flags = imgui.HoveredFlags_.for_tooltip | imgui.HoveredFlags_.allow_when_disabled
    if show and imgui.is_item_hovered(flags) and imgui.begin_tooltip():
        imgui.push_text_wrap_pos(28 * imgui.get_font_size())
        imgui.text_unformatted(text)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()
