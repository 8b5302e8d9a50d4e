"""Knobs by name, a scene saved and opened again: the same picture, byte for byte."""

import sys
import tempfile
from pathlib import Path

import numpy as np

import volviz

scene = volviz.Scene.of(volviz.sample("vessel"), preset="ct-aaa", azimuth=20)
scene = scene.with_raycast(step=0.25, shading="phong", specular=0.4, projection="orthographic")
picture = volviz.render(scene, size=(480, 400))

with tempfile.TemporaryDirectory() as folder:
    scene.save(Path(folder) / "vessel.volviz.json")
    again = volviz.render(volviz.Scene.open(Path(folder) / "vessel.volviz.json"), size=(480, 400))
assert np.array_equal(picture.pixels, again.pixels)
picture.save(sys.argv[1] if len(sys.argv) > 1 else "vessel.png")
