"""The system's clipboard: text through the window, pictures through copykitten.

copykitten speaks X11, Wayland, Windows and macOS itself (no xclip, no other program) and serves
the picture from a thread of its own while the program runs.
"""

from __future__ import annotations

import os
import sys

import numpy as np

from volviz.errors import OutputError, UsageError
from volviz.image import Image
from volviz.ui.im import imgui

X11_BYTES = 12 << 20
"""A picture goes to another X11 program as one message, of 16 MiB at most; encoders differ."""


def put_text(text: str) -> None:
    """Copy text. Only in the window's thread. Raises OutputError for what is no Unicode."""
    try:
        text.encode()
    except UnicodeEncodeError as error:
        raise OutputError("cannot be copied: a name in it is not UTF-8") from error
    imgui.set_clipboard_text(text)


def text() -> str:
    """The text on the clipboard, "" for none. Only in the window's thread."""
    return imgui.get_clipboard_text() or ""


def put_picture(image: Image) -> None:
    """Copy a picture with its opacity; takes a moment, any thread may do it.

    Raises OutputError without a clipboard, UsageError for a picture too large for it.
    """
    try:
        import copykitten
    except ImportError as error:
        raise OutputError(
            "pictures cannot be copied: the package copykitten is missing or does not load",
            fix="install copykitten, or save the picture",
        ) from error
    if _through_x11() and image.pixels.nbytes > X11_BYTES and len(image.encoded()) > X11_BYTES:
        width, height = image.size
        raise UsageError(
            f"a picture of {width}×{height} is too large for this clipboard: "
            f"X11 takes about {X11_BYTES >> 20} MiB of it",
            fix="save it instead (File > Save Picture), or make the window smaller",
        )
    width, height = image.size
    try:
        copykitten.copy_image(np.ascontiguousarray(image.pixels).tobytes(), width, height)
    except copykitten.CopykittenError as error:
        raise OutputError(
            f"the picture cannot be copied: {str(error).rstrip('.')}", fix="save it instead"
        ) from error


def _through_x11() -> bool:
    here = sys.platform.startswith("linux")
    return here and bool(os.environ.get("DISPLAY")) and not os.environ.get("WAYLAND_DISPLAY")
