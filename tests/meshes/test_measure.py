from __future__ import annotations

import json

import numpy as np
import pytest
import trimesh

from tests.meshes.shapes import double_torus, joined, mesh_of, plane, sphere, torus
from volviz.meshes.measure import LISTED, measure
from volviz.meshes.normals import turned
from volviz.model.mesh import Mesh

TETRAHEDRON = mesh_of(
    [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]
)


def test_tetrahedron():
    report = measure(TETRAHEDRON)
    assert (report.vertices, report.triangles, report.euler, report.genus) == (4, 4, 2, 0)
    assert report.closed
    assert report.volume == pytest.approx(1 / 6)
    assert report.area == pytest.approx(1.5 + np.sqrt(3) / 2)
    assert (report.low, report.high) == ((0, 0, 0), (1, 1, 1))
    assert measure(turned(TETRAHEDRON)).volume == pytest.approx(-1 / 6)


def test_area_and_volume_converge_as_the_square_of_the_edge():
    errors = []
    for k in (3, 4, 5):
        report = measure(sphere(10.0, k))
        errors.append((4 * np.pi * 100 - report.area, 4 / 3 * np.pi * 1000 - report.volume))
    ratios = np.array(errors[:-1]) / np.array(errors[1:])
    assert np.all(np.abs(ratios - 4) < 0.1)


def test_genus_of_tori():
    one = measure(torus(along=200, around=100))
    assert (one.euler, one.genus, one.closed, one.boundary_edges) == (0, 1, True, 0)
    assert one.area == pytest.approx(4 * np.pi**2 * 3, rel=2e-3)
    assert one.volume == pytest.approx(2 * np.pi**2 * 3, rel=2e-3)
    two = measure(double_torus())
    assert (two.euler, two.genus, two.volume, two.area) == (-2, 2, pytest.approx(13), 50)


def test_parts_are_told_apart_and_summed():
    far = double_torus()
    far = mesh_of(far.vertices + 100, far.faces)
    report = measure(joined(sphere(2.0, 2), torus(), far))
    assert (report.components, report.euler, report.genus) == (3, 2 + 0 - 2, 0 + 1 + 2)
    assert [p.genus for p in report.parts] == [1, 2, 0]  # by area
    assert report.volume == pytest.approx(sum(p.volume for p in report.parts))


def test_a_cavity_counts_against_the_volume():
    shell = joined(sphere(2.0, 3), turned(sphere(1.0, 3)))
    report = measure(shell)
    outer, inner = (p.volume for p in report.parts)
    assert inner < 0 < outer
    assert report.volume == pytest.approx(outer + inner)


def test_an_open_surface_has_no_volume_but_loops():
    flat = plane(11)
    report = measure(flat)
    assert (report.volume, report.closed, report.euler) == (None, False, 1)
    assert (report.boundary_edges, report.boundary_loops, report.genus) == (40, 1, 0)
    cell = np.indices((10, 10)).reshape(2, -1)  # the middle 2 × 2 cells go
    hole = np.tile(np.all((cell == 4) | (cell == 5), axis=0), 2)
    report = measure(Mesh(flat.vertices, flat.faces[~hole]))
    assert (report.boundary_loops, report.euler, report.genus) == (2, 0, 0)
    assert report.unused_vertices == 1


def test_what_is_no_manifold_is_counted():
    book = mesh_of(  # three pages at one edge
        [[0, 0, 0], [0, 0, 1], [1, 0, 0], [0, 1, 0], [-1, 0, 0]], [[0, 1, 2], [0, 1, 3], [0, 1, 4]]
    )
    report = measure(book)
    assert (report.non_manifold_edges, report.non_manifold_vertices, report.genus) == (1, 2, None)
    bow = mesh_of([[0, 0, 0], [1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]], [[0, 1, 2], [0, 3, 4]])
    assert (measure(bow).non_manifold_edges, measure(bow).non_manifold_vertices) == (0, 1)
    wrong = mesh_of([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [1, 2, 3]])
    assert measure(wrong).inconsistent_edges == 1


def test_bad_faces_are_counted():
    mesh = mesh_of(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0], [9, 9, 9]],
        [[0, 1, 2], [2, 0, 1], [1, 0, 2], [0, 0, 1], [0, 1, 3]],
    )
    report = measure(mesh)
    assert (report.duplicate_faces, report.degenerate_faces, report.unused_vertices) == (2, 2, 1)


def test_empty_and_points():
    for mesh in (Mesh(np.empty((0, 3))), Mesh(np.ones((4, 3)))):
        report = measure(mesh)
        assert (report.triangles, report.components, report.euler, report.area) == (0, 0, 0, 0)
        assert (report.closed, report.volume) == (False, None)
        json.dumps(report.as_dict(), allow_nan=False)


def test_soups_against_trimesh(rng):
    for _ in range(20):
        n, m = rng.integers(4, 30), rng.integers(1, 60)
        faces = np.array([rng.choice(n, 3, replace=False) for _ in range(m)])
        mesh = mesh_of(rng.random((n, 3)), faces)
        other = trimesh.Trimesh(mesh.vertices, faces, process=False, validate=False)
        report = measure(mesh)
        used = np.unique(faces)
        counts = np.unique(np.sort(other.edges, axis=1), axis=0, return_counts=True)[1]
        assert report.euler == len(used) - len(counts) + m
        assert report.boundary_edges == (counts == 1).sum()
        assert report.non_manifold_edges == (counts > 2).sum()
        assert report.duplicate_faces == m - len(np.unique(np.sort(faces, axis=1), axis=0))
        assert report.area == pytest.approx(other.area)
        labels = trimesh.graph.connected_component_labels(other.edges_unique, n)
        assert report.components == len(np.unique(labels[used]))
        directed = {}
        for a, b in other.edges:
            directed[min(a, b), max(a, b)] = directed.get((min(a, b), max(a, b)), 0) + (
                1 if a < b else -1
            )
        assert report.closed == (not any(directed.values()))


def test_json_has_units_and_a_limit():
    many = joined(*(mesh_of(TETRAHEDRON.vertices + 3 * k, TETRAHEDRON.faces) for k in range(130)))
    facts = measure(many).as_dict()
    assert facts["components"] == 130
    assert len(facts["parts"]) == LISTED
    assert {"area_mm2", "volume_mm3", "low_mm", "high_mm"} <= set(facts)
    json.dumps(facts, allow_nan=False)
