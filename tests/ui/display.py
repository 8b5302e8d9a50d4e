"""A virtual X display for a while, of any size and density, and programs run on it."""

from __future__ import annotations

import ctypes
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

XVFB = shutil.which("Xvfb")
ROOT = Path(__file__).resolve().parents[2]
ARTEFACTS = ROOT / "tests" / "artefacts"
needs_display = pytest.mark.skipif(XVFB is None, reason="Xvfb is not installed")
STRING = 31  # the atom XA_STRING
REPLACE, RETAIN_PERMANENT = 0, 1


@contextmanager
def display(width: int = 1280, height: int = 800, scale: int = 1) -> Iterator[dict[str, str]]:
    """Xvfb; gives the environment for programs on it. scale: what GLFW will call content scale."""
    assert XVFB is not None
    read, write = os.pipe()
    size = f"{width}x{height}x24"
    command = [XVFB, "-displayfd", str(write), "-screen", "0", size, "-nolisten", "tcp", "-noreset"]
    server = subprocess.Popen(command, pass_fds=(write,), stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        with os.fdopen(read) as told:
            name = f":{int(told.readline())}"
        if scale != 1:
            _set_density(name, 96 * scale)
        yield {**os.environ, "DISPLAY": name}
    finally:
        server.terminate()
        server.wait(10)


def _set_density(name: str, dots_per_inch: int) -> None:
    """As desktops do: the resource Xft.dpi, a property of the root window."""
    x = ctypes.CDLL("libX11.so.6")
    x.XOpenDisplay.restype = ctypes.c_void_p
    x.XDefaultRootWindow.restype = ctypes.c_ulong
    x.XInternAtom.restype = ctypes.c_ulong
    connection = ctypes.c_void_p(x.XOpenDisplay(name.encode()))
    assert connection.value
    text = f"Xft.dpi:\t{dots_per_inch}\n".encode()
    root = ctypes.c_ulong(x.XDefaultRootWindow(connection))
    atom = ctypes.c_ulong(x.XInternAtom(connection, b"RESOURCE_MANAGER", 0))
    string = ctypes.c_ulong(STRING)
    x.XChangeProperty(connection, root, atom, string, 8, REPLACE, text, len(text))
    x.XSetCloseDownMode(connection, RETAIN_PERMANENT)
    x.XCloseDisplay(connection)


def run(
    module: str, *arguments: str, folder: Path, env: dict[str, str], timeout: float = 280
) -> subprocess.CompletedProcess[str]:
    """A module of ours as a program; the pictures that it puts into the folder are kept."""
    done = subprocess.run(
        [sys.executable, "-m", module, *arguments],
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
        cwd=ROOT,
        env={**env, "PYTHONPATH": str(ROOT)},
    )
    ARTEFACTS.mkdir(exist_ok=True)
    for picture in folder.rglob("window-*.png"):
        shutil.copy(picture, ARTEFACTS / picture.name)
    return done


def play(module: str, name: str, folder: Path) -> subprocess.CompletedProcess[str]:
    """A script of injected events (injected.py) on a display of its own."""
    with display() as env:
        env["VOLVIZ_CONFIG_DIR"] = str(folder / "config")
        return run(f"tests.ui.{module}", name, str(folder), folder=folder, env=env)


def check_played(done: subprocess.CompletedProcess[str]) -> None:
    """It came to its end, and ImGui had nothing to complain about."""
    assert "driven" in done.stdout, done.stderr[-3000:]
    assert done.returncode == 0, done.stderr[-3000:]
    assert "imgui-error" not in done.stdout + done.stderr
