"""What takes long or goes wrong under a window: the picture stays, and it says so once."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.ui.test_shell import ARTEFACTS, DISPLAY, ROOT


def drive(name: str, folder: Path) -> subprocess.CompletedProcess[str]:
    done = subprocess.run(
        [*DISPLAY, sys.executable, "-m", "tests.ui.viewport_scenarios", name, str(folder)],
        capture_output=True,
        text=True,
        timeout=240,
        check=False,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    ARTEFACTS.mkdir(exist_ok=True)
    for picture in folder.glob("window-*.png"):
        shutil.copy(picture, ARTEFACTS / picture.name)
    return done


needs_display = pytest.mark.skipif(shutil.which("Xvfb") is None, reason="Xvfb is not installed")


@needs_display
@pytest.mark.parametrize(
    "name", ["slabs", "prepared_beside", "out_of_memory", "tiny_limit", "shader", "lost"]
)
def test_the_picture_stays_and_it_is_told_once(name, tmp_path):
    done = drive(name, tmp_path)
    assert "driven" in done.stdout, done.stderr[-3000:]
    assert done.returncode == 0, done.stderr[-3000:]


@needs_display
def test_a_context_that_stays_lost_ends_in_one_line_and_a_saved_scene(tmp_path):
    done = drive("lost_twice", tmp_path)
    assert done.returncode == 5, done.stderr[-3000:]
    assert done.stderr.count("\n") == 1
    assert "the scene is saved" in done.stderr
    (saved,) = (tmp_path / "config" / "autosave").glob("*.volviz.json")
    assert "marschner-lobb" in saved.read_text()
