"""Two variants in one view, side by side at a line that can be dragged.

Both follow the open scene: its camera, and whatever else is changed while they are shown. Each is
drawn as the view itself is: coarse while things move, better and better at rest.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from volviz.app.frames import RESTED
from volviz.app.jobs import Job
from volviz.app.resolving import Resolving
from volviz.gpu.checked import Gpu
from volviz.gpu.progressive import Progressed, Progressive
from volviz.gpu.residency import Residency
from volviz.lab import vary
from volviz.model.camera import Camera
from volviz.model.frame import Frame
from volviz.model.scene import SceneState
from volviz.resolve import TextureLimits
from volviz.ui import widgets
from volviz.ui.im import ImVec2, icons, imgui

SETTLE_SECONDS = 0.22
NEAREST = 0.02
"""Of the line to an edge of the view, in parts of its width."""
GRIP = 1.0
"""Width of what can be dragged, in font sizes."""
SHADE, WHITE, INK = 0x90000000, 0xFFFFFFFF, 0xFF201C18


class _Side:
    """One variant's picture. changed: what it has that the scene has not, by full name.

    Under a lens whole surfaces are drawn while the camera moves, the lens's once it rests.
    """

    def __init__(
        self,
        gpu: Gpu,
        resident: Residency,
        end: tuple[str, Mapping[str, Any]],
        wake: Callable[[], None],
    ) -> None:
        self.label, self.changed = end
        self.picture = Progressive(gpu, resident)
        self.state = Progressed()
        self.frame: Frame | None = None
        self.resolving = Resolving(f"Preparing {self.label}", wake)
        self.lensed = Resolving(f"Preparing {self.label} under the lens", wake)
        self._camera: tuple[Camera | None, float] = None, 0.0
        self._of: Frame | None = None
        self.drawn: Frame | None = None

    def follow(self, scene: SceneState, size: tuple[int, int], limits: TextureLimits) -> bool:
        """Take over what the open scene has become; False while a worker prepares that, and the
        last good frame is drawn from the new camera."""
        new = vary.turned(scene, self.changed, aspect=size[0] / size[1])
        whole = new.with_knobs(lens=False) if new.lens.lens else new
        there, known = True, self.resolving.scene
        if known is None or replace(whole, camera=known.camera) != known:
            there = self.resolving.follow(whole, limits, size)
        else:
            self.resolving.cancel()
        frame = self.resolving.frame
        if new.lens.lens:
            there &= self._under_lens(new, size, limits)
            seen = self.lensed.scene
            if seen is not None and (seen.volume, seen.camera) == (new.volume, new.camera):
                frame = self.lensed.frame
        else:
            self.lensed.cancel()
        if frame is not None and frame is not self._of:
            # a table of its own: two steps of one table would be baked anew with every draw
            self.frame, self._of = replace(frame, table=replace(frame.table)), frame
        if self.frame is not None and self.frame.camera != new.camera:
            self.frame = replace(self.frame, camera=new.camera)
        return there

    def _under_lens(self, new: SceneState, size: tuple[int, int], limits: TextureLimits) -> bool:
        """True once `lensed` is there; not before the camera rests."""
        now = time.perf_counter()
        if self._camera[0] != new.camera:
            self._camera = new.camera, now
        if now - self._camera[1] < RESTED:
            self.lensed.cancel()
            return False
        return self.lensed.follow(new, limits, size)

    def cancel(self) -> None:
        """Stop what is being prepared."""
        self.resolving.cancel()
        self.lensed.cancel()


class Wipe:
    """ends: label and changed values of the variants, left and right. at: of the line, 0..1 across
    the view."""

    def __init__(
        self,
        gpu: Gpu,
        resident: Residency,
        ends: tuple[tuple[str, Mapping[str, Any]], tuple[str, Mapping[str, Any]]],
        wake: Callable[[], None],
    ) -> None:
        self.sides = tuple(_Side(gpu, resident, end, wake) for end in ends)
        self.at = 0.5
        self.changed = 0.0
        self.closed = False
        self._followed: tuple[SceneState | None, tuple[int, int]] = (None, (0, 0))
        self._waiting = False
        self._size = (0, 0)

    @property
    def job(self) -> Job | None:
        """What is being prepared for a picture."""
        jobs = (r.job for side in self.sides for r in (side.resolving, side.lensed))
        return next((job for job in jobs if job is not None and not job.finished), None)

    def cast(
        self,
        scene: SceneState,
        size: tuple[int, int],
        limits: TextureLimits,
        budgets: tuple[float, float],
    ) -> Progressed | None:
        """Bring both pictures nearer to the scene; what the lesser of them is. None before there
        is a frame of both.

        budgets: seconds for both together while things move, and at rest.
        """
        now = time.perf_counter()
        if self._waiting or self._followed[0] is not scene or self._followed[1] != size:
            there = [side.follow(scene, size, limits) for side in self.sides]
            self._waiting = not all(there)
            self._followed = (scene, size)
        if any(side.frame is None for side in self.sides):
            return None
        if self._size != size or any(side.frame is not side.drawn for side in self.sides):
            for side in self.sides:
                assert side.frame is not None
                side.state = side.picture.coarse(side.frame, size, budgets[0] / 2)
            self.changed = now
            if all(side.state.uploaded == 1.0 for side in self.sides):
                self._size = size
                for side in self.sides:
                    side.drawn = side.frame
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
            side.cancel()
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
