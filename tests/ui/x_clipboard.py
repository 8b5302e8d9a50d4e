"""Another program that pastes: `python -m tests.ui.x_clipboard TARGET` writes what it gets.

Plain Xlib through ctypes, so that it shares nothing with what is tested.
"""

from __future__ import annotations

import ctypes
import sys
import time
from ctypes import POINTER, byref, c_char_p, c_int, c_long, c_ubyte, c_ulong, c_void_p

SELECTION_NOTIFY = 31


class Event(ctypes.Structure):
    """XSelectionEvent, padded to the size of XEvent."""

    _fields_ = (
        ("type", c_int),
        ("serial", c_ulong),
        ("send_event", c_int),
        ("display", c_void_p),
        ("requestor", c_ulong),
        ("selection", c_ulong),
        ("target", c_ulong),
        ("property", c_ulong),
        ("time", c_ulong),
        ("pad", c_long * 24),
    )


def paste(target: str, seconds: float = 10.0) -> bytes | None:
    """The clipboard as `target` ("image/png", "UTF8_STRING"); None if it has no such thing."""
    x = ctypes.CDLL("libX11.so.6")
    for name in ("XOpenDisplay", "XDefaultRootWindow", "XCreateSimpleWindow", "XInternAtom"):
        getattr(x, name).restype = c_void_p if name == "XOpenDisplay" else c_ulong
    display = c_void_p(x.XOpenDisplay(None))
    assert display, "no display"
    root = c_ulong(x.XDefaultRootWindow(display))
    window = c_ulong(x.XCreateSimpleWindow(display, root, 0, 0, 1, 1, 0, c_ulong(0), c_ulong(0)))
    names = (b"CLIPBOARD", target.encode(), b"PASTED")
    clipboard, kind, place = (c_ulong(x.XInternAtom(display, c_char_p(n), 0)) for n in names)
    x.XConvertSelection(display, clipboard, kind, place, window, c_ulong(0))
    x.XFlush(display)
    event, end = Event(), time.monotonic() + seconds
    while event.type != SELECTION_NOTIFY:
        if x.XPending(display):
            x.XNextEvent(display, byref(event))
        elif time.monotonic() > end:
            raise TimeoutError("nobody answers")
        else:
            time.sleep(0.005)
    if not event.property:
        return None
    got, form, count, rest = c_ulong(), c_int(), c_ulong(), c_ulong()
    data = POINTER(c_ubyte)()
    x.XGetWindowProperty(
        display, window, place, c_long(0), c_long(1 << 26), 0, c_ulong(0),
        byref(got), byref(form), byref(count), byref(rest), byref(data),
    )  # fmt: skip
    return bytes(data[: count.value])


if __name__ == "__main__":
    found = paste(sys.argv[1])
    sys.stdout.buffer.write(b"" if found is None else found)
