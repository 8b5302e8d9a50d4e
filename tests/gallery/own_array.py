"""An array of your own: [z, y, x], spacing in x, y, z order, a transfer function by hand."""

import sys

import numpy as np

import volviz

z, y, x = np.mgrid[-1:1:96j, -1:1:128j, -1:1:128j]
field = np.sin(9 * x) * np.cos(8 * y) + np.sin(7 * z)  # float64, kept as it is
volume = volviz.Volume.from_array(field, spacing=(0.5, 0.5, 0.7), name="waves")

transfer = volviz.TransferFunction(
    colors=((-2, 0.1, 0.3, 0.8), (0, 0.9, 0.9, 0.9), (2, 0.9, 0.4, 0.1)),
    opacities=((-2, 0.6), (-1.2, 0), (1.2, 0), (2, 0.6)),  # over unit_distance, here 1 mm
    unit_distance=1.0,
)
scene = volviz.Scene.of(volume, azimuth=35, elevation=30).with_transfer(transfer)
volviz.render(scene, size=(480, 400)).save(sys.argv[1] if len(sys.argv) > 1 else "waves.png")
