"""`volviz doctor`: what this machine has for drawing, as facts that fit in a bug report.

Every OpenGL context is opened in a child process with a time limit, since a broken driver may
crash or hang whoever opens it. Paths show the home folder as ~ and no user name.
"""

from __future__ import annotations

import getpass
import importlib.metadata
import json
import os
import platform
import re
import subprocess
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from volviz._version import __version__
from volviz.errors import VolvizError, safe_text

TIMEOUT = 20.0
PACKAGES = ("numpy", "moderngl", "glcontext", "glfw", "imgui-bundle", "pyrr", "pillow")
CODECS = ("pylibjpeg", "pylibjpeg-openjpeg", "pyjpegls", "imagecodecs")
VARIABLES = re.compile(
    r"(VOLVIZ|LP|GALLIUM|LIBGL|MESA|EGL|__EGL|__GLX|__GL|GLCONTEXT|PYGLFW|DRI)_\w+"
    r"|NVIDIA_VISIBLE_DEVICES|NVIDIA_DRIVER_CAPABILITIES|CUDA_VISIBLE_DEVICES|LD_LIBRARY_PATH"
)
VENDOR_FOLDERS = ("/usr/share/glvnd/egl_vendor.d", "/etc/glvnd/egl_vendor.d")
_CHILD = "import sys; sys.path.append({root!r}); from volviz.gpu.contexts_child import main; main()"


def report() -> dict[str, Any]:
    """All facts, ready for JSON. `usable` is True if volviz can draw here; takes some seconds.

    egl_devices and rungs: one entry per context tried, with `ok` and `reason`; chosen: the one that
    volviz takes when nothing is asked for but VOLVIZ_BACKEND, None if none works.
    """
    facts: dict[str, Any] = {
        "volviz": __version__,
        "python": f"{platform.python_implementation()} {platform.python_version()}",
        "system": _system(),
        "packages": _versions(PACKAGES),
        "codecs": _versions(CODECS),
        "session": {
            name: os.environ.get(name)
            for name in ("XDG_SESSION_TYPE", "DISPLAY", "WAYLAND_DISPLAY")
        },
        "folders": _folders(),
        "environment": {k: v for k, v in sorted(os.environ.items()) if VARIABLES.fullmatch(k)},
        **_graphics(),
    }
    cleaned: dict[str, Any] = _anonymous(facts)
    return cleaned


def ask_child(what: str, timeout: float = TIMEOUT, code: str | None = None) -> dict[str, Any]:
    """What contexts_child says about `what`, or `ok: False` with the reason of its silence.

    code: another program for the child, for tests.
    """
    root = str(Path(__file__).resolve().parent.parent)
    # -P: a folder that happens to be the current one must not supply modules.
    command = [sys.executable, "-P", "-c", code or _CHILD.format(root=root), what]
    try:
        done = subprocess.run(
            command, capture_output=True, text=True, errors="replace", timeout=timeout, check=False
        )
    except subprocess.TimeoutExpired as error:
        said = error.stdout.decode("utf-8", "replace") if error.stdout else ""
        return _answer(said, f"the driver did not answer within {timeout:g} s")
    except OSError as error:
        return {"ok": False, "reason": f"no child process could be started: {error.strerror}"}
    trouble = f"the driver crashed (signal {-done.returncode})" if done.returncode < 0 else ""
    if done.returncode > 0:
        said = (done.stderr.strip().splitlines() or ["nothing was said"])[-1]
        trouble = f"the probe failed: {said[:200]}"
    return _answer(done.stdout, trouble)


def _answer(said: str, trouble: str) -> dict[str, Any]:
    """The last line of JSON, with what went wrong after it; without one, a failure."""
    for line in reversed(said.splitlines()):
        try:
            answer: dict[str, Any] = json.loads(line)
        except ValueError:
            continue
        return {**answer, "trouble": trouble} if trouble else answer
    return {"ok": False, "reason": trouble or "the probe said nothing"}


# --- parts of the report ---------------------------------------------------------------------


def _graphics() -> dict[str, Any]:
    counted = ask_child("count")
    count = counted.get("count", 0)
    devices = [f"egl:{index}" for index in range(count)]
    others = ["window", "glfw-egl", "glfw-osmesa"]
    with ThreadPoolExecutor(max_workers=4) as pool:
        chosen, *found = pool.map(_ask, ["choose", *devices, *others])
    egl, rungs = found[:count], found[count:]
    if not any(device["ok"] for device in egl):
        reason = counted.get("reason") or "; ".join(device["reason"] for device in egl)
        reason = reason or "EGL lists no device (no driver is installed)"
        rungs.insert(1, {"rung": "egl", "ok": False, "reason": reason})
    return {
        "usable": bool(chosen["ok"]),
        "chosen": chosen if chosen["ok"] else None,
        "why_not": None if chosen["ok"] else chosen["reason"],
        "egl_devices": egl,
        "rungs": rungs,
        "drivers": {
            "egl_vendors": _listed(VENDOR_FOLDERS, "*.json"),
            "devices": _listed(("/dev/dri",), "*") + _listed(("/dev",), "nvidia*"),
        },
    }


def _ask(what: str) -> dict[str, Any]:
    rung, _, index = what.partition(":")
    if what == "window" and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
        return {"rung": rung, "ok": False, "reason": "neither DISPLAY nor WAYLAND_DISPLAY is set"}
    named = {} if what == "choose" else {"rung": rung, "device": int(index) if index else None}
    return {**named, **ask_child(what)}


def _system() -> dict[str, Any]:
    return {
        "name": _distribution(),
        "kernel": f"{platform.system()} {platform.release()}",
        "machine": platform.machine(),
        "cpus": len(os.sched_getaffinity(0))
        if hasattr(os, "sched_getaffinity")
        else os.cpu_count(),
        **_memory(),
    }


def _distribution() -> str:
    try:
        return platform.freedesktop_os_release().get("PRETTY_NAME", "Linux")
    except OSError:
        return platform.system()


def _memory() -> dict[str, int | None]:
    """Bytes of memory in all and free to take, None where the system does not say."""
    try:
        text = Path("/proc/meminfo").read_text(encoding="ascii")
    except OSError:
        return {"memory": None, "memory_free": None}
    sizes = {k: int(v) * 1024 for k, v in re.findall(r"^(\w+):\s+(\d+) kB$", text, re.MULTILINE)}
    return {"memory": sizes.get("MemTotal"), "memory_free": sizes.get("MemAvailable")}


def _versions(names: Sequence[str]) -> dict[str, str | None]:
    found: dict[str, str | None] = {}
    for name in names:
        try:
            found[name] = importlib.metadata.version(name)
        except importlib.metadata.PackageNotFoundError:
            found[name] = None
    return found


def _folders() -> dict[str, str]:
    import platformdirs

    from volviz import resources

    return {
        "config": platformdirs.user_config_dir("volviz", appauthor=False),
        "cache": platformdirs.user_cache_dir("volviz", appauthor=False),
        "shaders": _where(resources.shader_dir),
        "assets": _where(resources.asset_dir),
    }


def _where(folder: Callable[[], Path]) -> str:
    try:
        return str(folder())
    except VolvizError as error:
        return str(error)


def _listed(folders: Sequence[str], pattern: str) -> list[str]:
    return sorted(str(path) for folder in folders for path in Path(folder).glob(pattern))


# --- no names of users -----------------------------------------------------------------------


def _anonymous(facts: Any) -> Any:
    """The same facts with ~ for the home folder and <user> for the user's name in paths."""
    if isinstance(facts, dict):
        return {key: _anonymous(value) for key, value in facts.items()}
    if isinstance(facts, list):
        return [_anonymous(value) for value in facts]
    return _without_user(facts) if isinstance(facts, str) else facts


def _without_user(text: str) -> str:
    homes = {os.path.expanduser("~"), os.environ.get("HOME", "")}
    for home in sorted(homes - {"", "/", "~"}, key=len, reverse=True):
        text = re.sub(rf"(?<![\w.-]){re.escape(home.rstrip('/'))}(?=/|:|$)", "~", text)
    try:
        user = getpass.getuser()
    except (KeyError, OSError):
        return text
    return re.sub(rf"(?<=/){re.escape(user)}(?=/|:|$)", "<user>", text)


# --- for people ------------------------------------------------------------------------------


def as_text(report: dict[str, Any]) -> str:
    """The report as plain text for a terminal, one fact per line, the verdict first."""
    system = report["system"]
    memory = " of ".join(_gib(system[key]) for key in ("memory_free", "memory"))
    lines = [
        f"volviz {report['volviz']}, {report['python']}, {system['name']}, {system['kernel']} "
        f"{system['machine']}, {system['cpus']} CPUs, {memory} memory free",
        "",
        *_verdict(report),
        "",
        "OpenGL contexts",
        *(_context_line(entry) for entry in [*report["egl_devices"], *report["rungs"]]),
    ]
    drivers = report["drivers"]
    tables = {
        "Packages": report["packages"],
        "Codecs": report["codecs"],
        "Session": report["session"],
        "Folders": report["folders"],
        "Drivers": {name: ", ".join(paths) or None for name, paths in drivers.items()},
        "Environment": report["environment"] or {"none": "(of those that matter here)"},
    }
    for title, table in tables.items():
        width = max(map(len, table))
        shown = (f"  {name:<{width}}  {value or '-'}" for name, value in table.items())
        lines += ["", title, *shown]
    return "\n".join(safe_text(line, 1000) for line in lines)


def _verdict(report: dict[str, Any]) -> list[str]:
    chosen = report["chosen"]
    if chosen is None:
        return [
            f"volviz cannot draw here: {report['why_not']}",
            "Install the system packages libegl1 and libgl1-mesa-dri, or the graphics driver.",
        ]
    name = chosen["rung"] if chosen["device"] is None else f"{chosen['rung']}:{chosen['device']}"
    return [
        f"volviz draws with {name}: {chosen['renderer']}, OpenGL {chosen['version']}",
        f"  why: {chosen['reason']}",
    ]


def _context_line(entry: dict[str, Any]) -> str:
    device = entry.get("device")
    name = entry["rung"] if device is None else f"{entry['rung']}:{device}"
    if not entry["ok"]:
        return f"  {name:<11}  no   {entry['reason']}"
    parts = [
        f"{entry['renderer']} ({entry['vendor']})",
        f"OpenGL {entry['version']}",
        f"GLSL {entry['glsl']}",
        f"3D textures to {entry['max_texture_3d']}",
        "compute" if entry["compute"] else "no compute",
        f"{entry['ms']:.0f} ms",
    ]
    if "largest_texture_3d" in entry:
        largest = entry["largest_texture_3d"]
        size = "none" if largest is None else "×".join(map(str, largest["size"]))
        got = "" if largest is None else f" ({_gib(largest['bytes'])})"
        parts.insert(4, f"largest that allocates {size}{got}")
    if entry.get("trouble"):
        parts.append(entry["trouble"])
    return f"  {name:<11}  yes  " + ", ".join(parts)


def _gib(size: int | None) -> str:
    return "?" if size is None else f"{size / (1 << 30):.1f} GiB"
