from __future__ import annotations

import numpy as np
import pytest
import trimesh

from tests.meshes.shapes import mesh_of, plane, sphere, torus
from volviz.errors import Cancelled, UsageError
from volviz.meshes.distance import distances, two_sided
from volviz.model.mesh import Mesh
from volviz.progress import Progress


def brute(points, mesh):
    """Point to triangle by trimesh (Ericson's regions), over all pairs."""
    corners = mesh.vertices[mesh.faces].astype(np.float64)
    out = []
    for p in points:
        near = trimesh.triangles.closest_point(corners, np.tile(p, (len(corners), 1)))
        out.append(np.linalg.norm(near - p, axis=1).min())
    return np.array(out)


@pytest.mark.parametrize("count", [1, 3, 4, 5, 60, 700])
def test_soups_against_brute_force(rng, count):
    soup = mesh_of(rng.normal(0, 1, (3 * count, 3)), np.arange(3 * count).reshape(-1, 3))
    points = rng.normal(0, 2, (80, 3))
    assert np.allclose(distances(points, soup), brute(points, soup), rtol=1e-9, atol=1e-12)


def test_degenerate_triangles_are_segments_and_points():
    mesh = mesh_of([[0, 0, 0], [1, 0, 0], [2, 0, 0], [9, 9, 9]], [[0, 1, 2], [3, 3, 3]])
    assert np.allclose(distances([[1, 3, 0], [-4, 3, 0], [9, 9, 10]], mesh), [3, 5, 1])


def test_two_spheres():
    apart = two_sided(sphere(10.0, 4), sphere(11.0, 4))
    assert apart.hausdorff == pytest.approx(1, abs=0.03)
    assert apart.mean == pytest.approx(1, abs=0.02)
    assert apart.forth.rms >= apart.forth.mean
    assert np.linalg.norm(apart.forth.at) == pytest.approx(10, abs=0.1)


def test_both_ways_differ_and_the_greater_counts():
    """A sheet with a far tip: from the sheet's twin the tip is not seen, from the tip it is."""
    flat = plane(11)
    tip = mesh_of(
        np.concatenate([flat.vertices, [[0.5, 0.5, 4], [0.6, 0.5, 4], [0.5, 0.6, 4]]]),
        np.concatenate([flat.faces, [[121, 122, 123]]]),
    )
    apart = two_sided(flat, tip)
    assert (apart.forth.greatest, apart.back.greatest, apart.hausdorff) == (0, 4, 4)
    assert apart.back.at[2] == 4
    assert apart.forth.mean == apart.forth.rms == 0
    assert (apart.mean, apart.rms) == (apart.back.mean, apart.back.rms)
    turned = two_sided(tip, flat)
    assert (turned.hausdorff, turned.mean, turned.rms) == (apart.hausdorff, apart.mean, apart.rms)
    assert 0 < apart.mean < apart.rms


def test_the_step_finds_what_vertices_miss():
    roof = mesh_of([[0, 0, 0], [4, 0, 0], [0, 4, 0]], [[0, 1, 2]])
    corners = [[0, 0, 0], [4, 0, 0], [0, 4, 0]]
    specks = mesh_of(
        np.repeat(np.array(corners, float), 3, axis=0) + np.tile(np.eye(3) * 1e-6, (3, 1)),
        np.arange(9).reshape(3, 3),
    )
    exact = 4 * np.sqrt(0.5)  # the middle of the long side is as far from every corner
    for step in (1.0, 0.25, 0.05):
        found = two_sided(roof, specks, step=step).forth.greatest
        assert exact - step / 2 <= found <= exact + 1e-5


def test_means_are_over_the_area(rng):
    """From a square to the plane z = x over it: mean of (x / √2) is 1 / (2√2)."""
    slope = plane(31, lambda x, y: x)
    wide = mesh_of(slope.vertices * [1, 3, 1] - [0, 1, 0], slope.faces)
    bent = plane(9).vertices.copy()
    bent[:, 0] **= 3  # triangles of very different size do not matter
    apart = two_sided(Mesh(bent, plane(9).faces), wide, step=0.02)
    assert apart.forth.mean == pytest.approx(0.5 / np.sqrt(2), rel=2e-2)


def test_nothing_to_measure():
    with pytest.raises(UsageError, match="without triangles"):
        two_sided(sphere(), Mesh(np.ones((3, 3))))


def test_cancel():
    progress = Progress()
    progress.cancel()
    with pytest.raises(Cancelled):
        two_sided(torus(), sphere(), progress=progress)


@pytest.mark.parametrize(
    ("scale", "shift"), [(1.0, 0.0), (250.0, 1000.0), (1e-6, 0.0), (1e9, -3e9)]
)
def test_a_mesh_is_at_no_distance_at_all_from_itself(rng, scale, shift):
    """However its triangles are ordered, split or turned: rounding is not told as a distance."""
    ball = sphere(1.0, 3)
    at = (ball.vertices.astype(np.float64) @ rotation(rng) * scale + shift).astype(np.float32)
    one = mesh_of(at, ball.faces)
    order = rng.permutation(len(ball.faces))
    other = mesh_of(at, np.roll(ball.faces[order], 1, axis=1))
    apart = two_sided(one, other)
    assert (apart.hausdorff, apart.mean, apart.rms) == (0, 0, 0)
    moved = mesh_of(at + np.float32(scale * 1e-2), ball.faces)
    assert two_sided(one, moved).hausdorff > 0.001 * scale


def rotation(rng):
    return np.linalg.qr(rng.normal(0, 1, (3, 3)))[0]
