"""Choosing and opening, driven in the real window (see scenarios_opening.py)."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

from tests.ui.scenarios_opening import SCRIPTS
from tests.ui.test_shell import ARTEFACTS, DISPLAY, ROOT


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="Xvfb is not installed")
@pytest.mark.parametrize("name", [script.__name__ for script in SCRIPTS])
def test_window(name, tmp_path):
    done = subprocess.run(
        [*DISPLAY, sys.executable, "-m", "tests.ui.scenarios_opening", name, str(tmp_path)],
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
    if name == "closed_while_loading":
        assert "closed in time" in done.stdout
