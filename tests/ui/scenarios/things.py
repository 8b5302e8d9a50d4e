"""Files that scenarios open: small, and drawn with one sample, so that windows rest soon."""

from __future__ import annotations

from pathlib import Path

import numpy as np

import volviz
from tests.ui.driver import Driver, Script

RAMP, BALL, BROKEN = "ramp.npy", "ball.volviz.json", "broken.nrrd"


def make_files(folder: Path) -> None:
    """A ramp, a CT-like ball in a scene file, and a file that is none."""
    if (folder / BALL).exists():
        return
    np.save(folder / RAMP, np.linspace(0, 1, 20 * 25 * 30, dtype=np.float32).reshape(20, 25, 30))
    (folder / BROKEN).write_bytes(b"NRRD0004\nsizes: banana\n\n")
    z, y, x = np.mgrid[-20:20, -20:20, -20:20] + 0.5
    radius = np.sqrt((x - 4) ** 2 + y**2 + z**2)  # off the middle, so that every turn is seen
    hu = np.clip(1000 - 130 * radius, -1000, 1000) + 40 * np.sin(x / 2)
    np.save(folder / "ball.npy", hu.astype(np.int16))
    scene = volviz.Scene.of(volviz.load(folder / "ball.npy")).with_raycast(samples=1)
    scene.save(folder / BALL)


def given(d: Driver, name: str) -> str:
    """Where one of the files is, or would be."""
    return str(d.folder.parent / name)


def ball(d: Driver) -> Script:
    """Open the ball, and wait."""
    yield from d.open(given(d, BALL))
    yield from d.silence()
    assert d.scene.raycast.samples == 1
