"""Marching cubes against closed forms, against itself on moved grids, and against its peers."""

from __future__ import annotations

import threading

import numpy as np
import pytest

from tests.isosurface import oracles
from tests.isosurface.shapes import SHEARED, VOLUMES_FOR_DTYPES, coordinates, sphere, torus
from volviz import extract_surface
from volviz.errors import Cancelled, UsageError
from volviz.fields.gradient import gradient
from volviz.isosurface import finder_of
from volviz.isosurface.extractors.marching_cubes import extract
from volviz.model.mesh import Mesh
from volviz.model.volume import Volume
from volviz.progress import Progress


@pytest.mark.parametrize(("volume", "genus"), [(sphere(30), 0), (torus(40), 1), (torus(60, 2), 2)])
def test_closed_surfaces_have_their_genus(volume, genus):
    mesh = extract(volume, 0.0)
    oracles.assert_closed(mesh)
    assert oracles.parts(mesh)[0] == 1
    assert oracles.euler(mesh) == 2 - 2 * genus
    assert oracles.volume_inside(mesh) > 0


def test_sphere_converges_in_second_order():
    errors = []
    for n in (17, 33, 65):
        mesh = extract(sphere(n), 0.0)
        radius = np.linalg.norm(mesh.vertices.astype(float), axis=1)
        outward = mesh.vertices / radius[:, None]
        errors.append(
            (
                abs(oracles.area(mesh) - 4 * np.pi * 0.49),
                abs(oracles.volume_inside(mesh) - 4 / 3 * np.pi * 0.343),
                np.abs(radius - 0.7).max(),
                np.abs(mesh.normals - outward).max(),
            )
        )
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:])).mean(axis=0)
    assert np.all(orders > 1.7), orders


def test_normals_have_unit_length_and_point_to_lower_values():
    mesh = extract(sphere(24), 0.0)
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-6)
    a, b, c = np.moveaxis(oracles.corners(mesh), 1, 0)
    faces = np.cross(b - a, c - a)
    assert np.all(np.einsum("ij,ij->i", faces, mesh.normals[mesh.faces[:, 0]]) > 0)


@pytest.mark.parametrize("operator", ["central", "sobel", "forward", "backward"])
def test_normals_are_the_gradient_between_two_samples(operator, rng):
    data = rng.standard_normal((7, 8, 9)).astype(np.float32)
    volume = Volume.from_array(data, affine=SHEARED)
    mesh = extract(volume, 0.25, normals=operator, ambiguity="table15")
    slopes = gradient(volume, operator)
    index = np.linalg.solve(SHEARED[:3, :3], (mesh.vertices - SHEARED[:3, 3]).T).T
    on_edge = (np.abs(index - np.rint(index)) > 1e-4).sum(axis=1) == 1
    assert on_edge.mean() > 0.9
    for at, normal in zip(index[on_edge], mesh.normals[on_edge], strict=True):
        axis = int(np.argmax(np.abs(at - np.rint(at))))
        low = np.rint(at).astype(int)
        low[axis] = int(np.floor(at[axis]))
        high = low.copy()
        high[axis] += 1
        t = at[axis] - low[axis]
        between = (1 - t) * slopes[tuple(low[::-1])] + t * slopes[tuple(high[::-1])]
        assert np.allclose(normal, -between / np.linalg.norm(between), atol=2e-3)


def test_no_normals_on_request():
    mesh = extract(sphere(12), 0.0, normals="none")
    assert mesh.normals.shape == (0, 3)
    assert np.array_equal(mesh.vertices, extract(sphere(12), 0.0).vertices)


@pytest.mark.parametrize("mirrored", [False, True])
def test_sheared_and_mirrored_grids_are_the_image_of_the_plain_one(mirrored, rng):
    affine = SHEARED.copy()
    if not mirrored:  # its determinant is negative
        affine[:3, 0] *= -1
    data = np.pad(rng.standard_normal((6, 7, 8)), 1, constant_values=-3).astype(np.float32)
    plain = extract(Volume.from_array(data), 0.1)
    moved = extract(Volume.from_array(data, affine=affine), 0.1)
    image = plain.vertices @ affine[:3, :3].T + affine[:3, 3]
    assert np.allclose(moved.vertices, image, atol=1e-4)
    faces = plain.faces[:, ::-1] if mirrored else plain.faces
    assert np.array_equal(moved.faces.astype(int).sum(), faces.astype(int).sum())
    assert oracles.volume_inside(moved) > 0
    factor = abs(np.linalg.det(affine[:3, :3]))
    assert oracles.volume_inside(moved) == pytest.approx(
        factor * oracles.volume_inside(plain), rel=1e-4
    )
    normals = plain.normals @ np.linalg.inv(affine[:3, :3])
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    assert np.allclose(moved.normals, normals, atol=1e-4)


@pytest.mark.parametrize("dtype", VOLUMES_FOR_DTYPES)
def test_every_dtype_gives_the_same_surface(dtype):
    x, y, z, _ = coordinates(14)
    whole = np.maximum(np.rint(100 - 70 * np.sqrt(x * x + y * y + z * z)), 0)
    expected = extract(Volume.from_array(whole.astype(np.float32)), 40.5)
    mesh = extract(Volume.from_array(whole.astype(dtype)), 40.5)
    assert np.array_equal(mesh.vertices, expected.vertices)
    assert np.array_equal(mesh.faces, expected.faces)


def test_padding_and_nan_are_left_out_and_counted():
    data = sphere(20).data.copy()
    data[10, 10, 2:18] = np.nan
    mesh = extract(Volume.from_array(data), 0.0)
    assert mesh.skipped == 2 * 2 * 17
    assert np.all(np.isfinite(mesh.vertices))
    assert np.all(np.isfinite(mesh.normals))
    assert oracles.boundary_edges(mesh) > 0
    padded = extract(Volume.from_array(np.nan_to_num(data, nan=-99), padding=-99), 0.0)
    assert np.array_equal(mesh.vertices, padded.vertices)
    assert np.array_equal(mesh.normals, padded.normals)


@pytest.mark.parametrize("level", [-5.0, 99.0, 1e300])
def test_outside_the_range_is_empty(level):
    mesh = extract(sphere(8), level)
    assert mesh.empty
    assert mesh.faces.shape == mesh.normals.shape == mesh.vertices.shape == (0, 3)


def test_constant_thin_and_integer_extremes():
    assert extract(Volume.from_array(np.full((4, 4, 4), 7, np.uint8)), 7).empty
    assert extract(Volume.from_array(np.zeros((1, 4, 4), np.uint8)), 0).empty
    assert extract(Volume.from_array(np.zeros((4, 4, 4), np.uint8)), 300).empty
    assert extract(Volume.from_array(np.zeros((4, 4, 4), np.uint8)), -300).empty
    thin = np.zeros((2, 5, 5), np.uint8)
    thin[:, 2, 2] = 10
    mesh = extract(Volume.from_array(thin), 5)
    assert len(mesh.faces) == 8
    assert oracles.boundary_edges(mesh) == 2 * 8


def test_a_sample_at_the_isovalue_is_inside():
    data = np.zeros((5, 5, 5), np.uint8)
    data[2, 2, 2] = 4
    mesh = extract(Volume.from_array(data), 4.0)
    oracles.assert_closed(mesh)
    assert oracles.euler(mesh) == 2
    assert np.allclose(mesh.vertices, 2)
    assert extract(Volume.from_array(data), np.nextafter(4.0, 5)).empty


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("across", [3, 8])
def test_where_the_gradient_vanishes_normals_still_point_to_lower_values(axis, across):
    """Every second layer is inside: central differences are 0 away from the ends."""
    shape = [across] * 3
    shape[2 - axis] = 8
    layers = np.indices(shape)[2 - axis] % 2
    mesh = extract(Volume.from_array(layers.astype(np.float32)), 0.5)
    at = mesh.vertices[:, axis]
    expected = np.zeros((len(at), 3))
    expected[:, axis] = np.where(np.floor(at) % 2 == 1, 1, -1)  # from an odd layer down to the next
    assert len(at) == 7 * across**2
    assert np.allclose(mesh.normals, expected, atol=1e-6)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_so_they_do_far_from_the_border_of_the_volume(axis):
    """As above, in a box amid zeros: there the samples have neighbours on all sides."""
    layers = np.indices((20, 20, 20))[2 - axis] % 2
    layers = np.pad(layers[4:-4, 4:-4, 4:-4], 4)
    mesh = extract(Volume.from_array(layers.astype(np.float32)), 0.5, normals="central")
    amid = np.all((mesh.vertices > 6) & (mesh.vertices < 13), axis=1)
    at = mesh.vertices[amid, axis]
    assert len(at) > 100
    expected = np.where(np.floor(at) % 2 == 1, 1, -1)
    assert np.allclose(mesh.normals[amid, axis], expected, atol=1e-6)


def test_the_filled_side_of_a_tube():
    """Opposite corners joined through the cell, and the plain case 13 with one of two tubes."""
    corners = np.full((2, 2, 2), -0.1)
    corners[0, 0, 0] = corners[1, 1, 1] = 1.0
    data = np.pad(corners, 1, constant_values=-1.0).astype(np.float32)
    joined = extract(Volume.from_array(data), 0.0)
    assert oracles.parts(joined)[0] == 1
    assert oracles.parts(extract(Volume.from_array(data), 0.0, ambiguity="asymptotic"))[0] == 2


@pytest.mark.parametrize("ambiguity", ["trilinear", "asymptotic", "table15"])
def test_same_bytes_every_time_and_on_any_number_of_threads(ambiguity, rng):
    volume = Volume.from_array(rng.standard_normal((40, 20, 30)).astype(np.float32))
    first = extract(volume, 0.2, ambiguity=ambiguity)
    results = []
    workers = [
        threading.Thread(target=lambda: results.append(extract(volume, 0.2, ambiguity=ambiguity)))
        for _ in range(3)
    ]
    for worker in workers:
        worker.start()
    for worker in workers:
        worker.join()
    assert len(results) == 3
    for mesh in results:
        assert all(
            np.array_equal(getattr(mesh, k), getattr(first, k))
            for k in ("vertices", "normals", "faces")
        )


def test_scikit_image_agrees_on_area_and_volume(data):
    measure = pytest.importorskip("skimage.measure", exc_type=ImportError)
    from volviz.io import load

    volume = load(data / "ct" / "totalseg_torso_sm_ct.nii.gz")
    block = np.pad(volume.data.astype(np.float32), 1, constant_values=-1100)
    mesh = extract(Volume.from_array(block), -200.5)
    vertices, faces, _, _ = measure.marching_cubes(block, -200.5)
    theirs = Mesh(vertices[:, ::-1].astype(np.float32), faces.astype(np.uint32))
    assert oracles.area(mesh) == pytest.approx(oracles.area(theirs), rel=0.01)
    assert oracles.volume_inside(mesh) == pytest.approx(
        abs(oracles.volume_inside(theirs)), rel=0.01
    )
    oracles.assert_closed(mesh)


def test_cancel_stops_in_the_middle(rng):
    """In each step, one after the other; the next call is whole again."""
    volume = Volume.from_array(rng.standard_normal((60, 60, 60)).astype(np.float32))
    for stop in ("classifying", "counting", "vertices", "triangles"):
        progress = Progress()
        progress._report = lambda _, step, p=progress, s=stop: p.cancel() if step == s else None
        with pytest.raises(Cancelled):
            extract(volume, 0.0, progress=progress)
    assert len(extract(volume, 0.0).faces) > 0


def test_progress_grows_to_the_end(rng):
    seen = []
    volume = Volume.from_array(rng.standard_normal((30, 30, 30)).astype(np.float32))
    extract(volume, 0.0, progress=Progress(lambda part, _: seen.append(part)))
    assert seen == sorted(seen)
    assert seen[-1] > 0.7


def test_public_function_and_its_errors():
    volume = sphere(16)
    first = extract_surface(volume, 0.0)
    again = extract_surface(volume, 0.0)  # from the second one on by the ranges of bricks
    assert finder_of(volume, "bricks").report.build_seconds > 0
    assert finder_of(sphere(16), "bricks") is None
    slow = extract_surface(volume, 0.0, finder="brute-force")
    for mesh in (again, slow):
        assert np.array_equal(mesh.vertices, first.vertices)
        assert np.array_equal(mesh.faces, first.faces)
    with pytest.raises(UsageError, match="did you mean 'marching-cubes'"):
        extract_surface(volume, 0.0, method="marchingcubes")
    with pytest.raises(UsageError, match="brute-force"):
        extract_surface(volume, 0.0, finder="brute")
    with pytest.raises(UsageError, match="finite"):
        extract_surface(volume, float("inf"))
    with pytest.raises(UsageError, match="cell ids"):
        extract(volume, 0.0, np.array([10**9]))
