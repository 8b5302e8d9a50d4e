"""Gradients against analytic fields, in world units."""

from __future__ import annotations

import numpy as np
import pytest

from volviz.errors import UsageError
from volviz.fields.gradient import OPERATORS, gradient
from volviz.model.volume import Volume

SHEARED = np.array([[0.8, 0.3, 0, 5], [0.1, -1.5, 0.2, -7], [0, 0.4, 2.0, 3], [0, 0, 0, 1]])


def world(affine, shape):
    z, y, x = np.indices(shape)
    return np.stack([x, y, z], axis=-1) @ affine[:3, :3].T + affine[:3, 3]


@pytest.mark.parametrize("operator", OPERATORS)
def test_linear_field_is_exact_on_a_sheared_grid(operator):
    slope = np.array([0.5, -2.0, 1.25])
    volume = Volume.from_array(world(SHEARED, (5, 6, 7)) @ slope, affine=SHEARED)
    assert np.allclose(gradient(volume, operator), slope, atol=1e-5)


@pytest.mark.parametrize(("operator", "order"), [("central", 2), ("sobel", 2), ("forward", 1)])
def test_order_of_convergence(operator, order):
    errors = []
    for n in (16, 32):
        at = world(np.diag([1 / n, 2 / n, 1 / n, 1]), (n, n, n))
        volume = Volume.from_array(
            np.sin(2 * at[..., 0]) * np.cos(at[..., 1]), (1 / n, 2 / n, 1 / n)
        )
        true = 2 * np.cos(2 * at[..., 0]) * np.cos(at[..., 1])
        inner = (slice(2, -2),) * 3
        errors.append(np.abs(gradient(volume, operator)[..., 0] - true)[inner].max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.25)


def test_sobel_is_the_weighted_mean_of_the_survey(rng):
    data = rng.standard_normal((3, 3, 3))
    plane = np.array([[1, 3, 1], [3, 6, 3], [1, 3, 1]]) / (2 * 22)
    expected = ((data[2] - data[0]) * plane).sum()
    assert gradient(Volume.from_array(data), "sobel")[1, 1, 1, 2] == pytest.approx(expected)


def test_thin_volumes_and_small_integers():
    volume = Volume.from_array(np.array([[[0, 255]]], dtype=np.uint8))
    assert np.array_equal(gradient(volume)[0, 0], [[255, 0, 0], [255, 0, 0]])


def test_unknown_operator():
    with pytest.raises(UsageError, match="did you mean 'sobel'"):
        gradient(Volume.from_array(np.zeros((2, 2, 2))), "sobell")
