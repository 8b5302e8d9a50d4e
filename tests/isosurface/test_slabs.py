"""What contour tracing makes between two slices, against what is so by construction."""

from __future__ import annotations

import numpy as np
import pytest

from tests.isosurface import oracles
from volviz.isosurface.contours import contours
from volviz.isosurface.extractors.contour_tracing import extract
from volviz.isosurface.overlay import overlay, united
from volviz.model.volume import Volume

# Slices of label samples, and what their surface is: parts, and 2 − 2 · handles summed over them.
CASES = {
    "one to one, aside": ((["##..", "##.."], [".##.", ".##."]), 1, 2),
    "one to two": ((["#####"], ["##.##"]), 1, 2),
    "one to three": ((["#######"], ["#.##.##"]), 1, 2),
    "two to two, a chain": ((["####.###", "####.###"], ["##.####.", "##.####."]), 1, 2),
    "two to two, a ring": ((["###", "...", "###"], ["#.#", "#.#", "#.#"]), 1, 0),
    "a ring of six": (
        (
            ["####..", "#.....", "#....#", ".....#", "#....#", "####.#"],
            ["...###", ".....#", "#....#", "#....#", "#.....", "#.####"],
        ),
        1,
        0,
    ),
    "one over both ends of one": ((["###", "#..", "###"], ["..#", "..#", "..#"]), 1, 0),
    "two rings beside one another": ((["#####", ".....", "#####"], ["#.#.#"] * 3), 1, -2),
    "a hole through": ((["###", "#.#", "###"],) * 2, 1, 0),
    "a hole that ends": ((["###"] * 3, ["###", "#.#", "###"], ["###"] * 3), 2, 4),
    "a hole into two": (
        (["#######", "#.....#", "#######"], ["#######", "#.###.#", "#######"]),
        1,
        -2,
    ),
    "a core in a hole": ((["#####", "#...#", "#.#.#", "#...#", "#####"],) * 2, 2, 2),
    "a core that meets its shell": (
        (["#####", "#...#", "#.#.#", "#...#", "#####"], ["#####"] * 5),
        1,
        2,
    ),
    "corners that touch": ((["##..", "##..", "...."], ["....", "....", "..##"]), 2, 4),
    "by one sample": ((["##.", "##.", "..."], ["...", ".##", ".##"]), 1, 2),
    "nothing in common": ((["##...", "....."], ["...##", "....."]), 2, 4),
}


def stack(slices):
    data = np.array([[[c == "#" for c in row] for row in s] for s in slices], dtype=np.uint8)
    return Volume.from_array(np.pad(data, 1))


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("turned", [False, True])
def test_slices_whose_links_are_known(name, turned):
    slices, parts, euler = CASES[name]
    mesh = extract(stack(slices[::-1] if turned else slices), 0.5)
    oracles.assert_closed(mesh)
    assert (oracles.parts(mesh)[0], oracles.euler(mesh)) == (parts, euler)


KINDS = {
    "labels": lambda rng, n: ((rng.random(n) < rng.uniform(0.2, 0.8)).astype(float), 0.5),
    "few values": lambda rng, n: (rng.integers(0, 4, n).astype(float), 1.5),
    "values at the isovalue": lambda rng, n: (rng.integers(0, 4, n).astype(float), 2.0),
    "floats": lambda rng, n: (rng.standard_normal(n), 0.2),
    "floats, few inside": lambda rng, n: (rng.standard_normal(n), 1.2),
}


@pytest.mark.parametrize("kind", KINDS)
def test_random_slices_have_the_topology_of_the_trilinear_function(kind, rng):
    """χ by Morse theory, of 13 slabs of 121 squares each time; ties count as inside and linked."""
    for _ in range(8):
        inner, level = KINDS[kind](rng, (12, 10, 10))
        data = np.pad(inner, 1, constant_values=-2)
        raised = data + rng.uniform(0, 1e-4, data.shape)
        mesh = extract(Volume.from_array(data), level)
        oracles.assert_closed(mesh)
        assert oracles.euler(mesh) == 2 * int(oracles.solid_euler(raised[None], level)[0])
        assert oracles.volume_inside(mesh) > 0


@pytest.mark.parametrize("axis", ["x", "y"])
def test_noise_has_the_same_topology_along_every_axis(axis, rng):
    data = np.pad(rng.standard_normal((9, 10, 11)), 1, constant_values=-3)
    along, other = (extract(Volume.from_array(data), 0.0, axis=a) for a in ("z", axis))
    assert oracles.euler(along) == oracles.euler(other)
    assert oracles.parts(along)[0] == oracles.parts(other)[0]


def test_triangles_lie_over_what_changes_and_keep_their_side(rng):
    """Clefts have the area of what is inside in one slice only, seen from above: none twice."""
    inner = rng.standard_normal((2, 9, 9))
    data = np.pad(inner, 1, constant_values=-3)
    mesh = extract(Volume.from_array(data), 0.0)
    a, b, c = np.moveaxis(oracles.corners(mesh), 1, 0)
    above = np.cross(b - a, c - a)[:, 2] / 2
    heights = oracles.corners(mesh)[:, :, 2]
    slab = (heights.min(axis=1) >= 1) & (heights.max(axis=1) <= 2)
    areas = []
    for k in (1, 2):
        found = contours(data[k], data[k] >= 0, 0.0)
        x, y = found.points.T
        areas.append(np.sum(x * y[found.follows] - y * x[found.follows]) / 2)
    # up where only the lower slice is inside, down where only the upper: A − B in all
    assert above[slab].sum() == pytest.approx(areas[0] - areas[1], abs=1e-4)


def test_a_large_slice_of_noise_takes_as_long_as_its_size(rng):
    """Nodes and pieces of the overlay grow with the samples, and none is left out."""
    pair = rng.standard_normal((2, 200, 200))
    a, b = (contours(s, s >= 0, 0.0) for s in pair)
    over = overlay(a, b)
    m, n, x = over.counts
    assert np.array_equal(np.sort(over.follows), np.arange(len(over.follows)))
    assert len(over.follows) == m + n + 2 * x + (len(over.extra) - x)
    rows = np.concatenate([a.keys, b.keys]) % 2 == 0
    assert np.array_equal(over.mates >= 0, rows)
    assert np.array_equal(over.mates[over.mates[rows]], np.flatnonzero(rows))


def test_sets_are_united():
    found = united(6, np.array([4, 1, 5]), np.array([1, 3, 0]))
    assert found.tolist() == [0, 1, 2, 1, 1, 0]
