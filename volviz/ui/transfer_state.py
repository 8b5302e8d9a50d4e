"""What the transfer-function editor remembers between frames, and what a drag makes of it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal
from weakref import ReferenceType, ref

from volviz.fields.statistics import Statistics
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume
from volviz.ui import control_points as cp
from volviz.ui import value_axis
from volviz.ui.control_points import Indices
from volviz.ui.value_axis import Axis, Span

Kind = Literal["opacities", "colors", "shift", "window", "box"]
DOUBLING = 150.0
"""Pixels to drag sideways to double the width of the window, at a font of 16 pixels."""
NONE: Indices = frozenset()


@dataclass(frozen=True)
class Drag:
    """A gesture under way. start: what was there when the button went down; every frame is made
    anew from it, so that nothing drifts and the way back leads back. at: where, in pixels."""

    kind: Kind
    start: TransferFunction
    at: tuple[float, float]
    button: int
    axis: Axis
    height: float
    opacities: Indices = NONE
    colors: Indices = NONE
    pressed: int | None = None

    def result(self, mouse: tuple[float, float], *, log: bool, scale: float) -> TransferFunction:
        """The transfer function with the mouse at these pixels. scale: font size / 16."""
        dx, dy = mouse[0] - self.at[0], self.at[1] - mouse[1]
        delta = cp.neat(dx * self.axis.per_pixel, self.axis.per_pixel)
        if self.kind == "shift":
            return cp.shifted(self.start, delta) if dx else self.start
        if self.kind == "window":
            widen = 2.0 ** min(max(dx / (DOUBLING * scale), -30.0), 30.0)
            level = cp.neat(dy * self.axis.per_pixel, self.axis.per_pixel)
            return cp.windowed(self.start, widen, level) if dx or dy else self.start
        if self.kind == "box":
            return self.start
        opacities = cp.moved(self.start.opacities, self.opacities, delta)
        if self.kind == "opacities":
            opacities = cp.raised(opacities, self.opacities, dy / self.height, log=log)
        moved = cp.with_opacities(self.start, opacities)
        return cp.with_colors(moved, cp.moved(self.start.colors, self.colors, delta))


@dataclass
class EditorState:
    """Selected points, how the axes are shown, and the drag under way. left: the transfer
    function as the editor left it: what differs was changed by others (undo, a preset). typed: a
    range that is not one yet."""

    opacities: Indices = NONE
    colors: Indices = NONE
    log_counts: bool = True
    log_opacity: bool = False
    drag: Drag | None = None
    typed: tuple[float, float] | None = None
    span: Span | None = None
    axis: Axis | None = None
    picking: bool = False
    left: TransferFunction | None = None
    _volume: ReferenceType[Volume] | None = None
    _counted: bool = field(default=False)

    def look_at(self, volume: Volume, transfer: TransferFunction, facts: Statistics | None) -> None:
        """Begin anew with another volume (or when its values have been counted)."""
        same = self._volume is not None and self._volume() is volume
        if not same:
            self.opacities = self.colors = NONE
            self.drag = None
        if not same or self._counted != (facts is not None):
            self._volume, self._counted = ref(volume), facts is not None
            self.span = value_axis.fitted_span(transfer, facts)
        elif self.left is not None and self.left.domain != transfer.domain and self._lost(transfer):
            self.span = value_axis.fitted_span(transfer, facts)
        self.opacities = frozenset(i for i in self.opacities if i < len(transfer.opacities))
        self.colors = frozenset(i for i in self.colors if i < len(transfer.colors))

    def _lost(self, transfer: TransferFunction) -> bool:
        """True if the axis does not show all points, or only how they stand close together."""
        low, high = transfer.domain
        axis = self.axis
        if axis is None or axis.low > low or axis.high < high:
            return True
        return high - low < 0.1 * (axis.high - axis.low)

    def select(self, which: Literal["opacities", "colors"], index: int, *, more: bool) -> bool:
        """Click on a point: select it alone, or with `more` add it or take it away. Clicking one
        of several leaves them selected. True if the point is selected then."""
        chosen: Indices = getattr(self, which)
        if more:
            setattr(self, which, chosen ^ {index})
        elif index not in chosen:
            self.opacities = self.colors = NONE
            setattr(self, which, frozenset({index}))
        return index in getattr(self, which)

    def deleted(self, transfer: TransferFunction) -> TransferFunction:
        """The transfer function without the selected points."""
        transfer = cp.with_opacities(transfer, cp.removed(transfer.opacities, self.opacities))
        transfer = cp.with_colors(transfer, cp.removed(transfer.colors, self.colors))
        self.opacities = self.colors = NONE
        return transfer
