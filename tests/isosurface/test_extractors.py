"""What every extractor of closed surfaces promises, whichever it is."""

from __future__ import annotations

import numpy as np
import pytest

from tests.isosurface import oracles
from tests.isosurface.shapes import SHEARED, sphere, torus
from volviz.errors import Cancelled, UsageError
from volviz.isosurface.extractors import EXTRACTORS
from volviz.model.knobs import knobs_of
from volviz.model.surface import Surface
from volviz.model.volume import Volume
from volviz.progress import Progress

OTHERS = [name for name in EXTRACTORS if name != "marching-cubes"]
CLOSED = [name for name in OTHERS if name != "dividing-cubes"]
AREA_ERROR = {"cuberille": 0.6, "contour-tracing": 0.2, "discretized-marching-cubes": 0.15}


def noise(shape=(7, 8, 9)):
    """Noise with zeros round it: every case of every cell, and a closed surface."""
    inner = np.random.default_rng(5).standard_normal(shape)
    return Volume.from_array(np.pad(inner, 1, constant_values=-3).astype(np.float32))


@pytest.mark.parametrize(("volume", "genus"), [(sphere(20), 0), (torus(28), 1), (torus(50, 2), 2)])
@pytest.mark.parametrize("name", CLOSED)
def test_closed_surfaces_have_their_genus(name, volume, genus):
    mesh = EXTRACTORS[name].extract(volume, 0.0)
    oracles.assert_closed(mesh)
    assert oracles.parts(mesh)[0] == 1
    assert oracles.euler(mesh) == 2 - 2 * genus
    assert oracles.volume_inside(mesh) > 0


@pytest.mark.parametrize("name", CLOSED)
def test_area_and_volume_of_a_sphere(name):
    mesh = EXTRACTORS[name].extract(sphere(40), 0.0)
    assert oracles.area(mesh) == pytest.approx(4 * np.pi * 0.49, rel=AREA_ERROR.get(name, 0.02))
    assert oracles.volume_inside(mesh) == pytest.approx(4 / 3 * np.pi * 0.343, rel=0.02)


@pytest.mark.parametrize("name", CLOSED)
def test_noise_is_closed_too(name):
    mesh = EXTRACTORS[name].extract(noise(), 0.1)
    oracles.assert_closed(mesh)
    assert oracles.volume_inside(mesh) > 0


@pytest.mark.parametrize("mirror", [False, True])
@pytest.mark.parametrize("name", OTHERS)
def test_sheared_and_mirrored_grids_face_out(name, mirror):
    affine = SHEARED.copy()
    if not mirror:
        affine[:3, 0] *= -1
    ball = sphere(16).data
    mesh = EXTRACTORS[name].extract(Volume.from_array(ball, affine=affine), 0.0)
    plain = EXTRACTORS[name].extract(Volume.from_array(ball), 0.0)
    middle = affine[:3, :3] @ np.full(3, 7.5) + affine[:3, 3]
    assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1, atol=1e-5)
    ways = np.einsum("ij,ij->i", mesh.normals, mesh.vertices - middle)
    assert np.mean(ways > 0) > 0.99
    if name in CLOSED:
        oracles.assert_closed(mesh)
        factor = abs(np.linalg.det(affine[:3, :3]))
        inside = oracles.volume_inside(plain)
        assert oracles.volume_inside(mesh) == pytest.approx(factor * inside, rel=0.02)


@pytest.mark.parametrize("name", OTHERS)
def test_nothing_to_show(name):
    extract = EXTRACTORS[name].extract
    for level in (-5.0, 99.0, 1e300):
        mesh = extract(sphere(8), level)
        assert mesh.vertices.shape == mesh.faces.shape == mesh.normals.shape == (0, 3)
    assert extract(Volume.from_array(np.full((4, 4, 4), 7, np.uint8)), 7).empty
    assert extract(Volume.from_array(np.zeros((1, 4, 4), np.uint8)), 0).empty
    assert extract(Volume.from_array(np.full((4, 4, 4), np.nan, np.float32)), 0).empty


@pytest.mark.parametrize("name", OTHERS)
def test_two_thin_and_a_sample_at_the_isovalue(name):
    thin = np.zeros((2, 5, 5), np.uint8)
    thin[:, 2, 2] = 10
    assert not EXTRACTORS[name].extract(Volume.from_array(thin), 5).empty
    point = np.zeros((5, 5, 5), np.uint8)
    point[2, 2, 2] = 4
    mesh = EXTRACTORS[name].extract(Volume.from_array(point), 4.0)
    assert np.all(np.isfinite(mesh.normals))
    assert np.abs(mesh.vertices - 2).max() <= 0.5
    if name in CLOSED:
        oracles.assert_closed(mesh)
        assert oracles.euler(mesh) == 2
    assert EXTRACTORS[name].extract(Volume.from_array(point), np.nextafter(4.0, 5)).empty


@pytest.mark.parametrize("name", OTHERS)
def test_cells_that_are_not_valid_are_left_out_and_counted(name):
    data = sphere(20).data.copy()
    data[10, 10, 2:18] = np.nan
    mesh = EXTRACTORS[name].extract(Volume.from_array(data), 0.0)
    assert mesh.skipped == 2 * 2 * 17
    assert len(mesh.vertices) > 0
    assert np.all(np.isfinite(mesh.vertices))
    assert np.all(np.isfinite(mesh.normals))
    padded = Volume.from_array(np.nan_to_num(data, nan=-99), padding=-99)
    again = EXTRACTORS[name].extract(padded, 0.0)
    assert again.skipped == mesh.skipped
    assert np.array_equal(again.vertices, mesh.vertices)


@pytest.mark.parametrize("name", OTHERS)
def test_cancel(name):
    progress = Progress()
    progress.cancel()
    with pytest.raises(Cancelled):
        EXTRACTORS[name].extract(sphere(12), 0.0, progress=progress)
    seen = []
    EXTRACTORS[name].extract(sphere(12), 0.0, progress=Progress(lambda at, _: seen.append(at)))
    assert seen == sorted(seen)


def test_cells_that_are_not_there():
    for name in OTHERS:
        if EXTRACTORS[name].by_cell:
            with pytest.raises(UsageError, match="cell ids"):
                EXTRACTORS[name].extract(sphere(6), 0.0, np.array([10**9]))


def test_rows_name_knobs_that_there_are():
    names = {k.name for k in knobs_of(Surface)}
    for row in EXTRACTORS.values():
        assert set(row.knobs) <= names
        assert row.guarantee
