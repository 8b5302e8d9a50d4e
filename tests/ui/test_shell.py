"""The desktop window, driven for real on a virtual X display (see scenarios.py)."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
ARTEFACTS = ROOT / "tests" / "artefacts"
DISPLAY = ("xvfb-run", "-a", "-s", "-screen 0 1280x800x24")
NAMES = (
    "same_as_render",
    "mouse_and_keys",
    "opening",
    "saving",
    "broken_panel",
    "cancel",
    "idle",
    "looks",
)


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="Xvfb is not installed")
@pytest.mark.parametrize("name", NAMES)
def test_window(name, tmp_path):
    done = subprocess.run(
        [*DISPLAY, sys.executable, "-m", "tests.ui.scenarios", name, str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    ARTEFACTS.mkdir(exist_ok=True)
    for picture in tmp_path.glob("window-*.png"):
        shutil.copy(picture, ARTEFACTS / picture.name)
    assert "driven" in done.stdout, done.stderr[-3000:]
    assert done.returncode == 0, done.stderr[-3000:]


def test_no_display_is_one_line_that_says_what_to_do():
    env = {k: v for k, v in os.environ.items() if k not in ("DISPLAY", "WAYLAND_DISPLAY")}
    for more in ("sample:marschner-lobb",), ():
        command = [sys.executable, "-m", "volviz", "view", *more]
        done = subprocess.run(
            command, capture_output=True, text=True, env=env, timeout=60, check=False
        )
        assert done.returncode == 5
        assert done.stderr.count("\n") == 1
        assert "volviz render" in done.stderr
