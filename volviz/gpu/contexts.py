"""The ladder of OpenGL contexts: a window's, EGL on every device, GLFW with EGL, with OSMesa.

Each rung is probed (a 4×4 framebuffer is cleared and read back without an error) before it is
taken. Hardware goes before software; what failed, and why, is kept in `Gpu.attempts`.

Backends, for `--backend` and VOLVIZ_BACKEND: `auto`, `egl`, `egl:1` (device by index), `egl:nvidia`
(by a part of its renderer's or vendor's name), `glfw-egl`, `glfw-osmesa`, and `none`, which stands
for a machine without any OpenGL.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, cast

import moderngl
import numpy as np

from volviz.errors import GraphicsError, LimitError, UsageError, did_you_mean
from volviz.gpu import contexts_egl, contexts_glfw
from volviz.gpu.checked import SOFTWARE, Attempt, Gpu, GpuLimits, Rung, forked

BACKEND_VARIABLE = "VOLVIZ_BACKEND"
RUNGS = ("egl", "glfw-egl", "glfw-osmesa")
BACKENDS = ("auto", *RUNGS, "none")
PACKAGES = "libegl1 libgl1-mesa-dri"

Device = int | str | None

# The processes that have opened a driver, as this one knows: its own, or one it was forked from.
_opened_by: set[int] = set()


@dataclass(frozen=True)
class Request:
    """What was asked for: the rungs to try, in order, and the EGL device (index or name)."""

    rungs: tuple[str, ...]
    device: Device = None


def parse_backend(backend: str | None, device: Device = None) -> Request:
    """The rungs that a backend's name stands for; None means VOLVIZ_BACKEND, else "auto".

    UsageError for an unknown name, or a device for a rung that has none.
    """
    text = backend or os.environ.get(BACKEND_VARIABLE) or "auto"
    name, _, part = text.partition(":")
    name = name.strip().casefold()
    if name not in BACKENDS:
        raise UsageError(
            f"unknown backend '{text}'",
            field=None if backend else BACKEND_VARIABLE,
            fix=did_you_mean(name, BACKENDS),
        )
    chosen: Device = device if device is not None else part.strip() or None
    if isinstance(chosen, str) and chosen.isdecimal():
        chosen = int(chosen)
    if chosen is not None and name not in ("auto", "egl"):
        raise UsageError(f"the backend '{name}' has no devices to choose from", fix="use egl:N")
    if chosen is not None:
        name = "egl"
    return Request({"auto": RUNGS, "none": ()}.get(name, (name,)), chosen)


def open_gpu(backend: str | None = None, *, device: Device = None) -> Gpu:
    """The first context of the ladder that works, current in this thread.

    backend: see the module. device: EGL device by index or by part of its name. The caller owns
    the Gpu and releases it. GraphicsError lists why each rung failed and what to install.
    """
    request = parse_backend(backend, device)
    _note_process()
    attempts: list[Attempt] = []
    for rung in request.rungs:
        gpu = _climb_egl(request.device, attempts) if rung == "egl" else _try(attempts, rung)
        if gpu is not None:
            because = _because(gpu, request, attempts)
            gpu.activate()
            return replace(gpu, because=because, attempts=tuple(attempts))
    raise _nothing_works(attempts)


def open_rung(rung: str, device: int | None = None) -> Gpu:
    """The context of one rung ("egl" with a device's index, or "glfw-egl", "glfw-osmesa"), probed.

    "window" is a hidden window of the system, which the doctor asks for. GraphicsError with a
    short reason.
    """
    if rung == "egl":
        ctx = contexts_egl.create(device or 0)
        gpu = adopt(ctx, "egl", device or 0, on_release=contexts_egl.release_thread)
        gpu.owned.lost = contexts_egl.watch()
        return gpu
    ctx, close = contexts_glfw.create(rung)
    return adopt(ctx, cast(Rung, rung), None, on_release=close)


def from_window(window: Any) -> Gpu:
    """The Gpu of a GLFW window that the caller made (OpenGL 3.3 core) and will destroy."""
    _note_process()
    gpu = adopt(contexts_glfw.of_window(window), "window", None, because="the window's own")
    gpu.owned.lost = contexts_glfw.watch_reset(gpu.ctx)
    return gpu


# --- one shared context for headless work ----------------------------------------------------


class _Shared:
    """The shared contexts of one thread; the thread's end closes them."""

    def __init__(self) -> None:
        self.gpus: dict[Request, Gpu] = {}

    def close(self) -> None:
        while self.gpus:
            self.gpus.popitem()[1].release()

    def __del__(self) -> None:
        with contextlib.suppress(GraphicsError):
            self.close()


_local = threading.local()


def _shared() -> _Shared:
    if not hasattr(_local, "shared"):
        _local.shared = _Shared()
    shared: _Shared = _local.shared
    return shared


def shared_gpu(backend: str | None = None, *, device: Device = None) -> Gpu:
    """The headless Gpu of this thread for this backend, opened on first use, made current.

    It is closed when the thread or the process ends, or by `close_shared`: do not release it.
    """
    request = parse_backend(backend, device)
    gpus = _shared().gpus
    gpu = gpus.get(request)
    if gpu is None or gpu.released or gpu.lost():
        gpu = gpus[request] = open_gpu(backend, device=device)
    gpu.activate()
    return gpu


def close_shared() -> None:
    """Close the shared contexts of this thread; the next `shared_gpu` opens a new one."""
    _shared().close()


def _forget_shared() -> None:
    _shared().gpus.clear()


atexit.register(close_shared)
if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget_shared)


# --- rungs -----------------------------------------------------------------------------------


def adopt(
    ctx: moderngl.Context,
    rung: Rung,
    device: int | None,
    *,
    because: str = "",
    on_release: Callable[[], None] | None = None,
) -> Gpu:
    """A probed Gpu around a moderngl context that is current. GraphicsError if it cannot draw.

    on_release: called after the context was released, also when the probe fails.
    """
    ctx.gc_mode = "context_gc"
    info = ctx.info
    view = info["GL_MAX_VIEWPORT_DIMS"]
    gpu = Gpu(
        ctx,
        rung,
        because,
        vendor=info["GL_VENDOR"],
        renderer=info["GL_RENDERER"],
        version=info["GL_VERSION"],
        code=ctx.version_code,
        software=any(name in info["GL_RENDERER"].casefold() for name in SOFTWARE),
        limits=GpuLimits(
            info["GL_MAX_TEXTURE_SIZE"], info["GL_MAX_3D_TEXTURE_SIZE"], (view[0], view[1])
        ),
        device=device,
    )
    if on_release is not None:
        gpu.owned.on_release.append(on_release)
    ctx.clear_errors()  # moderngl asks for limits that a 3.3 context may not know
    try:
        _probe(gpu)
    except (GraphicsError, LimitError) as error:
        gpu.release()
        raise GraphicsError(error.what) from error
    return gpu


def _probe(gpu: Gpu) -> None:
    """Clear 4×4 pixels and read them back."""
    target = gpu.framebuffer((4, 4))
    with gpu.guarded("the probe"):
        target.clear(0.2, 0.4, 0.6, 0.8)
        got = np.frombuffer(target.read(components=4), np.uint8).reshape(16, 4)
    gpu.release_framebuffer(target)
    if np.abs(got.astype(int) - (51, 102, 153, 204)).max() > 1:
        raise GraphicsError(f"{gpu.renderer} does not draw: a cleared picture reads back wrong")


def _climb_egl(wanted: Device, attempts: list[Attempt]) -> Gpu | None:
    start = time.perf_counter()
    try:
        count = contexts_egl.device_count()
        if count == 0:
            raise GraphicsError("EGL lists no device (no driver is installed)")
    except GraphicsError as error:
        attempts.append(_failed("egl", None, error, start))
        return None
    if isinstance(wanted, int):
        if wanted >= count:
            raise UsageError(f"there is no EGL device {wanted}", fix=f"use 0 to {count - 1}")
        return _try(attempts, "egl", wanted)
    return _first_device(count, wanted, attempts)


def _first_device(count: int, name: str | None, attempts: list[Attempt]) -> Gpu | None:
    """The first hardware device (called `name`) that passes, else the first software one."""
    spare: Gpu | None = None
    seen: list[str] = []
    for index in range(count):
        gpu = _try(attempts, "egl", index)
        if gpu is None:
            continue
        seen.append(gpu.renderer)
        if name is not None and name.casefold() not in f"{gpu.vendor} {gpu.renderer}".casefold():
            gpu.release()
        elif gpu.software and spare is None:
            spare = gpu
        elif gpu.software:
            gpu.release()
        else:
            if spare is not None:
                spare.release()
            return gpu
    if spare is None and name is not None and seen:
        raise UsageError(f"no EGL device is called '{name}'", fix=did_you_mean(name, seen))
    return spare


def _note_process() -> None:
    if _opened_by - {os.getpid()}:
        raise forked()
    _opened_by.add(os.getpid())


def _try(attempts: list[Attempt], rung: str, device: int | None = None) -> Gpu | None:
    start = time.perf_counter()
    try:
        gpu = open_rung(rung, device)
    except GraphicsError as error:
        attempts.append(_failed(rung, device, error, start))
        return None
    ms = (time.perf_counter() - start) * 1000
    attempts.append(Attempt(rung, device, True, "passed the probe", gpu.renderer, ms))
    return gpu


def _failed(rung: str, device: int | None, error: GraphicsError, start: float) -> Attempt:
    return Attempt(rung, device, False, error.what, "", (time.perf_counter() - start) * 1000)


def _because(gpu: Gpu, request: Request, attempts: list[Attempt]) -> str:
    if request.device is not None or len(request.rungs) == 1:
        return "asked for"
    failed = [attempt for attempt in attempts if not attempt.ok]
    if gpu.rung != "egl":
        return "the rungs before it failed: " + "; ".join(map(_short, failed))
    if gpu.software and len(attempts) > 1:
        return "no hardware device passed the probe, so a device that draws on the CPU"
    if gpu.software:
        return "the only EGL device; it draws on the CPU"
    return "the first hardware device that passed the probe"


def _short(attempt: Attempt) -> str:
    reason = attempt.reason if len(attempt.reason) <= 90 else attempt.reason[:89] + "…"
    return f"{attempt.rung}: {reason}"


def _nothing_works(attempts: list[Attempt]) -> GraphicsError:
    if not attempts:
        return GraphicsError("no OpenGL: the backend is 'none'", fix="use --backend auto")
    old = any("is needed" in attempt.reason for attempt in attempts)
    cure = "update the driver or set LIBGL_ALWAYS_SOFTWARE=1" if old else f"install {PACKAGES}"
    return GraphicsError(
        "no usable OpenGL 3.3: " + "; ".join(map(_short, attempts)),
        fix=f"{cure}; 'volviz doctor' tells more",
    )
