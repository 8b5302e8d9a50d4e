"""Two variants in one view, side by side at a line that can be dragged.

Both follow the open scene: its camera, and whatever else is changed while they are shown. Each is
drawn as the view itself is: coarse while things move, better and better at rest.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from volviz.gpu.checked import Gpu
from volviz.gpu.progressive import Progressed, Progressive
from volviz.gpu.residency import Residency
from volviz.lab import vary
from volviz.model.frame import Frame
from volviz.model.scene import SceneState
from volviz.resolve import TextureLimits, resolve
from volviz.ui import widgets
from volviz.ui.im import ImVec2, icons, imgui

SETTLE_SECONDS = 0.22
NEAREST = 0.02
"""Of the line to an edge of the view, in parts of its width."""
GRIP = 1.0
"""Width of what can be dragged, in font sizes."""
SHADE, WHITE, INK = 0x90000000, 0xFFFFFFFF, 0xFF201C18


class _Side:
    """One variant's picture. changed: what it has that the scene has not, by full name."""

    def __init__(
        self, gpu: Gpu, resident: Residency, label: str, changed: Mapping[str, Any]
    ) -> None:
        self.label, self.changed = label, changed
        self.picture = Progressive(gpu, resident)
        self.state = Progressed()
        self.frame: Frame | None = None
        self._scene: SceneState | None = None

    def follow(self, scene: SceneState, aspect: float, limits: TextureLimits) -> None:
        """Take over what the open scene has become."""
        new, old = vary.turned(scene, self.changed, aspect=aspect), self._scene
        if new.lens.lens:  # its surfaces would be extracted anew with every turn, here
            new = new.with_knobs(lens=False)
        if self.frame is None or old is None or replace(new, camera=old.camera) != old:
            frame = resolve(new, limits=limits)
            # a table of its own: two steps of one table would be baked anew with every draw
            self.frame = replace(frame, table=replace(frame.table))
        elif new.camera != old.camera:
            self.frame = replace(self.frame, camera=new.camera)
        self._scene = new


class Wipe:
    """left, right: label and changed values of a variant. at: of the line, 0..1 across the view."""

    def __init__(
        self,
        gpu: Gpu,
        resident: Residency,
        left: tuple[str, Mapping[str, Any]],
        right: tuple[str, Mapping[str, Any]],
    ) -> None:
        self.sides = tuple(_Side(gpu, resident, *side) for side in (left, right))
        self.at = 0.5
        self.changed = 0.0
        self.closed = False
        self._shown: tuple[SceneState | None, tuple[int, int]] = (None, (0, 0))

    def cast(
        self,
        scene: SceneState,
        size: tuple[int, int],
        limits: TextureLimits,
        budgets: tuple[float, float],
    ) -> Progressed:
        """Bring both pictures nearer to the scene; what the lesser of them is.

        budgets: seconds for both together while things move, and at rest.
        """
        now = time.perf_counter()
        if self._shown[0] is not scene or self._shown[1] != size:
            for side in self.sides:
                side.follow(scene, size[0] / size[1], limits)
                assert side.frame is not None
                side.state = side.picture.coarse(side.frame, size, budgets[0] / 2)
            self.changed = now
            if all(side.state.uploaded == 1.0 for side in self.sides):
                self._shown = (scene, size)
        elif now - self.changed >= SETTLE_SECONDS or any(s.state.samples for s in self.sides):
            behind = [s for s in self.sides if not s.state.done]
            for side in behind:
                assert side.frame is not None
                share = budgets[1] / len(behind)
                side.state = side.picture.refine(side.frame, size, share)
        return min((s.state for s in self.sides), key=lambda s: (s.uploaded, s.done, s.samples))

    def paint(self, corner: Any, extent: Any) -> bool:
        """Both pictures, up to the line each; False while there is nothing to show yet."""
        left, right = (side.picture.texture for side in self.sides)
        if left is None or right is None:
            return False
        draw = imgui.get_window_draw_list()
        x, bottom = corner.x + self.at * extent.x, corner.y + extent.y
        one, other = imgui.ImTextureRef(left), imgui.ImTextureRef(right)
        draw.add_image(one, corner, ImVec2(x, bottom), ImVec2(0, 1), ImVec2(self.at, 0))
        end = ImVec2(corner.x + extent.x, bottom)
        draw.add_image(other, ImVec2(x, corner.y), end, ImVec2(self.at, 1), ImVec2(1, 0))
        return True

    def handle(self, corner: Any, extent: Any) -> None:
        """The line with its grip, the names of both sides, and what ends it."""
        x, grip = corner.x + self.at * extent.x, widgets.em(GRIP)
        imgui.set_cursor_screen_pos(ImVec2(x - grip / 2, corner.y))
        imgui.invisible_button("###wipe.line", ImVec2(grip, extent.y))
        held = imgui.is_item_active()
        widgets.tip("wipe.line", "Drag to uncover the one or the other.", show=not held)
        hot = held or imgui.is_item_hovered()
        if hot:
            imgui.set_mouse_cursor(imgui.MouseCursor_.resize_ew)
        if held:
            at = (imgui.get_mouse_pos().x - corner.x) / max(extent.x, 1.0)
            self.at = min(max(at, NEAREST), 1 - NEAREST)
            x = corner.x + self.at * extent.x
        _line(x, corner, extent, hot=hot)
        self._names(x, corner, extent)
        typing = imgui.get_io().want_text_input
        asked = imgui.is_popup_open("", imgui.PopupFlags_.any_popup)
        if imgui.is_key_pressed(imgui.Key.escape, False) and not typing and not asked:
            self.closed = True

    def release(self) -> None:
        """Free both pictures."""
        for side in self.sides:
            side.picture.release()

    def _names(self, x: float, corner: Any, extent: Any) -> None:
        """On either side of the line, at the lower edge; between them a cross that ends it."""
        em = widgets.em()
        size, y = 1.7 * em, corner.y + extent.y - 2.5 * em
        imgui.set_cursor_screen_pos(ImVec2(x - size / 2, y))
        if imgui.invisible_button("###wipe.close", ImVec2(size, size)):
            self.closed = True
        over = imgui.is_item_hovered()
        widgets.tip("wipe.close", "End the wipe (Esc).")
        draw, middle = imgui.get_window_draw_list(), ImVec2(x, y + size / 2)
        draw.add_circle_filled(middle, size / 2, WHITE if over else SHADE)
        cross = icons.ICON_FA_XMARK
        wide = imgui.calc_text_size(cross)
        place = ImVec2(x - wide.x / 2, middle.y - wide.y / 2)
        draw.add_text(place, INK if over else WHITE, cross)
        for side, away in zip(self.sides, (-1, 1), strict=True):
            text = imgui.calc_text_size(side.label)
            width, tall = text.x + em, text.y + 0.5 * em
            start = x + away * (size / 2 + 0.4 * em) - (width if away < 0 else 0)
            start = min(max(start, corner.x), corner.x + extent.x - width)
            low = ImVec2(start, middle.y - tall / 2)
            high = ImVec2(start + width, middle.y + tall / 2)
            draw.add_rect_filled(low, high, SHADE, 0.4 * em)
            draw.add_text(ImVec2(low.x + 0.5 * em, low.y + 0.25 * em), WHITE, side.label)


def _line(x: float, corner: Any, extent: Any, *, hot: bool) -> None:
    """A line that can be seen on any picture, with a grip in its middle."""
    draw, em = imgui.get_window_draw_list(), widgets.em()
    top, bottom = ImVec2(x, corner.y), ImVec2(x, corner.y + extent.y)
    draw.add_line(top, bottom, SHADE, 0.3 * em)
    draw.add_line(top, bottom, WHITE, (0.16 if hot else 0.1) * em)
    middle, radius = ImVec2(x, corner.y + extent.y / 2), (0.95 if hot else 0.85) * em
    draw.add_circle_filled(middle, radius + 0.12 * em, SHADE)
    draw.add_circle_filled(middle, radius, WHITE)
    for away in (-1, 1):
        tip, back = x + away * 0.62 * em, x + away * 0.2 * em
        half = 0.3 * em
        corners = (
            ImVec2(tip, middle.y),
            ImVec2(back, middle.y - half),
            ImVec2(back, middle.y + half),
        )
        draw.add_triangle_filled(*corners, INK)
