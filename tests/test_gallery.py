"""The examples run as they stand and draw something."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

GALLERY = Path(__file__).parent / "gallery"
EXAMPLES = sorted(p for p in GALLERY.glob("*.py") if p.stem not in ("__init__", "pictures"))


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path, tmp_path, monkeypatch):
    out = tmp_path / "out.png"
    monkeypatch.setattr(sys, "argv", [str(path), str(out)])
    runpy.run_path(str(path), run_name="__main__")
    assert np.asarray(Image.open(out).convert("RGB")).std() > 5
