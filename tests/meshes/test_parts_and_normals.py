from __future__ import annotations

import numpy as np
import pytest

from tests.meshes.shapes import double_torus, joined, mesh_of, plane, sphere, torus
from volviz.errors import UsageError
from volviz.meshes.components import components, largest_component, without_islands
from volviz.meshes.measure import measure
from volviz.meshes.normals import WEIGHTS, oriented, turned, with_normals
from volviz.meshes.smooth import smooth
from volviz.model.mesh import Mesh


def test_parts_are_found_and_dropped():
    small = sphere(0.5, 1)  # 80 triangles
    mesh = joined(small, torus(), mesh_of(plane(3).vertices + 50, plane(3).faces))
    labels, count = components(mesh)
    assert count == 3
    assert np.bincount(labels).tolist() == [80, len(torus().faces), 8]
    assert measure(largest_component(mesh)).genus == 1
    assert len(without_islands(mesh, min_triangles=9).faces) == len(mesh.faces) - 8
    kept = without_islands(mesh, min_area=2.0)
    assert measure(kept).components == 2
    assert len(kept.vertices) == len(small.vertices) + len(torus().vertices)
    assert without_islands(mesh, 8) is mesh
    assert len(without_islands(mesh, 10**6).faces) == 0


def test_parts_keep_what_goes_along():
    mesh = joined(sphere(1.0, 1), sphere(3.0, 1))
    mesh = Mesh(mesh.vertices, mesh.faces, values=np.arange(len(mesh.vertices)), space="LPS")
    kept = largest_component(with_normals(mesh))
    assert kept.values[0] == len(mesh.vertices) / 2
    assert len(kept.normals) == len(kept.vertices)
    assert kept.space == "LPS"


@pytest.mark.parametrize("weight", WEIGHTS)
def test_normals_of_a_sphere_point_outwards(weight):
    mesh = with_normals(sphere(7.0, 4), weight)
    exact = mesh.vertices / np.linalg.norm(mesh.vertices, axis=1, keepdims=True)
    assert np.degrees(np.arccos((mesh.normals * exact).sum(axis=1).clip(-1, 1))).max() < 0.7


def test_the_angle_decides_at_a_corner_of_a_cube():
    box = [(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 0), (1, 0, 1), (0, 1, 1)]
    # one side at the origin is cut in two: by area or angle that must not matter, by count it does
    faces = [(0, 2, 4), (0, 4, 1), (0, 1, 3), (0, 3, 2)]
    exact = -np.ones(3) / np.sqrt(3)
    assert np.allclose(with_normals(mesh_of(box, faces), "angle").normals[0], exact, atol=1e-6)
    assert not np.allclose(with_normals(mesh_of(box, faces), "uniform").normals[0], exact, atol=0.1)
    with pytest.raises(UsageError, match="did you mean 'angle'"):
        with_normals(mesh_of(box, faces), "angel")


def test_triangles_are_turned_to_agree(rng):
    for shape in (torus(), double_torus(), plane(9), joined(sphere(1, 2), torus())):
        faces = shape.faces.copy()
        wrong = rng.random(len(faces)) < 0.3
        faces[wrong] = faces[wrong][:, ::-1]
        made, count = oriented(Mesh(shape.vertices, faces))
        assert count == wrong.sum()
        assert measure(made).inconsistent_edges == 0
        assert measure(made).volume == measure(shape).volume
        assert oriented(shape) == (shape, 0)


def test_a_moebius_strip_cannot_agree():
    turns = np.linspace(0, np.pi, 20, endpoint=False)
    rim = np.stack([np.cos(2 * turns), np.sin(2 * turns), 0 * turns], 1)
    off = 0.3 * np.stack([np.cos(turns) * rim[:, 0], np.cos(turns) * rim[:, 1], np.sin(turns)], 1)
    points = np.concatenate([rim + off, rim - off])
    faces = []
    for i in range(20):
        a, b = i, 20 + i
        c, d = (i + 1, 21 + i) if i < 19 else (20, 0)
        faces += [(a, b, c), (c, b, d)]
    made, _ = oriented(mesh_of(points, faces))
    report = measure(made)
    assert (report.euler, report.boundary_loops, report.genus) == (0, 1, None)
    assert report.inconsistent_edges >= 1


def test_turned_inside_out():
    mesh = with_normals(sphere())
    assert measure(turned(mesh)).volume == pytest.approx(-measure(mesh).volume)
    assert np.array_equal(turned(mesh).normals, -mesh.normals)


def noisy(shape, rng, size):
    return mesh_of(shape.vertices + rng.normal(0, size, shape.vertices.shape), shape.faces)


def test_smoothing_takes_noise_and_keeps_the_volume(rng):
    shape = sphere(10.0, 4)
    rough = noisy(shape, rng, 0.1)
    made = smooth(rough, 30)
    spread = lambda m: np.linalg.norm(m.vertices, axis=1).std()  # noqa: E731
    assert spread(made) < 0.4 * spread(rough)
    assert measure(made).volume == pytest.approx(measure(rough).volume, rel=1e-3)
    for clean in (shape, torus(along=96, around=48)):
        same = smooth(clean, 100)
        assert measure(same).volume == pytest.approx(measure(clean).volume, rel=1e-3)
        assert measure(same).euler == measure(clean).euler


@pytest.mark.parametrize("iterations", [1, 5, 20, 60, 400])
def test_islands_of_a_few_triangles_neither_vanish_nor_burst(iterations):
    """A voxel of noise is an octahedron, two are a longer one: nothing of them is smoother than an
    edge, so smoothing takes all of it, and there is no shape left from which to grow back."""
    large = sphere(20.0, 3)
    ends = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float64)
    corners = np.concatenate([ends, -ends])
    faces = np.array([(x, y, z) for x in (0, 3) for y in (1, 4) for z in (2, 5)])
    odd = [bool(np.signbit(np.linalg.det(corners[f]))) for f in faces]
    faces[odd] = faces[odd][:, ::-1]
    islands = [
        corners * 0.5 + 40,
        corners * [0.3, 0.5, 1.1] - 40,
        corners * [1, 0.01, 1] + [60, 0, 0],
    ]
    start, parts, all_faces = len(large.vertices), [large.vertices], [large.faces]
    for island in islands:
        all_faces.append(faces + start)
        parts.append(island)
        start += len(island)
    mesh = mesh_of(np.concatenate(parts), np.concatenate(all_faces))
    made = smooth(mesh, iterations)
    assert np.isfinite(made.vertices).all()
    start = len(large.vertices)
    for island in islands:
        now = made.vertices[start : start + 6]
        before, after = (
            float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum()) / 6
            for a, b, c in (np.moveaxis(p[faces], 1, 0) for p in (island, now.astype(float)))
        )
        assert after == pytest.approx(before, rel=1e-2)
        assert np.abs(now - island).max() < 1.5
        start += 6
    assert measure(made).volume == pytest.approx(measure(mesh).volume, rel=1e-3)


def test_a_boundary_stays_or_is_smoothed_along_itself(rng):
    rough = noisy(plane(21), rng, 0.01)
    rim = np.zeros(len(rough.vertices), bool)
    rim[np.flatnonzero(np.any((plane(21).vertices[:, :2] % 1) == 0, axis=1))] = True
    fixed = smooth(rough, 20)
    assert np.array_equal(fixed.vertices[rim], rough.vertices[rim])
    assert fixed.vertices[~rim, 2].std() < 0.6 * rough.vertices[~rim, 2].std()
    free = smooth(rough, 20, fixed_boundary=False)
    assert free.vertices[rim, 2].std() < 0.8 * rough.vertices[rim, 2].std()
    assert free.vertices[:, :2].min() > -0.05


def test_smoothing_makes_normals_anew_and_knows_nothing_to_do():
    mesh = with_normals(sphere(5.0, 3))
    assert not np.array_equal(smooth(mesh, 5).normals, mesh.normals)
    assert len(smooth(sphere(), 5).normals) == 0
    assert smooth(mesh, 0) is mesh
    with pytest.raises(UsageError):
        smooth(mesh, -1)
