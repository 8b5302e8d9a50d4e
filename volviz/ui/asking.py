"""Small questions within a panel: a name to type, or whether to go on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from volviz.errors import VolvizError
from volviz.ui import widgets
from volviz.ui.im import imgui

WIDTH = 17.0
"""Of a question, in font sizes."""


def _no_doubt(_: str) -> str:
    return ""


@dataclass(frozen=True)
class Question:
    """What is asked. act: does it with what was typed, or raises what is wrong. text: to begin
    with; None asks for no name. doubt: what to be sure about before it is done with this name."""

    heading: str
    action: str
    act: Callable[[str], None]
    text: str | None = None
    about: str = ""
    doubt: Callable[[str], str] = _no_doubt


class Asking:
    """At most one question of a panel. id_: begins the ids of its widgets."""

    def __init__(self, id_: str) -> None:
        self._id = id_
        self._question: Question | None = None
        self._text = ""
        self._wrong = ""
        self._sure = False
        self._opening = False

    def ask(self, question: Question) -> None:
        """Open the question with the next `draw`."""
        self._question, self._opening = question, True
        self._text, self._wrong, self._sure = question.text or "", "", False

    def draw(self) -> None:
        """The question, if there is one; where it is asked from, so that its ids are the same."""
        name = f"###{self._id}.question"
        if self._opening:
            imgui.open_popup(name)
        if self._question is None or not imgui.begin_popup(name):
            self._question = self._question if self._opening else None
            return
        if self._body(self._question) or imgui.is_key_pressed(imgui.Key.escape):
            self._question = None
            imgui.close_current_popup()
        self._opening = False
        imgui.end_popup()

    def _body(self, question: Question) -> bool:
        """True once it is answered or taken back."""
        imgui.dummy((widgets.em(WIDTH), 0))
        imgui.text_unformatted(question.heading)
        entered = question.text is not None and self._field()
        if question.about:
            _wrapped(question.about)
        if self._wrong:
            _wrapped(self._wrong, widgets.error_color())
        doubt = self._doubt(question)
        if self._sure and doubt:
            _wrapped(doubt, widgets.warning_color())
        label = "Replace" if self._sure and doubt else question.action
        ready = question.text is None or bool(self._text.strip())
        width = widgets.em(6.5)
        pressed = widgets.button(
            f"{self._id}.do", label, f"{question.heading}: {label.lower()}.", width=width,
            enabled=ready,
        )  # fmt: skip
        imgui.same_line()
        if widgets.button(f"{self._id}.cancel", "Cancel", "Leave all as it is.", width=width):
            return True
        if not (pressed or entered) or not ready:
            return False
        if doubt and not self._sure:
            self._sure = True
            return False
        return self._done(question)

    def _field(self) -> bool:
        """The name; True if Enter was pressed."""
        if imgui.is_window_appearing():
            imgui.set_keyboard_focus_here()
        imgui.set_next_item_width(widgets.em(WIDTH))
        before = self._text
        self._text = widgets.search(f"{self._id}.name", "Name", "A name to find it by.", before)
        if self._text != before:
            self._wrong, self._sure = "", False
        keys = (imgui.Key.enter, imgui.Key.keypad_enter)
        return imgui.is_item_deactivated() and any(imgui.is_key_pressed(k, False) for k in keys)

    def _doubt(self, question: Question) -> str:
        try:
            return question.doubt(self._text)
        except VolvizError:  # told when it is done
            return ""

    def _done(self, question: Question) -> bool:
        try:
            question.act(self._text.strip())
        except VolvizError as error:
            self._wrong = str(error)
            return False
        return True


def _wrapped(text: str, color: imgui.ImVec4 | None = None) -> None:
    if color is not None:
        imgui.push_style_color(imgui.Col_.text, color)
    imgui.push_text_wrap_pos(widgets.em(WIDTH + 0.8))
    imgui.text_unformatted(text)
    imgui.pop_text_wrap_pos()
    if color is not None:
        imgui.pop_style_color()
