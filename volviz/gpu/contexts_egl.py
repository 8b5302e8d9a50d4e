"""EGL contexts without a window, on every device that EGL lists.

glcontext makes the context; what it leaves out is done here: the libraries are named by SONAME
(the names without a version exist only where development packages are installed), libEGL serves
as libGL too (GL functions come from eglGetProcAddress, so slim images need no libGL), all devices
are reachable, and the environment (GLCONTEXT_DEVICE_INDEX) cannot redirect one device to another.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import os
import re
from collections.abc import Callable
from functools import cache
from typing import Any

import moderngl

from volviz.errors import GraphicsError

REQUIRED = 330
_LIBRARIES = ("libEGL.so.1", "libEGL.so")
_NO_SUCH_DEVICE = 1_000_000


def device_count() -> int:
    """How many devices EGL lists. GraphicsError if EGL is not installed."""
    try:
        _raw(_NO_SUCH_DEVICE, REQUIRED)
    except Exception as error:
        found = re.search(r"found (\d+) devices", str(error))
        if found is not None:
            return int(found[1])
        raise GraphicsError(_plain(error)) from error
    raise GraphicsError("EGL gave a context for a device that it does not have")


def create(device: int) -> moderngl.Context:
    """A core context of at least OpenGL 3.3 on one device, current in this thread.

    GraphicsError with a short reason, naming the version found where it is below 3.3.
    """
    try:
        return _wrap(_raw(device, REQUIRED))
    except Exception as error:
        version = _version_below(device)
        reason = _plain(error) if version is None else f"OpenGL {version} found, 3.3 is needed"
        raise GraphicsError(f"device {device}: {reason}") from error


def release_thread() -> None:
    """Let this thread have no current context; call it after a context was released.

    glcontext releases a context while it is current, so that EGL keeps it until the thread makes
    another one current: for ever, if the thread ends (2 MB each on Mesa).
    """
    library = _library()
    if library is not None:
        library.eglReleaseThread()


def watch() -> Callable[[], bool]:
    """A function that is true if the context that is current now, made current again, is not.

    EGL displays are shared by the whole process: a library that terminates its display (VTK does,
    when it looks for devices) takes our contexts with it, and calls would go into its own.
    """
    library = _library()
    if library is None:
        return lambda: False
    current = ctypes.CFUNCTYPE(ctypes.c_void_p)(("eglGetCurrentContext", library))
    mine = current()
    return lambda: current() != mine


@cache
def _library() -> ctypes.CDLL | None:
    for name in _LIBRARIES:
        with contextlib.suppress(OSError):
            return ctypes.CDLL(name)
    return None


def _raw(device: int, version: int) -> Any:
    # Mesa warns on standard error about each driver that it tries; the reason comes back anyway.
    os.environ.setdefault("EGL_LOG_LEVEL", "fatal")
    egl = importlib.import_module("glcontext.egl")
    for library in _LIBRARIES:
        try:
            return egl.create_context(
                mode="standalone",
                libegl=library,
                libgl=library,
                glversion=version,
                device_index=device,
            )
        except Exception as error:
            if "not loaded" not in str(error) or library == _LIBRARIES[-1]:
                raise
    raise AssertionError("unreachable")


def _wrap(raw: Any) -> moderngl.Context:
    try:
        return moderngl.create_context(require=REQUIRED, standalone=True, context=raw)
    except Exception:
        raw.release()
        raise


def _version_below(device: int) -> str | None:
    """The version that the device has, where it has one but not 3.3."""
    try:
        raw = _raw(device, 210)
    except Exception:
        return None
    try:
        get_string = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_uint)(
            raw.load_opengl_function("glGetString")
        )
        version = re.match(rb"(\d+)\.(\d+)", get_string(0x1F02) or b"")
    finally:
        raw.release()
    if version is None or (int(version[1]), int(version[2])) >= (3, 3):
        return None
    return f"{int(version[1])}.{int(version[2])}"


def _plain(error: BaseException) -> str:
    text = " ".join(str(error).split())
    if isinstance(error, ImportError):
        return "this build of glcontext has no EGL"
    if "not loaded" in text:
        return "libEGL.so.1 is not installed"
    return text[:160] or type(error).__name__
