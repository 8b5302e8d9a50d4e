"""One context opened, measured and told as a line of JSON: what `volviz doctor` runs in a child.

A driver may crash or hang when it is opened, so the doctor never opens one in its own process:
`python -c "from volviz.gpu.contexts_child import main; main()" egl:0`.
"""

from __future__ import annotations

import ctypes
import json
import re
import sys
import time
from pathlib import Path
from typing import Any

from volviz.errors import GraphicsError, LimitError, VolvizError
from volviz.gpu import contexts, contexts_egl, contexts_glfw
from volviz.gpu.checked import Gpu
from volviz.gpu.texel import kept_texture3d

LARGEST_BYTES = 2 << 30


def main() -> None:
    """Answer sys.argv[1] in JSON: "count", "choose", "egl:0" (or another), "glfw-egl", "window".

    "choose" is what open_gpu() takes. For EGL devices a first line is printed before textures are
    measured, so that the facts survive a driver that dies of it; the last line counts.
    """
    what = sys.argv[1]
    try:
        if what == "count":
            _say({"count": contexts_egl.device_count()})
            return
        start = time.perf_counter()
        rung, _, index = what.partition(":")
        gpu = (
            contexts.open_gpu()
            if what == "choose"
            else contexts.open_rung(rung, int(index) if index else None)
        )
        with gpu:
            facts = describe(gpu, (time.perf_counter() - start) * 1000)
            _say(facts)
            if rung == "egl":
                _say({**facts, "largest_texture_3d": largest_texture_3d(gpu)})
    except VolvizError as error:
        _say({"ok": False, "reason": error.what})


def describe(gpu: Gpu, ms: float) -> dict[str, Any]:
    """The facts of one context; ms: how long it took to open."""
    facts = {
        "ok": True,
        "reason": gpu.because or "passed the probe",
        "rung": gpu.rung,
        "device": gpu.device,
        "vendor": gpu.vendor,
        "renderer": gpu.renderer,
        "version": gpu.version,
        "glsl": _glsl(gpu),
        "code": gpu.code,
        "software": gpu.software,
        "max_texture": gpu.limits.max_texture,
        "max_texture_3d": gpu.limits.max_texture_3d,
        "max_viewport": list(gpu.limits.max_viewport),
        "compute": gpu.code >= 430 or "GL_ARB_compute_shader" in gpu.ctx.extensions,
        "ms": round(ms, 1),
    }
    return facts if gpu.rung == "egl" else {**facts, "glfw": contexts_glfw.version()}


def largest_texture_3d(gpu: Gpu, most: int = LARGEST_BYTES) -> dict[str, Any] | None:
    """The largest 16-bit 3D texture whose last texel can be written and read; at most `most` bytes.

    It grows from 64×64×64, one axis doubled at a time, and takes at most a quarter of the free
    memory where the device draws on the CPU. None if not even 64×64×64 works.
    """
    if gpu.software:
        most = min(most, free_memory() // 4)
    size, best, axis = [64, 64, 64], None, 0
    while 2 * size[0] * size[1] * size[2] <= most:
        x, y, z = size
        try:
            kept_texture3d(gpu, (x, y, z), 1, "nu2", linear=True, always=True).release()
        except (LimitError, GraphicsError):
            break
        best = {"size": [x, y, z], "bytes": 2 * x * y * z}
        size[axis] *= 2
        axis = (axis + 1) % 3
    return best


def free_memory() -> int:
    """Bytes that may still be taken: of the machine, or of the container where that is less."""
    free = 4 << 30
    try:
        text = Path("/proc/meminfo").read_text(encoding="ascii")
        found = re.search(r"^MemAvailable:\s+(\d+) kB", text, re.MULTILINE)
        free = int(found[1]) * 1024 if found else free
        group = Path("/sys/fs/cgroup")
        limit = (group / "memory.max").read_text(encoding="ascii").strip()
        if limit.isdecimal():
            used = int((group / "memory.current").read_text(encoding="ascii"))
            free = min(free, int(limit) - used)
    except (OSError, ValueError):
        pass
    return max(free, 0)


def _say(answer: dict[str, Any]) -> None:
    print(json.dumps(answer), flush=True)


def _glsl(gpu: Gpu) -> str:
    """GL_SHADING_LANGUAGE_VERSION, which moderngl's info leaves out."""
    address = gpu.ctx.mglo._context.load_opengl_function("glGetString")
    get_string = ctypes.CFUNCTYPE(ctypes.c_char_p, ctypes.c_uint)(address)
    return (get_string(0x8B8C) or b"").decode("ascii", "replace")
