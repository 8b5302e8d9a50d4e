"""The shortest way to a picture: a volume, a scene that suits it, a PNG."""

import sys

import volviz

volume = volviz.sample("ct-head")
scene = volviz.Scene.of(volume, azimuth=30, elevation=10)
volviz.render(scene, size=(480, 400)).save(sys.argv[1] if len(sys.argv) > 1 else "head.png")
