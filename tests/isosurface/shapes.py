"""Fields with known surfaces, and the volumes that finders and extractors are tried on."""

from __future__ import annotations

import numpy as np

from volviz.model.volume import Volume

VOLUMES_FOR_DTYPES = ("uint8", "int16")
SHEARED = np.array([[0.8, 0.3, 0, 5], [0.1, -1.5, 0.2, -7], [0, 0.4, 2.0, 3], [0, 0, 0, 1]])


def coordinates(n, side=2.0):
    """x, y, z of n³ samples of the cube −side/2 … side/2; and the affine."""
    step = side / (n - 1)
    z, y, x = np.indices((n, n, n)) * step - side / 2
    affine = np.diag([step, step, step, 1.0])
    affine[:3, 3] = -side / 2
    return x, y, z, affine


def sphere(n, radius=0.7):
    x, y, z, affine = coordinates(n)
    field = radius - np.sqrt(x * x + y * y + z * z)
    return Volume.from_array(field.astype(np.float32), affine=affine)


def torus(n, count=1):
    """One torus, or two side by side that are joined: genus 1 or 2."""
    x, y, z, affine = coordinates(n)
    rings = []
    for i in range(count):
        middle = (i - (count - 1) / 2) * 0.8
        rings.append(np.hypot(np.hypot(x - middle, y) - 0.4, z))
    return Volume.from_array((0.15 - np.minimum.reduce(rings)).astype(np.float32), affine=affine)


def volumes():
    """(name, volume, isovalues) of every kind that the issue names."""
    rng = np.random.default_rng(7)
    noise = rng.standard_normal((9, 12, 71)).astype(np.float32)
    holes = noise.copy()
    holes[3:5, 4:6, 60:66] = np.nan
    holes[0, 0, 0] = np.inf
    whole = rng.integers(0, 6, (8, 9, 66)).astype(np.int16)
    smooth = sphere(24).data
    sweep = np.linspace(-2.5, 2.5, 9)
    return [
        ("float", Volume.from_array(noise, affine=SHEARED), sweep),
        ("holes", Volume.from_array(holes), sweep),
        ("integers", Volume.from_array(whole), (-1, 0, 0.5, 1, 3, 5, 5.5, 6)),
        ("padding", Volume.from_array(whole, padding=3), (0.5, 1, 3, 4)),
        ("constant", Volume.from_array(np.full((4, 5, 6), 2, np.int16)), (1, 2, 3)),
        ("all-nan", Volume.from_array(np.full((4, 5, 6), np.nan, np.float32)), (0, 1)),
        ("smooth", Volume.from_array(smooth), (-0.5, 0.0, 0.3)),
        ("two-thin", Volume.from_array(noise[:2, :, :5].copy()), (-0.5, 0.5)),
        ("two-wide", Volume.from_array(noise[:, :, :2].copy()), (-0.5, 0.5)),
        ("one-thin", Volume.from_array(noise[:1].copy()), (0.0,)),
        ("one-wide", Volume.from_array(noise[:, :, :1].copy()), (0.0,)),
        ("64-wide", Volume.from_array(noise[:, :, :64].copy()), (0.2,)),
        ("65-wide", Volume.from_array(noise[:, :, :65].copy()), (0.2,)),
    ]
