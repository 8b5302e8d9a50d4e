"""Values and gradients at points of the world, against SciPy on any grid."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import map_coordinates

from volviz.errors import Cancelled
from volviz.fields.probe import gradient_magnitude_at, values_at
from volviz.model.volume import Volume
from volviz.progress import Progress

OBLIQUE = np.array([[0.7, 0.2, 0, 9], [-0.3, 1.1, 0.4, -7], [0.1, 0, -2, 3], [0, 0, 0, 1.0]])


def world(index: np.ndarray) -> np.ndarray:
    return index @ OBLIQUE[:3, :3].T + OBLIQUE[:3, 3]


@pytest.fixture
def field(rng) -> tuple[Volume, np.ndarray]:
    """A volume on an oblique grid, and indices (x, y, z) of points between its samples."""
    volume = Volume.from_array(rng.normal(0, 100, (7, 8, 9)).astype(np.int16), affine=OBLIQUE)
    return volume, rng.uniform(0, 1, (500, 3)) * (np.array(volume.dims) - 1)


def test_values_are_trilinear(field):
    volume, index = field
    found = values_at(volume, world(index))
    expected = map_coordinates(volume.data.astype(float), index[:, ::-1].T, order=1)
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-3)
    assert found.dtype == np.float32


def test_samples_themselves_are_exact(field):
    volume, _ = field
    z, y, x = np.indices(volume.data.shape).reshape(3, -1)
    found = values_at(volume, world(np.stack([x, y, z], axis=1)).astype(np.float32))
    np.testing.assert_allclose(found, volume.data[z, y, x], atol=0.1)


def test_gradient_is_that_of_numpy_interpolated(field):
    volume, index = field
    steps = np.stack(np.gradient(volume.data.astype(float))[::-1], axis=-1)
    slopes = steps @ np.linalg.inv(OBLIQUE[:3, :3])
    at = [map_coordinates(slopes[..., k], index[:, ::-1].T, order=1) for k in range(3)]
    expected = np.linalg.norm(at, axis=0)
    np.testing.assert_allclose(gradient_magnitude_at(volume, world(index)), expected, rtol=1e-4)


def test_a_linear_field_has_its_slope_everywhere(rng):
    z, y, x = np.indices((6, 6, 6))
    places = world(np.stack([x, y, z], axis=-1))
    volume = Volume.from_array((places @ (2.0, -3.0, 6.0)).astype(np.float32), affine=OBLIQUE)
    found = gradient_magnitude_at(volume, world(rng.uniform(0, 5, (50, 3))))
    np.testing.assert_allclose(found, 7.0, rtol=1e-4)


def test_outside_and_beside_invalid_samples_there_is_none():
    data = np.ones((4, 4, 4), np.float32)
    data[1, 1, 1] = np.nan
    volume = Volume.from_array(data)
    points = np.array(
        [[2.5, 2.5, 2.5], [1.5, 1.5, 1.5], [1, 1, 1], [2, 2, 2], [-0.1, 1, 1], [3.2, 0, 0]]
    )
    found = values_at(volume, points)
    assert np.isnan(found).tolist() == [False, True, True, False, True, True]
    padded = Volume.from_array(np.array([[[0, 5], [5, 5]]] * 2, np.int16), padding=0)
    assert np.isnan(values_at(padded, np.array([[0.5, 0.5, 0.5]])))[0]
    assert values_at(padded, np.array([[1.0, 0.5, 0.5]]))[0] == 5


def test_a_slice_has_half_a_sample_of_thickness():
    volume = Volume.from_array(np.arange(16, dtype=np.uint8).reshape(1, 4, 4))
    points = np.array([[1.5, 2, 0.4], [1.5, 2, -0.4], [1.5, 2, 0.6]])
    np.testing.assert_array_equal(values_at(volume, points), [9.5, 9.5, np.nan])


def test_no_points_and_cancel():
    volume = Volume.from_array(np.zeros((3, 3, 3), np.uint8))
    assert values_at(volume, np.empty((0, 3), np.float32)).shape == (0,)
    progress = Progress()
    progress.cancel()
    with pytest.raises(Cancelled):
        values_at(volume, np.zeros((1, 3)), progress)
