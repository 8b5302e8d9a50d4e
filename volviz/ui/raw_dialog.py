"""What a RAW file holds, where neither its name nor a header says it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from volviz.app.opening import title_of
from volviz.app.raw import ORDERS, TYPES, RawAnswer, RawQuestion
from volviz.ui import widgets
from volviz.ui.im import ImVec4, imgui

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

TITLE = "How Is It Stored?"
WIDTH = 30.0
LABELS = ("Bytes before them", "Spacing")
MOST = 1 << 20
"""Samples along an axis."""


class RawDialog:
    """Asks for what the app could not read off a file, and opens it with the answer."""

    def __init__(self, shell: Shell) -> None:
        self.shell = shell
        self.answer = RawAnswer()
        self._question: RawQuestion | None = None
        self._asked = ""
        self._wrong = ""

    def follow(self) -> None:
        """Once a frame: put a new question in front."""
        app, dialogs = self.shell.app, self.shell.dialogs
        if app.raw is None or dialogs.active:
            return
        self._question, app.raw = app.raw, None
        self._wrong = self._question.wrong
        if str(self._question.path) != self._asked:  # else what was typed stays
            self._wrong = ""
            self._asked = str(self._question.path)
            dims, dtype = (*self._question.guesses, ((1, 1, 1), "uint8"))[0]
            self.answer = RawAnswer(dims, dtype)
        dialogs.show(TITLE, self._body)

    def _body(self) -> None:
        question, answer = self._question, self.answer
        assert question is not None
        imgui.dummy((widgets.em(WIDTH), 0))
        size = "packed" if question.size is None else f"{question.size:,} bytes"
        _say(f"Nothing says what is in {title_of(str(question.path))} ({size}).")
        for index, (dims, dtype) in enumerate(question.guesses):
            label = f"{' × '.join(map(str, dims))}  {dtype}"
            if index:
                widgets.beside(label)
            if widgets.button(f"raw.guess.{index}", label, "The size of the file fits this."):
                answer.dims, answer.dtype, answer.offset = dims, dtype, 0
        if self._wrong:
            _say(self._wrong, widgets.error_color())
        imgui.spacing()
        self._form(answer)
        fits = self._verdict(question, answer)
        imgui.spacing()
        wide = widgets.em(7)
        if widgets.button("raw.open", "Open", "Read it so.", width=wide, enabled=fits):
            self.shell.dialogs.close()
            self.shell.app.open(str(question.path), **answer.choices())
        imgui.same_line()
        if widgets.button("raw.cancel", "Cancel", "Leave what is open.", width=wide):
            self.shell.dialogs.close()

    def _form(self, answer: RawAnswer) -> None:
        with widgets.form("raw", LABELS) as shown:
            if not shown:
                return
            widgets.label("Samples")
            _, (x, y, z) = imgui.input_int3("###raw.dims", list(answer.dims))
            widgets.tip("raw.dims", "Along x, y and z; x changes fastest in the file.")
            x, y, z = (min(max(n, 1), MOST) for n in (x, y, z))
            answer.dims = (x, y, z)
            widgets.label("Type")
            types = [("", name, name, f"One sample is a {name}.") for name in TYPES]
            answer.dtype = widgets.choice("raw.dtype", "Of a sample.", answer.dtype, types)
            widgets.label("Byte order")
            orders = [("", name, name.capitalize(), f"The {name} end first.") for name in ORDERS]
            answer.endian = widgets.choice(
                "raw.endian",
                "Of samples of several bytes: little on today's machines.",
                answer.endian,
                orders,
                shown=answer.endian.capitalize(),
            )
            widgets.label("Bytes before them")
            answer.offset = widgets.drag_whole(
                "raw.offset", "Length of a header to skip.", answer.offset,
                speed=1.0, low=0, high=2**31 - 1,
            )  # fmt: skip
            widgets.label("Spacing")
            new = widgets.vector("raw.spacing", "mm along x, y, z.", answer.spacing, speed=0.01)
            if min(new) > 0:
                answer.spacing = new

    def _verdict(self, question: RawQuestion, answer: RawAnswer) -> bool:
        """Say whether the file has so many bytes; True if it may be opened so."""
        if question.size is None:
            _say(f"That is {answer.nbytes:,} bytes, unpacked.")
            return True
        extra = question.size - answer.nbytes
        if extra == 0:
            _say("That is all of the file.")
            return True
        what = "more than the file has" if extra < 0 else "fewer than the file has"
        _say(f"That is {abs(extra):,} bytes {what}.", widgets.warning_color())
        if 0 < extra < answer.nbytes:
            about = "Take what is left over for a header in front of the samples."
            if widgets.button("raw.skip", f"Skip {extra:,} bytes in front", about):
                answer.offset += extra
        return False


def _say(text: str, color: ImVec4 | None = None) -> None:
    """Text in the width of the dialog, which has none of its own in its first frame."""
    imgui.push_text_wrap_pos(widgets.em(WIDTH))
    imgui.push_style_color(imgui.Col_.text, color or imgui.get_style_color_vec4(imgui.Col_.text))
    imgui.text_unformatted(text)
    imgui.pop_style_color()
    imgui.pop_text_wrap_pos()
