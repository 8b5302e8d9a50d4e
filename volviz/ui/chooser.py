"""Which of several: series of a folder, arrays or times or channels of a file, with pictures."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from volviz.app.opening import Offer, title_of
from volviz.app.previews import Previews
from volviz.errors import GraphicsError, LimitError, safe_text
from volviz.ui import widgets
from volviz.ui.im import ImVec2, icons, imgui

if TYPE_CHECKING:
    import moderngl

    from volviz.app.opening import Part
    from volviz.ui.shell import Shell

TITLE = "Choose What to Open"
ROW, WIDTH, MOST_ROWS = 5.2, 40.0, 5
"""Height of a row, width of the list (font sizes), rows shown before it scrolls."""


class Chooser:
    """Puts the app's question in front and hands the answer back. Nothing opens without one."""

    def __init__(self, shell: Shell) -> None:
        self.shell = shell
        self.offer: Offer | None = None
        self.previews: Previews | None = None
        self.selected = 0
        self.rows: list[tuple[float, float, float, float]] = []
        self._textures: dict[int, moderngl.Texture] = {}
        self._scroll = False

    def follow(self) -> None:
        """Once a frame: show a new question, put away one that was answered or left."""
        choosing, dialogs = self.shell.app.choosing, self.shell.dialogs
        if self.offer is not None and dialogs.active != TITLE:
            if choosing.offer is self.offer:
                choosing.decline()
            self.release()
        elif self.offer is not None and choosing.offer is not self.offer:
            dialogs.close()
            self.release()
        asked = choosing.offer
        if asked is not None and self.offer is None and not dialogs.active:
            self.offer = asked
            self.previews = Previews(asked.parts, self.shell.app.wake)
            self.selected = _first(asked)
            self._scroll = True
            dialogs.show(TITLE, self._body)

    def release(self) -> None:
        """Free the pictures and end the thread that makes them."""
        if self.previews is not None:
            self.previews.close()
        for texture in self._textures.values():
            texture.release()
        self._textures.clear()
        self.offer = self.previews = None

    def _body(self) -> None:
        assert self.offer is not None
        em, parts = float(imgui.get_font_size()), self.offer.parts
        widgets.dim(f"{title_of(self.offer.name)} holds {len(parts)} {_noun(parts)}.")
        height = em * (ROW + 0.45) * min(len(parts), MOST_ROWS) + em
        if imgui.begin_child("###parts", ImVec2(em * WIDTH, height), imgui.ChildFlags_.borders):
            opened = self._list(em)
        else:
            opened = False
        imgui.end_child()
        imgui.spacing()
        opened = imgui.button("Open###do", ImVec2(em * 7, 0)) or opened or self._keys()
        widgets.tip("chooser.open", "Open the marked one, as a double click and Enter do")
        imgui.same_line()
        cancelled = imgui.button("Cancel", ImVec2(em * 7, 0))
        widgets.tip("chooser.cancel", "Leave everything as it is")
        if cancelled:
            self.shell.dialogs.close()
        elif opened:
            self._take(parts[self.selected])

    def _take(self, part: Part) -> None:
        """The pictures are freed with the next frame: this one still draws them."""
        self.shell.app.choosing.take(part)
        self.shell.dialogs.close()

    def _keys(self) -> bool:
        """Moves the selection; True for Enter."""
        assert self.offer is not None
        key, last = imgui.Key, len(self.offer.parts) - 1
        page = MOST_ROWS - 1
        moves = {key.up_arrow: -1, key.down_arrow: 1, key.page_up: -page, key.page_down: page}
        moves |= {key.home: -last, key.end: last}
        for one, by in moves.items():
            if imgui.is_key_pressed(one):
                self.selected = min(max(self.selected + by, 0), last)
                self._scroll = True
        return any(imgui.is_key_pressed(k, False) for k in (key.enter, key.keypad_enter))

    def _list(self, em: float) -> bool:
        """The rows; True if one was double-clicked."""
        assert self.offer is not None
        height, parts = em * ROW, self.offer.parts
        chosen = False
        self.rows = [(0.0, 0.0, 0.0, 0.0)] * len(parts)
        clipper = imgui.ListClipper()
        clipper.begin(len(parts), height + imgui.get_style().item_spacing.y)
        if self._scroll:
            clipper.include_item_by_index(self.selected)
        while clipper.step():
            for index in range(clipper.display_start, clipper.display_end):
                chosen = self._row(index, em, height) or chosen
        clipper.end()
        self._scroll = False
        return chosen

    def _row(self, index: int, em: float, height: float) -> bool:
        assert self.offer is not None
        part = self.offer.parts[index]
        at = imgui.get_cursor_screen_pos()
        # imgui's own keys would move a second mark beside the selection
        imgui.push_item_flag(imgui.ItemFlags_.no_nav, True)
        clicked, _ = imgui.selectable(
            f"###part{index}",
            index == self.selected,
            imgui.SelectableFlags_.allow_double_click,
            ImVec2(0, height),
        )
        imgui.pop_item_flag()
        if index == self.selected and self._scroll:
            imgui.set_scroll_here_y()
        low, high = imgui.get_item_rect_min(), imgui.get_item_rect_max()
        self.rows[index] = (low.x, low.y, high.x, high.y)
        about = "\n".join(t for t in (safe_text(part.title, 1000), *details(part)) if t)
        widgets.tip(f"chooser.part.{index}", f"{about}\nDouble click opens it.")
        if clicked:
            self.selected = index
        self._picture(index, (at.x + em * 0.3, at.y + em * 0.2), height - em * 0.4)
        present = part.choices == self.offer.present
        self._text(part, present, (at.x + height + em, at.y), high.x)
        return bool(clicked and imgui.is_mouse_double_clicked(0))

    def _picture(self, index: int, corner: tuple[float, float], side: float) -> None:
        """The preview in the middle of its square, or what stands for it."""
        assert self.previews is not None
        draw = imgui.get_window_draw_list()
        x, y = corner
        ground = imgui.get_color_u32(imgui.Col_.frame_bg)
        faint = imgui.get_color_u32(imgui.Col_.text_disabled)
        draw.add_rect_filled(ImVec2(x, y), ImVec2(x + side, y + side), ground, 3.0)
        made = self.previews.get(index)
        if isinstance(made, np.ndarray):
            texture = self._texture(index, made)
            if texture is not None:
                scale = side / max(made.shape)
                w, h = made.shape[1] * scale, made.shape[0] * scale
                left, top = x + (side - w) / 2, y + (side - h) / 2
                draw.add_image(
                    imgui.ImTextureRef(texture.glo),
                    ImVec2(left, top),
                    ImVec2(left + w, top + h),
                )
            return
        mark = icons.ICON_FA_IMAGE if made is None else icons.ICON_FA_TRIANGLE_EXCLAMATION
        size = imgui.calc_text_size(mark)
        middle = ImVec2(x + (side - size.x) / 2, y + (side - size.y) / 2)
        draw.add_text(middle, faint, mark)
        if isinstance(made, str) and imgui.is_mouse_hovering_rect(
            ImVec2(x, y), ImVec2(x + side, y + side)
        ):
            imgui.set_tooltip(f"no preview: {made}")

    def _texture(self, index: int, picture: np.ndarray) -> Any:
        if index not in self._textures:
            height, width = picture.shape
            pixels = np.full((height, width, 4), 255, np.uint8)
            pixels[..., :3] = picture[..., None]
            try:
                self._textures[index] = self.shell.gpu.texture2d(
                    (width, height), 4, pixels, "f1", linear=True
                )
            except (LimitError, GraphicsError):
                return None
        return self._textures[index]

    def _text(self, part: Part, present: bool, at: tuple[float, float], right: float) -> None:
        """Title, then what is known of it, over three lines."""
        draw, em = imgui.get_window_draw_list(), float(imgui.get_font_size())
        clear = imgui.get_color_u32(imgui.Col_.text)
        faint = imgui.get_color_u32(imgui.Col_.text_disabled)
        x, y = at[0], at[1] + em * 0.55
        draw.push_clip_rect(ImVec2(x, y), ImVec2(right - em * 0.4, y + em * ROW), True)
        title = f"{safe_text(part.title, 120)}{'   (open)' if present else ''}"
        for paint, line in ((clear, title), *((faint, text) for text in details(part) if text)):
            draw.add_text(ImVec2(x, y), paint, line)
            y += em * 1.4
        draw.pop_clip_rect()


def details(part: Part) -> tuple[str, str]:
    """Two lines of what is known: kind, date and number of files; samples and spacing."""
    files = f"{part.files} file{'s' if part.files != 1 else ''}" if part.kind == "series" else ""
    times = f"{part.times} times" if part.times > 1 else ""
    first = [part.modality, part.date, files, times]
    dims = " × ".join(map(str, part.dims)) if part.dims else ""
    steps = "" if part.spacing is None else " × ".join(f"{s:.3g}" for s in part.spacing) + " mm"
    return "   ".join(t for t in first if t), "   ".join(t for t in (dims, steps) if t)


def _first(offer: Offer) -> int:
    """What is selected at first: what is open, else what has the most samples."""
    for index, part in enumerate(offer.parts):
        if part.choices == offer.present:
            return index
    sizes = [0 if p.dims is None else int(np.prod(p.dims, dtype=object)) for p in offer.parts]
    return sizes.index(max(sizes))


def _noun(parts: tuple[Part, ...]) -> str:
    if parts[0].kind != "part":
        return "series" if parts[0].kind == "series" else "arrays"
    known = {name for part in parts for name, _ in part.choices}
    return " and ".join(f"{name}s" for name in ("time", "channel") if name in known)
