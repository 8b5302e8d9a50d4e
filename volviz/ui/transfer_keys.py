"""Keys of the transfer-function editor, while its panel has the focus."""

from __future__ import annotations

from volviz.model.transfer import TransferFunction
from volviz.ui import control_points as cp
from volviz.ui.im import imgui
from volviz.ui.transfer_state import NONE, EditorState
from volviz.ui.value_axis import Axis

HEIGHT_STEP = 0.01
"""The part of the opacity axis that an arrow moves by."""
MORE = 10.0
"""Times as far with Shift."""
ARROWS: dict[imgui.Key, tuple[float, float]] = {
    imgui.Key.left_arrow: (-1.0, 0.0),
    imgui.Key.right_arrow: (1.0, 0.0),
    imgui.Key.up_arrow: (0.0, 1.0),
    imgui.Key.down_arrow: (0.0, -1.0),
}


def pressed(state: EditorState, transfer: TransferFunction, axis: Axis) -> TransferFunction:
    """What the keys of this frame make of the points that are selected."""
    if imgui.is_key_pressed(imgui.Key.escape, False):
        state.opacities = state.colors = NONE
    if any(imgui.is_key_pressed(k, False) for k in (imgui.Key.delete, imgui.Key.backspace)):
        return state.deleted(transfer)
    factor = MORE if imgui.get_io().key_shift else 1.0
    for key, (right, up) in ARROWS.items():
        if imgui.is_key_pressed(key):
            transfer = _nudged(state, transfer, axis, right * factor, up * factor)
    return transfer


def _nudged(
    state: EditorState, transfer: TransferFunction, axis: Axis, right: float, up: float
) -> TransferFunction:
    """The selected points moved by so many pixels to the right and steps up."""
    delta = cp.neat(right * axis.per_pixel, axis.per_pixel)
    opacities = cp.moved(transfer.opacities, state.opacities, delta)
    opacities = cp.raised(opacities, state.opacities, up * HEIGHT_STEP, log=state.log_opacity)
    transfer = cp.with_opacities(transfer, opacities)
    return cp.with_colors(transfer, cp.moved(transfer.colors, state.colors, delta))
