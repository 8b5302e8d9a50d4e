from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from volviz.errors import UsageError
from volviz.model.transfer import (
    TransferFunction,
    corrected_opacity,
    linear_to_srgb,
    ramp,
    srgb_to_linear,
)

BONE = TransferFunction(
    ((100, 1, 0, 0), (300, 0, 1, 0), (1000, 0, 0, 1)), ((100, 0), (300, 0.5), (1000, 1)), 1.0
)


def test_table_is_the_interpolation_of_the_points():
    size = BONE.table_size(integers=True)
    values = np.linspace(100, 1000, size)
    table = BONE.table(size)
    assert np.allclose(table[:, 3], np.interp(values, [100, 300, 1000], [0, 0.5, 1]), atol=1e-6)
    green = np.interp(values, [100, 300, 1000], [0, 1, 0])
    assert np.allclose(table[:, 1], srgb_to_linear(green), atol=1e-6)


@pytest.mark.parametrize(
    ("span", "least"), [(255, 1024), (256, 4096), (4000, 4096), (65535, 65536)]
)
def test_tables_are_fine_enough_and_hit_every_integer(span, least):
    size = ramp(0, span).table_size(integers=True)
    assert least <= size <= 65536
    assert (size - 1) % span == 0


def test_tables_of_floats_resolve_narrow_points():
    narrow = TransferFunction(((0, 0, 0, 0), (1000, 1, 1, 1)), ((0, 0), (1, 1), (2, 0), (1000, 0)))
    assert narrow.table_size(integers=False) >= 4000
    assert narrow.table(narrow.table_size(integers=False))[:, 3].max() > 0.95


@given(st.floats(0, 0.999), st.integers(1, 50))
def test_corrected_opacity_composes(opacity, parts):
    """n steps of 1/n of the unit distance gather what one step of it does."""
    small = corrected_opacity(np.array(opacity), 1 / parts, 1.0)
    assert 1 - (1 - small) ** parts == pytest.approx(opacity, abs=1e-9)


def test_opaque_stays_opaque():
    assert corrected_opacity(np.array(1.0), 0.01, 1.0) == 1


@given(st.floats(0, 1))
@example(0.04045)
def test_srgb_there_and_back(value):
    assert linear_to_srgb(srgb_to_linear(value)) == pytest.approx(value, abs=1e-9)


def test_moves():
    assert BONE.shifted(50).domain == (150, 1050)
    assert BONE.stretched(0, 9).domain == (0, 9)
    assert BONE.faded(0.5).opacity_at(1000) == pytest.approx(0.5)
    assert BONE.faded(5).opacity_at(1000) == 1


@pytest.mark.parametrize(
    ("colors", "opacities", "unit", "word"),
    [
        ((), ((0, 1),), 1, "at least one"),
        (((0, 1, 1, 1),), ((0, 1), (float("nan"), 1)), 1, "finite"),
        (((0, 1, 1, 2),), ((0, 1),), 1, "between 0 and 1"),
        (((0, 1, 1, 1),), ((1, 1), (0, 1)), 1, "not decrease"),
        (((0, 1, 1),), ((1, 1),), 1, "4 numbers"),
        (((0, 1, 1, 1),), ((1, 1),), 0, "distance"),
        (((0, 1, 1, 1),), ((1, "x"),), 1, "numbers"),
    ],
)
def test_bad_points_are_refused(colors, opacities, unit, word):
    with pytest.raises(UsageError, match=word):
        TransferFunction(colors, opacities, unit)
