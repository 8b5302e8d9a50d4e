"""Contexts that GLFW makes: of a window, and without one on its null platform (EGL or OSMesa).

The null platform with EGL needs GLFW 3.5, which imgui-bundle carries; the `glfw` package's own
library is 3.4. Both read PYGLFW_LIBRARY when `glfw` is first imported, so this module points it at
imgui-bundle's copy before that import; the window uses the same library.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib.util
import os
import re
import sys
import threading
import time
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import moderngl

from volviz.errors import GraphicsError

REQUIRED = 330
RESET_SECONDS = 1.0
_LIBRARY_NAMES = ("libglfw.so", "libglfw.dylib", "glfw3.dll")
_open: list[Any] = []  # windows made by `create`; the last one that closes ends GLFW


class Loader:
    """What moderngl asks of a context: its functions come from the library that made it."""

    def __init__(self, glfw: Any, window: Any) -> None:
        self._glfw = glfw
        self._window = window

    def load_opengl_function(self, name: str) -> int:
        """The address of an OpenGL function, 0 if there is none."""
        pointer = self._glfw.get_proc_address(name)
        return (ctypes.cast(pointer, ctypes.c_void_p).value or 0) if pointer else 0

    def __enter__(self) -> None:
        self._glfw.make_context_current(self._window)

    def __exit__(self, *_: object) -> None:
        self._glfw.make_context_current(None)

    def release(self) -> None:
        """Nothing: the window owns the context."""


def import_glfw() -> Any:
    """The glfw module, on imgui-bundle's library (3.5) unless it was imported before."""
    if "glfw" not in sys.modules and not os.environ.get("PYGLFW_LIBRARY"):
        spec = importlib.util.find_spec("imgui_bundle")
        for folder in (spec.submodule_search_locations or []) if spec else []:
            found = [p for name in _LIBRARY_NAMES if (p := Path(folder) / name).is_file()]
            if found:
                os.environ["PYGLFW_LIBRARY"] = str(found[0])
                break
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            import glfw
        except ImportError as error:
            raise GraphicsError(f"GLFW cannot be loaded: {error}") from error
    return glfw


def version() -> str:
    """GLFW's own description of its library: version and platforms."""
    return str(import_glfw().get_version_string().decode("utf-8", "replace"))


def of_window(window: Any) -> moderngl.Context:
    """The moderngl context of a GLFW window, made current. GraphicsError below OpenGL 3.3."""
    glfw = import_glfw()
    glfw.make_context_current(window)
    return _wrap(Loader(glfw, window))


def watch_reset(ctx: moderngl.Context) -> Callable[[], bool]:
    """A function that tells, asking once a second, whether the driver reset this context."""
    names = {
        "GL_KHR_robustness": "glGetGraphicsResetStatus",
        "GL_ARB_robustness": "glGetGraphicsResetStatusARB",
    }
    known = [name for extension, name in names.items() if extension in ctx.extensions]
    loader: Any = ctx.mglo._context
    address = loader.load_opengl_function(known[0]) if known else 0
    if not address:
        return lambda: False
    kind: Any = getattr(ctypes, "WINFUNCTYPE", ctypes.CFUNCTYPE)  # Windows calls otherwise
    status = kind(ctypes.c_uint)(address)
    asked = 0.0

    def lost() -> bool:
        nonlocal asked
        now = time.monotonic()
        if now - asked < RESET_SECONDS:
            return False
        asked = now
        return bool(status())

    return lost


def create(rung: str) -> tuple[moderngl.Context, Callable[[], None]]:
    """The context of a window nobody sees, and the function that closes it.

    rung: "glfw-egl" or "glfw-osmesa" for the null platform, which needs no window system; "window"
    for the system's own (the doctor asks). Only on the main thread, as GLFW demands, and of one
    kind at a time (GLFW has one platform per process). GraphicsError with a short reason.
    """
    if threading.current_thread() is not threading.main_thread():
        raise GraphicsError("GLFW works on the main thread only")
    glfw = import_glfw()
    with _errors_as_reasons(glfw):
        _start(glfw, rung)
        try:
            window = _hidden_window(glfw, rung)
        except Exception:
            _end_if_unused(glfw)
            raise
        _open.append(window)
        try:
            glfw.make_context_current(window)
            ctx = _wrap(Loader(glfw, window))
        except Exception:
            _close(glfw, window)
            raise
    return ctx, lambda: _close(glfw, window)


def _start(glfw: Any, rung: str) -> None:
    version = glfw.get_version()
    needed = {"glfw-egl": (3, 5), "glfw-osmesa": (3, 4)}.get(rung, (3, 3))
    if version < needed:
        shown = ".".join(map(str, version))
        raise GraphicsError(f"GLFW {shown} was loaded; {needed[0]}.{needed[1]} is needed")
    null = rung != "window"
    if _running(glfw):
        if (glfw.get_platform() == glfw.PLATFORM_NULL) != null:
            raise GraphicsError("GLFW already runs on another platform in this process")
        return
    if null:
        glfw.init_hint(glfw.PLATFORM, glfw.PLATFORM_NULL)
    try:
        if not glfw.init():
            raise GraphicsError(_last_error(glfw) or "GLFW does not start")
    finally:
        if null:
            glfw.init_hint(glfw.PLATFORM, glfw.ANY_PLATFORM)


def _hidden_window(glfw: Any, rung: str) -> Any:
    api = {"glfw-egl": glfw.EGL_CONTEXT_API, "glfw-osmesa": glfw.OSMESA_CONTEXT_API}
    hints = {
        glfw.VISIBLE: False,
        glfw.CONTEXT_CREATION_API: api.get(rung, glfw.NATIVE_CONTEXT_API),
        glfw.CONTEXT_VERSION_MAJOR: 3,
        glfw.CONTEXT_VERSION_MINOR: 3,
        glfw.OPENGL_PROFILE: glfw.OPENGL_CORE_PROFILE,
    }
    glfw.default_window_hints()
    for hint, value in hints.items():
        glfw.window_hint(hint, value)
    try:
        window = glfw.create_window(16, 16, "volviz", None, None)
    finally:
        glfw.default_window_hints()
    if not window:
        raise GraphicsError(_last_error(glfw) or "GLFW makes no context")
    return window


def _wrap(loader: Any) -> moderngl.Context:
    try:
        return moderngl.create_context(require=REQUIRED, context=loader)
    except Exception as error:
        raise GraphicsError(" ".join(str(error).split())[:160]) from error


def _close(glfw: Any, window: Any) -> None:
    _open.remove(window)
    glfw.destroy_window(window)
    _end_if_unused(glfw)


def _end_if_unused(glfw: Any) -> None:
    if not _open:
        glfw.terminate()


def _running(glfw: Any) -> bool:
    """True if someone has called glfw.init: only then does it answer without an error."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        with contextlib.suppress(glfw.GLFWError):
            glfw.get_error()
            glfw.get_platform()
    return glfw.get_error()[0] == 0


def _last_error(glfw: Any) -> str:
    code, text = glfw.get_error()
    if not code:
        return ""
    return text.decode("utf-8", "replace") if isinstance(text, bytes) else str(text)


@contextlib.contextmanager
def _errors_as_reasons(glfw: Any) -> Iterator[None]:
    """glfw reports by Python warnings; here the first one ends the rung with its text."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", glfw.GLFWError)
        try:
            yield
        except glfw.GLFWError as error:
            # "(65542) b'OSMesa: Library not found'"
            text = re.sub(r"^\(\d+\) (?:b['\"](.*)['\"])?", r"\1", str(error))
            raise GraphicsError(text[:160]) from error
