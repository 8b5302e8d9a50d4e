"""Window and level over the view: Shift and right drag, as the right drag over the plot."""

from __future__ import annotations

from volviz.model.transfer import TransferFunction
from volviz.ui.im import imgui
from volviz.ui.transfer_state import Drag
from volviz.ui.value_axis import Axis

ACROSS = 400.0
"""Pixels to drag upwards for the whole range of the points, at a font of 16 pixels."""


class Leveling:
    """The gesture under way, if there is one: every frame is made anew from its start."""

    def __init__(self) -> None:
        self._drag: Drag | None = None

    def dragged(self, transfer: TransferFunction) -> TransferFunction:
        """What the mouse makes of it: wider to the right, higher values upwards."""
        io, scale = imgui.get_io(), imgui.get_font_size() / 16
        if self._drag is None:
            at = io.mouse_pos.x - io.mouse_delta.x, io.mouse_pos.y - io.mouse_delta.y
            axis = Axis(0.0, ACROSS * scale, *transfer.domain)
            self._drag = Drag("window", transfer, at, 1, axis, 1.0)
        return self._drag.result((io.mouse_pos.x, io.mouse_pos.y), log=False, scale=scale)

    def end(self) -> None:
        """The button is up."""
        self._drag = None
