from __future__ import annotations

import numpy as np
import pytest

import volviz
from tests.meshes.shapes import double_torus, joined, mesh_of, plane, sphere, torus
from volviz.errors import Cancelled, UsageError
from volviz.isosurface import extract_surface
from volviz.meshes.decimate import decimate
from volviz.meshes.distance import distances, two_sided
from volviz.meshes.measure import measure
from volviz.meshes.normals import face_normals, with_normals
from volviz.meshes.weld import weld
from volviz.model.mesh import Mesh
from volviz.progress import Progress


def same_topology(one, other):
    names = ("components", "euler", "genus", "boundary_loops", "closed", "inconsistent_edges")
    a, b = measure(one), measure(other)
    assert [getattr(a, n) for n in names] == [getattr(b, n) for n in names]
    assert b.non_manifold_edges == a.non_manifold_edges
    assert b.non_manifold_vertices == a.non_manifold_vertices
    assert b.duplicate_faces == a.duplicate_faces
    assert b.unused_vertices == 0


def test_a_sphere_keeps_its_shape():
    shape = sphere(50.0, 6)
    made = decimate(shape, 0.9)
    assert len(made.faces) == pytest.approx(0.1 * len(shape.faces), abs=2)
    same_topology(shape, made)
    middles = made.vertices[made.faces].mean(axis=1)
    assert np.abs(np.linalg.norm(middles, axis=1) - 50).max() < 0.1
    assert measure(made).volume == pytest.approx(measure(shape).volume, rel=1e-3)
    assert np.all((face_normals(made) * middles).sum(axis=1) > 0)


@pytest.mark.parametrize("reduction", [0.5, 0.95, 1.0])
@pytest.mark.parametrize("shape", [torus(along=60, around=30), sphere(2.0, 3), double_torus()])
def test_handles_stay_whatever_is_asked(shape, reduction):
    made = decimate(shape, reduction)
    same_topology(shape, made)
    assert len(made.faces) < len(shape.faces)
    if reduction < 0.6:
        assert len(made.faces) == pytest.approx(len(shape.faces) * (1 - reduction), abs=2)


def test_a_sphere_cannot_become_less_than_a_tetrahedron():
    assert len(decimate(sphere(1.0, 3), 1.0).faces) >= 4
    tetrahedron = mesh_of(np.eye(4)[:, :3], [[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    assert len(decimate(tetrahedron, 1.0).faces) == 4
    lone = mesh_of(np.eye(3), [[0, 1, 2]])
    assert len(decimate(lone, 1.0, boundary="simplified").faces) == 1


def holes(mesh, *where):
    """The faces whose middles are farther than 0.12 from all of these points."""
    middles = mesh.vertices[mesh.faces].mean(axis=1)[:, :2]
    far = [np.linalg.norm(middles - p, axis=1) > 0.12 for p in where]
    faces = mesh.faces[np.all(far, axis=0)]
    used = np.unique(faces)
    return Mesh(mesh.vertices[used], np.searchsorted(used, faces).astype(np.uint32))


def rim(mesh):
    edges = np.sort(
        np.concatenate([mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]], mesh.faces[:, [2, 0]]]), 1
    )
    found, counts = np.unique(edges, axis=0, return_counts=True)
    return {frozenset(map(tuple, mesh.vertices[e].tolist())) for e in found[counts == 1]}


def test_a_fixed_boundary_is_the_same_edges():
    sheet = holes(plane(41, lambda x, y: 0.1 * np.sin(6 * x) * y), (0.3, 0.3), (0.7, 0.6))
    made = decimate(sheet, 0.8)
    assert rim(made) == rim(sheet)
    same_topology(sheet, made)
    assert len(made.faces) == pytest.approx(len(sheet.faces) * 0.2, abs=2)


def test_a_boundary_is_simplified_along_itself():
    sheet = holes(plane(41), (0.3, 0.3), (0.7, 0.6))
    made = decimate(sheet, 0.95, boundary="simplified")
    same_topology(sheet, made)
    assert len(rim(made)) < len(rim(sheet)) / 2
    assert np.abs(made.vertices[:, 2]).max() < 1e-6  # flat stays flat
    assert measure(made).area == pytest.approx(measure(sheet).area, rel=0.01)
    box = np.array([made.vertices.min(0), made.vertices.max(0)])[:, :2]
    assert np.allclose(box, [[0, 0], [1, 1]], atol=1e-6)
    assert len(decimate(plane(41), 1 - 2 / 3200, boundary="simplified").faces) == 2


def test_a_flat_part_costs_nothing():
    """A fine cube: eight corners and twelve edges are all there is."""
    turns = [np.eye(3), [[0, 0, 1], [0, 1, 0], [-1, 0, 0]], [[1, 0, 0], [0, 0, -1], [0, 1, 0]]]
    parts = []
    for turn in turns:
        for sign in (1, -1):
            points = (plane(11).vertices - [0.5, 0.5, -0.5]) @ np.diag([1, sign, sign])
            parts.append(mesh_of(points @ np.array(turn, float), plane(11).faces))
    cube = weld(joined(*parts), 1e-4)
    assert measure(cube).volume == pytest.approx(1)
    made = decimate(cube, 1 - 12 / len(cube.faces))
    assert len(made.faces) <= 14
    assert measure(made).volume == pytest.approx(1, rel=1e-4)
    assert two_sided(made, cube).hausdorff < 1e-4


@pytest.mark.parametrize("limit", [0.02, 0.2])
def test_the_error_is_held_as_measured(limit):
    shape = mesh_of(torus(30.0, 10.0, 120, 60).vertices, torus(along=120, around=60).faces)
    made = decimate(shape, max_error=limit)
    assert len(made.faces) < len(shape.faces)
    # by other means: vertices one way, dense points of the faces the other
    weights = np.random.default_rng(1).dirichlet((1, 1, 1), (len(made.faces), 40))
    points = np.einsum("fsk,fkx->fsx", weights, made.vertices[made.faces]).reshape(-1, 3)
    assert distances(points, shape).max() <= limit * 1.05
    assert distances(shape.vertices, made).max() <= limit
    same_topology(shape, made)


def test_a_looser_limit_takes_more():
    counts = [len(decimate(sphere(10.0, 5), max_error=e).faces) for e in (0.01, 0.1, 1.0)]
    assert counts == sorted(counts, reverse=True)
    assert counts[0] > 2 * counts[-1]


def test_no_manifold_is_left_alone_there():
    bump = plane(21, lambda x, y: 0.05 * np.sin(9 * x))
    fin = mesh_of(  # a fin on an inner edge: three faces there
        np.concatenate([bump.vertices, [[0.5, 0.5, 0.5]]]),
        np.concatenate([bump.faces, [[220, 241 - 20, 441]]]),
    )
    before = measure(fin)
    made = decimate(fin, 0.7)
    after = measure(made)
    assert before.non_manifold_edges == after.non_manifold_edges == 1
    assert (after.euler, after.components) == (before.euler, before.components)
    assert {p.tobytes() for p in fin.vertices[[220, 221]]} <= {p.tobytes() for p in made.vertices}


@pytest.mark.parametrize("reduction", [0.5, 0.9, 1.0])
def test_two_parts_that_touch_in_a_point_stay_there(reduction):
    one = sphere(1.0, 3)
    top = int(np.argmax(one.vertices[:, 2]))
    other = mesh_of(one.vertices + 2 * one.vertices[top], one.faces)
    low = int(np.argmin(other.vertices[:, 2]))
    faces = joined(one, other).faces.copy()
    faces[faces == low + len(one.vertices)] = top
    both = weld(Mesh(joined(one, other).vertices, faces), 1e-6)
    assert measure(both).non_manifold_vertices == 1
    made = decimate(both, reduction)
    same_topology(both, made)
    assert np.any(np.all(made.vertices == one.vertices[top], axis=1))


@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("reduction", [0.5, 0.9, 1.0])
def test_a_strip_between_two_boundaries_is_not_pinched(closed, reduction):
    """One square wide: every edge across it joins two boundaries, and may not be collapsed."""
    angle = np.linspace(0, 2 * np.pi if closed else np.pi, 60, endpoint=not closed)
    ring = np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    last = len(ring) if closed else len(ring) - 1
    inner = np.arange(last)
    after = (inner + 1) % len(ring)
    outer, beyond = inner + len(ring), after + len(ring)
    corners = [[inner, outer, beyond], [inner, beyond, after]]
    faces = np.concatenate([np.stack(c, axis=1) for c in corners])
    strip = mesh_of(np.concatenate([ring, 1.02 * ring]), faces)
    made = decimate(strip, reduction, boundary="simplified")
    same_topology(strip, made)
    assert measure(made).boundary_loops == (2 if closed else 1)
    assert len(made.faces) < len(strip.faces)


def test_a_waist_is_not_pinched():
    """A short edge inside, both ends on the boundary: cheap, and nothing but the ends' places
    speaks against it; the two halves would hang together in a point."""
    points = [(0, -1e-3), (0, 1e-3), (-1, 0), (1, 0), (-1, -1), (1, -1), (-1, 1), (1, 1)]
    faces = [(0, 3, 1), (0, 1, 2), (0, 2, 4), (0, 5, 3), (1, 6, 2), (1, 3, 7)]
    bow = mesh_of([(x, y, 0) for x, y in points], faces)
    assert measure(bow).non_manifold_vertices == measure(bow).inconsistent_edges == 0
    for reduction in (0.3, 0.6, 1.0):
        same_topology(bow, decimate(bow, reduction, boundary="simplified"))


def test_no_triangle_is_made_flat():
    """A grid has many vertices in a row; where one goes, three others must not be a triangle."""
    for reduction in (0.3, 0.6, 0.8):
        made = decimate(plane(33), reduction)
        corners = made.vertices[made.faces].astype(np.float64)
        sides = corners[:, 1:] - corners[:, :1]
        areas = np.cross(sides[:, 0], sides[:, 1])[:, 2]
        assert areas.min() > 1e-9


def gyroid(count):
    z, y, x = (
        a * np.float32(6)
        for a in np.ogrid[-1 : 1 : count * 1j, -1 : 1 : count * 1j, -1 : 1 : count * 1j]
    )
    field = np.sin(x) * np.cos(y) + np.sin(y) * np.cos(z) + np.sin(z) * np.cos(x)
    return extract_surface(volviz.Volume.from_array(field.astype(np.float32)), 0.01)


def test_needles_hold_nothing_up_on_a_saddle():
    """Saddles all over, cut into triangles of any shape, needles too. A limit on the shape from the
    start left these as they are, and the rest was a fifth farther off."""
    shape = gyroid(64)
    made = decimate(shape, 0.95)
    same_topology(shape, made)
    assert two_sided(made, shape, step=1.0).rms < 0.33


def test_colours_values_and_normals_go_along():
    shape = with_normals(sphere(10.0, 5))
    height = shape.vertices[:, 2]
    colors = np.zeros((len(height), 4), np.uint8)
    colors[:, 0], colors[:, 3] = (height + 10) * 12, 200
    shape = Mesh(shape.vertices, shape.faces, shape.normals, height, colors, "LPS", 3)
    made = decimate(shape, 0.9)
    assert np.abs(made.values - made.vertices[:, 2]).max() < 0.3
    assert np.abs(made.colors[:, 0] - (made.vertices[:, 2] + 10) * 12).max() < 5
    assert np.all(made.colors[:, 3] == 200)
    assert np.allclose(np.linalg.norm(made.normals, axis=1), 1, atol=1e-5)
    assert (made.normals * made.vertices / 10).sum(axis=1).min() > 0.99
    assert (made.space, made.skipped) == ("LPS", 3)


def test_far_from_the_origin_it_is_the_same():
    shape = sphere(1.0, 4)
    there = mesh_of(shape.vertices * 1000 + 4096, shape.faces)
    made = decimate(there, 0.8)
    assert np.abs(np.linalg.norm(made.vertices - 4096, axis=1) - 1000).max() < 10


def test_nothing_to_do():
    shape = sphere(1.0, 2)
    assert decimate(shape, 0.0) is shape
    empty = Mesh(np.empty((0, 3)))
    assert decimate(empty, 0.5) is empty
    points = Mesh(np.ones((5, 3)))
    assert decimate(points, 0.5, max_error=1.0) is points


def test_repeated_runs_are_equal():
    one, two = (decimate(torus(along=90, around=40), 0.7) for _ in range(2))
    assert np.array_equal(one.vertices, two.vertices)
    assert np.array_equal(one.faces, two.faces)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"reduction": 1.5}, "--decimate"),
        ({"max_error": -1.0}, "--max-error"),
        ({"boundary": "fixd"}, "did you mean 'fixed'"),
    ],
)
def test_wrong_values_are_told(more, words):
    with pytest.raises(UsageError, match=words):
        decimate(sphere(), **more)


def test_cancel():
    progress = Progress()
    progress.cancel()
    with pytest.raises(Cancelled):
        decimate(sphere(1.0, 4), 0.9, progress=progress)
