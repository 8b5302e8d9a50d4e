"""What the 3D view tells over its picture: reduced, a broken shader, work under way."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from volviz.model.frame import Frame
from volviz.model.scene import SceneState
from volviz.model.volume import Volume
from volviz.resolve import TextureLimits, statistics_at_hand
from volviz.text import binary_size
from volviz.ui import theme
from volviz.ui.im import ImVec2, icons, imgui


@dataclass(frozen=True)
class Badge:
    """A short text in a corner of the view, and what to say when the mouse is over it."""

    text: str
    about: str
    level: str = "warning"


def reduced(
    volume: Volume, frame: Frame, limits: TextureLimits, out_of_memory: str | None
) -> Badge | None:
    """What is shown instead of all samples, why, and what helps; None if all are shown.

    out_of_memory: what the graphics said when they could not take more.
    """
    shown = frame.voxels.dims
    if shown == volume.dims:
        return None
    factors = [math.ceil(n / m) for n, m in zip(volume.dims, shown, strict=True)]
    parts = " × ".join("1" if f == 1 else f"1/{f}" for f in factors)
    counts = [" × ".join(str(n) for n in dims) for dims in (shown, volume.dims)]
    if out_of_memory is not None:
        why = f"{out_of_memory}."
        fix = "Close other programs that use the graphics, then open the file again."
    elif max(volume.dims) > limits.max_dim:
        why = f"This OpenGL takes at most {limits.max_dim} samples along an axis."
        fix = "Open a part of the volume, or use another graphics device (volviz doctor)."
    else:
        why = f"A volume takes at most {binary_size(limits.max_bytes)} on this OpenGL."
        fix = "Open a part of the volume, or use a graphics card with more memory."
    about = (
        f"{counts[0]} of {counts[1]} samples are shown: means of blocks.\n{why}\n{fix}\n"
        "Histogram and ranges are those of all samples."
    )
    return Badge(f"shown at {parts}", about)


def nothing_seen(scene: SceneState, frame: Frame) -> Badge | None:
    """Why the picture is empty, and what helps; None where something can be seen."""
    if frame.meshes:
        return None
    if not scene.raycast.show_volume:
        about = "The volume is hidden and no surface is shown.\nRendering: Show volume."
        return Badge("nothing is shown", about, "info")
    facts = statistics_at_hand(scene.volume)
    if facts is not None and not facts.count:
        return Badge("no voxel holds a number", "Every voxel is NaN, infinite or padding.")
    if frame.emptiness is None or frame.emptiness.shown:
        return None
    about = (
        "The transfer function gives no opacity to any value of this volume.\n"
        "Raise its points, move them (Ctrl+drag in the plot), or choose a preset."
    )
    return Badge("nothing is opaque", about, "info")


def broken_shaders(errors: list[str]) -> Badge | None:
    """That changed shaders do not compile."""
    if not errors:
        return None
    where = errors[0].split(": ", 1)[0]
    more = f" and {len(errors) - 1} more" if len(errors) > 1 else ""
    about = "\n\n".join([*errors, "The last good shaders draw on; save the mended file."])
    return Badge(f"{where}{more}", about, "error")


def badges(found: list[Badge], corner: tuple[float, float]) -> None:
    """Draw them below each other from a corner of the view. corner: x, y on the screen."""
    em = imgui.get_font_size()
    x, y = corner[0] + 0.7 * em, corner[1] + 0.7 * em
    for badge in found:
        mark = _MARKS[badge.level]
        bottom = _pill(
            (x, y), f"{mark}  {badge.text}", theme.LEVELS[badge.level][theme.name()], badge.about
        )
        y = bottom + 0.4 * em


def progress(title: str, fraction: float | None, place: tuple[float, float, float]) -> None:
    """A bar with a title. place: x of the middle, y of the top, most width, on the screen."""
    draw = imgui.get_window_draw_list()
    em = imgui.get_font_size()
    width = min(18 * em, place[2] - 2 * em)
    if width < 4 * em:
        return
    left, top = place[0] - width / 2, place[1]
    low, high = ImVec2(left, top), ImVec2(left + width, top + 2.9 * em)
    draw.add_rect_filled(low, high, imgui.get_color_u32(imgui.Col_.popup_bg, 0.94), 0.4 * em)
    draw.add_rect(low, high, imgui.get_color_u32(imgui.Col_.border), 0.4 * em)
    text = title if fraction is None else f"{title}  {fraction:.0%}"
    ink = imgui.get_color_u32(imgui.Col_.text)
    draw.push_clip_rect(low, high, True)
    draw.add_text(ImVec2(left + 0.8 * em, top + 0.55 * em), ink, text)
    draw.pop_clip_rect()
    a, b = left + 0.8 * em, left + width - 0.8 * em
    y = top + 2.0 * em
    ground = imgui.get_color_u32(imgui.Col_.frame_bg)
    draw.add_rect_filled(ImVec2(a, y), ImVec2(b, y + 0.35 * em), ground, 0.17 * em)
    end = a + (b - a) * min(max(fraction or 0.0, 0.0), 1.0)
    full = imgui.get_color_u32(imgui.Col_.plot_histogram)
    draw.add_rect_filled(ImVec2(a, y), ImVec2(end, y + 0.35 * em), full, 0.17 * em)


_MARKS = {
    "info": icons.ICON_FA_CIRCLE_INFO,
    "warning": icons.ICON_FA_TRIANGLE_EXCLAMATION,
    "error": icons.ICON_FA_CIRCLE_XMARK,
}


def _pill(corner: tuple[float, float], text: str, tint: Any, about: str) -> float:
    """Draw one badge; the y below it."""
    draw = imgui.get_window_draw_list()
    em = imgui.get_font_size()
    size = imgui.calc_text_size(text)
    low = ImVec2(*corner)
    high = ImVec2(low.x + size.x + em, low.y + size.y + 0.5 * em)
    draw.add_rect_filled(low, high, imgui.get_color_u32(imgui.Col_.popup_bg, 0.9), 0.4 * em)
    draw.add_rect(low, high, theme.packed(tint, 0.8), 0.4 * em)
    draw.add_text(ImVec2(low.x + 0.5 * em, low.y + 0.25 * em), theme.packed(tint), text)
    if imgui.is_mouse_hovering_rect(low, high) and imgui.is_window_hovered():
        imgui.begin_tooltip()
        imgui.push_text_wrap_pos(26 * em)
        imgui.text_unformatted(about)
        imgui.pop_text_wrap_pos()
        imgui.end_tooltip()
    return high.y
