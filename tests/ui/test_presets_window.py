"""The gallery and the bookmarks, driven for real on a virtual X display."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

from tests.ui.test_shell import ARTEFACTS, DISPLAY, ROOT

NAMES = ("thumbnails_of_this_volume", "work_waits_while_things_move", "own_and_bookmarks")


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="Xvfb is not installed")
@pytest.mark.parametrize("name", NAMES)
def test_window(name, tmp_path):
    config = str(tmp_path / "config")
    done = subprocess.run(
        [*DISPLAY, sys.executable, "-m", "tests.ui.preset_scenarios", name, str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT), "VOLVIZ_CONFIG_DIR": config},
    )
    ARTEFACTS.mkdir(exist_ok=True)
    for picture in tmp_path.glob("window-*.png"):
        shutil.copy(picture, ARTEFACTS / picture.name)
    assert "driven" in done.stdout, done.stderr[-3000:]
    assert done.returncode == 0, done.stderr[-3000:]
    assert "imgui-error" not in done.stdout + done.stderr
