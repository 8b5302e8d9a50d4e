"""Save Picture As: how large, how fine, on what ground; and what that takes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from volviz.errors import UsageError
from volviz.image import FORMATS, MAX_PIXELS, WITHOUT_ALPHA, check_size, image_format
from volviz.text import binary_size
from volviz.ui import widgets
from volviz.ui.im import imgui

if TYPE_CHECKING:
    from volviz.ui.shell import Shell

SIZES = (("1920 × 1080", (1920, 1080)), ("3840 × 2160", (3840, 2160)))
FACTORS = (1, 2, 4)
MOST_SAMPLES = 4096
BYTES_PER_PIXEL = 12
"""The picture, a copy for its file's encoder, and that file."""


class PictureForm:
    """What is chosen besides the file's name."""

    def __init__(self, shell: Shell) -> None:
        assert shell.app.scene is not None
        self.shell = shell
        width, height = shell.viewport.size
        self.size = (max(width, 1), max(height, 1))
        self.samples = shell.app.scene.raycast.samples
        self.transparent = False

    def draw(self) -> None:
        """The rows of the form, into the current window."""
        with widgets.form("picture", ("Width and height", "Transparent")) as shown:
            if not shown:
                return
            widgets.label("Width and height")
            _, (width, height) = imgui.input_int2("###picture.size", list(self.size))
            widgets.tip("picture.size", f"In pixels, at most {MAX_PIXELS:,} in all.")
            self.size = (min(max(width, 1), MAX_PIXELS), min(max(height, 1), MAX_PIXELS))
            widgets.label("")
            self._sizes()
            widgets.label("Samples")
            self.samples = widgets.drag_whole(
                "picture.samples",
                "Jittered pictures averaged: more are smoother and take longer.",
                self.samples,
                speed=0.2,
                low=1,
                high=MOST_SAMPLES,
            )
            widgets.label("Transparent")
            self.transparent = widgets.toggle(
                "picture.transparent",
                "",
                "No background: the opacity goes into the file (not into JPEG).",
                self.transparent,
            )

    def _sizes(self) -> None:
        width, height = self.shell.viewport.size
        choices = [(f"{f} ×" if f > 1 else "As shown", (f * width, f * height)) for f in FACTORS]
        for index, (label, size) in enumerate([*choices, *SIZES]):
            if index:
                widgets.beside(label)
            about = f"{size[0]} × {size[1]} pixels"
            if widgets.button(f"picture.size.{index}", label, about):
                self.size = size

    def problem(self, path: Path) -> str:
        """Why this cannot be saved there, "" if it can."""
        try:
            check_size(self.size)
            form = image_format(path, self.size)
        except UsageError as error:
            if path.suffix.lower() not in FORMATS:
                return f"The name must end in {', '.join(FORMATS)}"
            return error.what[:1].upper() + error.what[1:]
        if self.transparent and form in WITHOUT_ALPHA:
            return f"{form} has no transparency: take .png, or leave the background"
        return ""

    def cost(self) -> str:
        """Pixels, memory and, once a picture was drawn to compare with, time."""
        pixels = self.size[0] * self.size[1]
        memory = binary_size(BYTES_PER_PIXEL * pixels)
        text = f"{pixels / 1e6:.3g} megapixels, about {memory} of memory"
        seconds = self.seconds()
        return text + (f", about {duration(seconds)}" if seconds is not None else "")

    def seconds(self) -> float | None:
        """Estimated from the last whole sample that the view drew."""
        state, (width, height) = self.shell.viewport.state, self.shell.viewport.size
        if not state.samples or width * height < 1:
            return None
        area = self.size[0] * self.size[1] / (width * height)
        return state.seconds * area * self.samples


def duration(seconds: float) -> str:
    """Seconds for people."""
    if seconds >= 5400:
        return f"{seconds / 3600:.1f} h"
    return f"{seconds / 60:.0f} min" if seconds > 90 else f"{max(seconds, 1):.0f} s"
