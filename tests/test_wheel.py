"""The wheel holds what the program needs at run time: shaders, presets, the typing marker."""

from __future__ import annotations

import subprocess
import sys
import zipfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def test_wheel_holds_shaders_and_assets(tmp_path):
    command = [sys.executable, "-m", "hatchling", "build", "-t", "wheel", "-d", str(tmp_path)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    held = set(zipfile.ZipFile(wheel).namelist())
    for folder in ("shaders", "assets"):
        for path in (ROOT / folder).rglob("*.*"):
            assert f"volviz/_data/{path.relative_to(ROOT).as_posix()}" in held
    assert "volviz/py.typed" in held
    assert any(name.endswith("LICENSE") for name in held)
    assert not any(name.startswith(("tests/", "shared/")) for name in held)
