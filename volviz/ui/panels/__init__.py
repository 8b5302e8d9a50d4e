"""The panels: each is `panel(scene, facts) -> scene`, in a file of its own."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from volviz.ui import transfer_editor
from volviz.ui.facts import Panel
from volviz.ui.panels import (
    compare,
    data,
    history,
    log,
    performance,
    presets,
    rendering,
    span,
    surfaces,
    view,
)


@dataclass(frozen=True)
class Entry:
    """A panel of the window. area: where it is docked at first. tab: a shorter title, for there."""

    title: str
    function: Panel
    area: Literal["left", "right", "bottom"]
    tab: str = ""


PANELS: dict[str, Entry] = {
    "data": Entry("Data", data.panel, "left"),
    "history": Entry("History", history.panel, "left"),
    "transfer": Entry("Transfer function", transfer_editor.panel, "right"),
    "presets": Entry("Presets", presets.panel, "right"),
    "surfaces": Entry("Surfaces", surfaces.panel, "right"),
    "rendering": Entry("Rendering", rendering.panel, "right"),
    "view": Entry("View", view.panel, "right"),
    "compare": Entry("Compare", compare.panel, "right"),
    "span": Entry("Span space", span.panel, "right", tab="Span"),
    "log": Entry("Log", log.panel, "bottom"),
    "performance": Entry("Performance", performance.panel, "bottom"),
}
