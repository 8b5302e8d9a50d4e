"""Contour tracing on solids whose volume, area and branches are known."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial import cKDTree

from tests.isosurface import oracles
from tests.isosurface.shapes import SHEARED, sphere, torus
from volviz.isosurface.contours import contours
from volviz.isosurface.extractors import marching_cubes
from volviz.isosurface.extractors.contour_tracing import extract
from volviz.isosurface.overlay import overlay
from volviz.isosurface.tiling import tile
from volviz.model.volume import Volume
from volviz.samples import sample


def field(n, function):
    """Samples of a function of x, y, z in −1..1."""
    z, y, x = np.indices((n, n, n)) * 2 / (n - 1) - 1
    step = 2 / (n - 1)
    affine = np.diag([step, step, step, 1.0])
    affine[:3, 3] = -1
    return Volume.from_array(function(x, y, z).astype(np.float32), affine=affine)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_cylinder_along_the_axis(axis):
    def function(*place):
        along = "xyz".index(axis)
        return 0.5 - np.hypot(*(p for i, p in enumerate(place) if i != along))

    mesh = extract(field(41, function), 0.0, axis=axis)
    oracles.assert_closed(mesh)
    assert oracles.euler(mesh) == 2
    height = 2 + 2 / 40  # half a slice beyond both ends
    assert oracles.volume_inside(mesh) == pytest.approx(np.pi * 0.25 * height, rel=0.01)
    assert oracles.area(mesh) == pytest.approx(np.pi * (height + 0.5), rel=0.01)


@pytest.mark.parametrize("axis", ["x", "y", "z"])
def test_a_torus_keeps_its_hole_whichever_way_it_is_cut(axis):
    mesh = extract(torus(30), 0.0, axis=axis)
    oracles.assert_closed(mesh)
    assert oracles.euler(mesh) == 0
    assert oracles.parts(mesh)[0] == 1


def test_area_and_volume_come_nearer_with_the_slices():
    errors = []
    for n in (12, 24, 48):
        mesh = extract(sphere(n), 0.0)
        errors.append(abs(oracles.volume_inside(mesh) / (4 / 3 * np.pi * 0.343) - 1))
    assert errors[2] < errors[0] / 3
    assert errors[2] < 0.01


def test_trousers_branch_and_a_hollow_is_closed_within():
    def trousers(x, y, z):
        gap = np.clip(z, 0, 1) * 0.5
        legs = 0.3 - np.minimum(np.hypot(x - gap, y), np.hypot(x + gap, y))
        return np.minimum(legs, 0.9 - np.abs(z))

    mesh = extract(field(33, trousers), 0.0)
    oracles.assert_closed(mesh)
    assert (oracles.parts(mesh)[0], oracles.euler(mesh)) == (1, 2)

    def hollow(x, y, z):
        radius = np.sqrt(x * x + y * y + z * z)
        return np.minimum(0.8 - radius, radius - 0.4)

    mesh = extract(field(33, hollow), 0.0)
    oracles.assert_closed(mesh)
    assert (oracles.parts(mesh)[0], oracles.euler(mesh)) == (2, 4)
    shell = 4 / 3 * np.pi * (0.8**3 - 0.4**3)
    assert oracles.volume_inside(mesh) == pytest.approx(shell, rel=0.02)


def test_three_branches_meet_two():
    def tubes(x, y, z):
        up = [np.hypot(x - c, y) for c in (-0.6, 0, 0.6)]
        down = [np.hypot(x - c, y) for c in (-0.35, 0.35)]
        return 0.28 - np.minimum.reduce(np.where(z > 0, [*up], [*down, np.full_like(x, 9)]))

    mesh = extract(field(24, tubes), 0.0)
    oracles.assert_closed(mesh)
    assert (oracles.parts(mesh)[0], oracles.euler(mesh)) == (1, 2)


def test_the_vessel_sample():
    volume = sample("vessel", size=48)
    data = np.where(volume.data > 150, volume.data, 0)
    mesh = extract(Volume.from_array(data, affine=volume.affine), 150)
    oracles.assert_closed(mesh)
    padded = Volume.from_array(np.pad(data, 1), affine=volume.affine)
    plain = oracles.volume_inside(marching_cubes.extract(padded, 150))
    assert oracles.volume_inside(mesh) == pytest.approx(plain, rel=0.1)


@pytest.mark.parametrize(("size", "axis"), [(64, "x"), (64, "y"), (64, "z"), (96, "z")])
def test_the_vessel_splits_as_the_samples_do(size, axis, rng):
    """Of the sample as it is: parts, χ and genus of what is inside, known without a surface."""
    level = 119.5  # of no sample
    volume = sample("vessel", size=size)
    padded = np.pad(volume.data.astype(np.float64), 1, constant_values=-1000)
    pieces = ndimage.label(padded >= level)[1]
    without_ties = padded + rng.uniform(0, 1e-3, padded.shape)
    handles = pieces - int(oracles.solid_euler(without_ties[None], level)[0])
    mesh = extract(volume, level, axis=axis)
    plain = marching_cubes.extract(Volume.from_array(padded, affine=volume.affine), level)
    assert (pieces, handles > 3) == (1, True)
    for surface in (mesh, plain):
        oracles.assert_closed(surface)
        count = oracles.parts(surface)[0]
        assert (count, count - oracles.euler(surface) // 2) == (pieces, handles)
    inside = oracles.volume_inside(plain)
    assert oracles.volume_inside(mesh) == pytest.approx(inside, rel=0.02)


@pytest.mark.parametrize("openings", [(np.pi,), (np.pi, 1.4), (np.pi, 1.5, -1.5)])
def test_a_cavity_that_opens_to_the_outside_gets_no_plates(openings):
    """As in a skull: thinnest where it has no opening, so that the nearest bridge is elsewhere."""

    def skull(x, y, z):
        outer = 0.85 - np.sqrt(x * x + y * y + z * z)
        wall = np.minimum(outer, np.sqrt((x - 0.12) ** 2 + y * y + z * z) - 0.6)
        for angle in openings:
            ahead = x * np.cos(angle) + y * np.sin(angle)
            aside = y * np.cos(angle) - x * np.sin(angle)
            window = np.maximum(np.abs(aside), np.abs(z)) - 0.18
            wall = np.where(ahead > 0, np.minimum(wall, window), wall)
        return wall

    volume = field(48, skull)
    mesh, plain = extract(volume, 0.0), marching_cubes.extract(volume, 0.0)
    oracles.assert_closed(mesh)
    assert (oracles.parts(mesh)[0], oracles.euler(mesh)) == (1, 4 - 2 * len(openings))
    near = cKDTree(np.concatenate([plain.vertices, oracles.corners(plain).mean(axis=1)]))
    samples = near.query(oracles.corners(mesh).mean(axis=1))[0] * 47 / 2
    assert samples.max() < 1
    assert oracles.area(mesh) == pytest.approx(oracles.area(plain), rel=0.02)


def test_sheared_slices():
    mesh = extract(Volume.from_array(sphere(15).data, affine=SHEARED), 0.0, axis="y")
    oracles.assert_closed(mesh)
    assert oracles.volume_inside(mesh) > 0


def test_noise_is_closed_along_every_axis(rng):
    volume = Volume.from_array(rng.standard_normal((8, 9, 10)).astype(np.float32))
    for axis in "xyz":
        oracles.assert_closed(extract(volume, 0.2, axis=axis))


def test_contours_nest_and_run_round_what_is_inside():
    v, u = np.indices((21, 21)) - 10.0
    radius = np.hypot(u, v)
    values = np.maximum(np.minimum(9 - radius, radius - 5), 2 - radius)
    found = contours(values, values >= 0, 0.0)
    areas = []
    for ring in found.rings:
        x, y = found.points[ring].T
        areas.append(float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2))
    expected = [np.pi * 81, -np.pi * 25, np.pi * 4]
    assert sorted(areas) == pytest.approx(sorted(expected), rel=0.1)
    outer, hole, core = (int(np.argmin(np.abs(np.array(areas) - e))) for e in expected)
    none = contours(np.full_like(values, np.nan), np.zeros(values.shape, np.bool_), 0.0)
    over = overlay(found, none)
    regions = [over.sheets[found.rings[k][0]] for k in (outer, hole, core)]
    assert regions[0] == regions[1] != regions[2]
    assert over.euler[regions].tolist() == [0, 0, 1]


def test_contours_through_saddles_are_the_bilinear_functions(rng):
    """As many rings as borders of the solid on a finer lattice, where that is not in doubt."""
    decided = saddles = 0
    for _ in range(60):
        values = np.pad(rng.standard_normal((4, 4)), 1, constant_values=-2.0)
        at = np.indices((5 * 40 + 1,) * 2) / 40
        fine = ndimage.map_coordinates(values, at, order=1) >= 0
        counts = [
            ndimage.label(fine, s)[1] + ndimage.label(~fine, s)[1] - 1
            for s in (None, np.ones((3, 3)))
        ]
        if counts[0] != counts[1]:
            continue
        inside = values >= 0
        a, b, c, d = inside[:-1, :-1], inside[:-1, 1:], inside[1:, 1:], inside[1:, :-1]
        saddles += int(((a == c) & (b == d) & (a != b)).sum())
        decided += 1
        assert len(contours(values, inside, 0.0).rings) == counts[0]
    assert decided > 40
    assert saddles > 40


def test_a_tiling_has_the_least_area(rng):
    """Against all tilings of a triangle and a quadrilateral, one after the other."""
    for _ in range(5):
        points = rng.standard_normal((7, 3))
        low, high = np.arange(3), np.arange(3, 7)

        def area(faces, points=points):
            a, b, c = np.moveaxis(points[faces], 1, 0)
            return np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2

        found, best = tile(points, low, high), np.inf
        for start in range(4):
            for steps in np.ndindex(*[2] * 7):
                if sum(steps) != 3:
                    continue
                i, j, faces = 0, start, []
                for s in steps:
                    third = low[(i + 1) % 3] if s else high[(j + 1) % 4]
                    faces.append((low[i % 3], third, high[j % 4]))
                    i, j = i + s, j + 1 - s
                best = min(best, area(np.array(faces)))
        assert area(found) == pytest.approx(best)
