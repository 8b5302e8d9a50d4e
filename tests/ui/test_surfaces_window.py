"""Surfaces in a real window; see `surfacing`."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys

import pytest

from tests.ui.test_commands import ARTEFACTS, DISPLAY, ROOT


@pytest.mark.skipif(shutil.which("Xvfb") is None, reason="Xvfb is not installed")
@pytest.mark.parametrize("name", ["adding", "sliding", "panel"])
def test_window(name, tmp_path):
    done = subprocess.run(
        [*DISPLAY, sys.executable, "-m", "tests.ui.surfacing", name, str(tmp_path)],
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
