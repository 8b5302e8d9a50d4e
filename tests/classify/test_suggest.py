"""Suggestions: valid for anything, and sensible on phantoms and on real volumes."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.classify.test_labels import LABELS, MEASURED, opened
from volviz.classify.suggest import Suggestion, mip_transfer, suggest
from volviz.fields.statistics import statistics
from volviz.model.scene import Light, Raycast
from volviz.model.volume import Volume


def suggested(array: NDArray[Any], **info: Any) -> Suggestion:
    volume = Volume.from_array(array, **info)
    return suggest(volume, statistics(volume))


def visible(found: Suggestion, volume: Volume, least: float = 0.02) -> float:
    """Part of the voxels with more than `least` opacity per unit distance."""
    return float((found.transfer.opacity_at(volume.data) > least).mean())


def odd() -> dict[str, NDArray[Any]]:
    rng = np.random.default_rng(5)
    noise = rng.normal(size=(6, 7, 8))
    return {
        "constant": np.full((4, 4, 4), 7, np.int16),
        "zero": np.zeros((4, 4, 4), np.float32),
        "huge constant": np.full((2, 2, 2), 1e300),
        "nan": np.full((4, 4, 4), np.nan),
        "inf": np.full((3, 3, 3), np.inf),
        "one voxel": np.ones((1, 1, 1), np.uint8),
        "all floats": np.array([-1.7e308, 1.7e308] * 4).reshape(2, 2, 2),
        "denormal": np.array([0, 5e-324] * 4).reshape(2, 2, 2),
        "some nan": np.where(noise > 1, np.nan, noise),
        "mask": (noise > 0).astype(np.uint8),
        "64 bits": rng.integers(-(2**62), 2**62, (5, 5, 5)),
        "unsigned": rng.integers(0, 2**64, (5, 5, 5), dtype=np.uint64),
        "line": np.arange(10, dtype=np.int16).reshape(1, 1, 10),
        "outlier": np.concatenate([noise.ravel(), [1e12] * 4]).reshape(2, 2, -1),
        "negative": -np.abs(noise),
        "close": 1e9 + 1e-6 * np.abs(noise),
    }


@pytest.mark.parametrize("spacing", [1e-6, 1.0, 1e7])
@pytest.mark.parametrize("name", list(odd()))
def test_anything_gets_a_valid_function(name: str, spacing: float) -> None:
    volume = Volume.from_array(odd()[name], spacing=(spacing, spacing, spacing))
    facts = statistics(volume)
    found = suggest(volume, facts)
    for transfer in (found.transfer, mip_transfer(volume, facts)):
        assert np.isfinite(transfer.table(64)).all()
        assert transfer.table_size(integers=True) <= 65536
        assert transfer.unit_distance > 0
    knobs = found.knobs()
    ray = {k: v for k, v in knobs.items() if k in Raycast.__dataclass_fields__}
    Raycast(**ray)
    Light(**{k: v for k, v in knobs.items() if k not in ray})
    assert found.why


def test_unit_distance_scales_with_the_volume(rng: np.random.Generator) -> None:
    array = np.abs(rng.normal(size=(8, 8, 8)))
    units = [
        suggested(array, spacing=(s, s, s)).transfer.unit_distance / s for s in (1e-6, 1.0, 1e7)
    ]
    np.testing.assert_allclose(units, units[0])


def test_ct_shows_skin_and_bone(rng: np.random.Generator) -> None:
    parts = [(-1000, 40000), (-90, 9000), (50, 12000), (300, 1500), (1100, 1500)]
    array = np.concatenate([rng.normal(m, 18, n) for m, n in parts]).astype(np.int16)
    found = suggested(array.reshape(4, 100, 160), modality="CT")
    assert found.modality == "CT"
    assert found.transfer.name == "ct-head"
    assert found.transfer.opacity_at(-1000) == 0
    assert found.transfer.opacity_at(1100) > 0.5


@pytest.mark.parametrize(("half", "name"), [((75, 95), "ct-head"), ((170, 110), "ct-body")])
@pytest.mark.parametrize("order", [(0, 1, 2), (1, 0, 2), (2, 1, 0)])
def test_ct_of_a_trunk_is_no_head(
    half: tuple[float, float], name: str, order: tuple[int, int, int]
) -> None:
    """Ellipses of water and bone of the size of people, their slices along any axis of the array;
    where the axes are nobody's, sizes say nothing."""
    side = np.arange(-200.0, 200.0, 5.0)
    inside = (side / half[0]) ** 2 + (side[:, None] / half[1]) ** 2 < 1
    upright = np.tile(np.where(inside, 40, -1000).astype(np.int16), (30, 1, 1))
    upright[:, 38:42, 38:42] = 700
    affine = np.eye(4)
    for axis, before in enumerate(order):
        affine[:3, 2 - axis] = 5.0 * np.eye(3)[2 - before]
    array = upright.transpose(order)
    known = suggested(array, affine=affine, space="LPS", modality="CT")
    assert known.transfer.name == name
    assert suggested(array, affine=affine, modality="CT").transfer.name == "ct-head"


def blob(size: int = 32) -> NDArray[np.float64]:
    """0 outside and 1 inside a ball, with a blurred edge."""
    ends = np.linspace(-1, 1, size)
    radius = np.sqrt(ends[:, None, None] ** 2 + ends[:, None] ** 2 + ends**2)
    return 1 / (1 + np.exp((radius - 0.6) * 30))


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float32])
def test_a_body_in_an_empty_surround(rng: np.random.Generator, dtype: type) -> None:
    array = np.clip(150 * blob() + rng.normal(8, 4, (32, 32, 32)), 0, 255).astype(dtype)
    found = suggested(array, modality="MR")
    assert found.transfer.opacity_at(8) == 0
    assert found.transfer.opacity_at(150) > 0.4
    assert visible(found, Volume.from_array(array)) == pytest.approx(
        (blob() > 0.4).mean(), abs=0.05
    )


def test_sparse_signal_leaves_the_background_clear(rng: np.random.Generator) -> None:
    array = rng.normal(100, 12, (24, 60, 60))
    for z, y, x in rng.integers(4, 20, (25, 3)) * (1, 2.5, 2.5):
        array[int(z) : int(z) + 3, int(y) : int(y) + 4, int(x) : int(x) + 4] += 1500
    volume = Volume.from_array(np.clip(array, 0, None).astype(np.uint16))
    found = suggest(volume, statistics(volume))
    assert found.transfer.opacity_at(100) == 0
    assert found.transfer.opacity_at(1600) > 0.3
    assert visible(found, volume) < 0.05


def test_a_smooth_field_glows_inside() -> None:
    ends = np.linspace(-3, 3, 40)
    field = np.exp(-(ends[:, None, None] ** 2) - ends[:, None] ** 2 - ends**2).astype(np.float32)
    found = suggested(field)
    assert 0 < found.transfer.opacity_at(0.3) < found.transfer.opacity_at(0.9)


def test_no_background_is_an_opaque_block(rng: np.random.Generator) -> None:
    array = np.clip(rng.normal(130, 35, (16, 64, 64)), 0, 255).astype(np.uint8)
    found = suggested(array)
    assert found.shading == "none"
    assert visible(found, Volume.from_array(array), 0.9) == 1


def test_a_slice_is_a_picture_in_its_window(rng: np.random.Generator) -> None:
    array = rng.integers(-1000, 2000, (1, 40, 40)).astype(np.int16)
    found = suggested(array, window=(50, 350))
    assert found.transfer.domain == (-125, 225)
    assert found.shading == "none"


def test_density_about_zero(rng: np.random.Generator) -> None:
    array = rng.normal(0, 1, (24, 24, 24)).astype(np.float32)
    array[8:12, 8:12, 8:12] += 8
    found = suggested(array)
    assert found.modality == "density map"
    assert found.transfer.opacity_at(0) == 0
    assert found.transfer.opacity_at(8) > 0.5


def test_waves_show_both_signs_alike() -> None:
    """Seismic amplitudes, velocities: troughs are as much worth seeing as crests."""
    z, y, x = np.mgrid[0:48, 0:32, 0:32]
    wave = np.sin(z / 2.5 + 0.13 * x) * np.cos(0.07 * y)
    found = suggested((800 * wave).astype(np.int16))
    transfer = found.transfer
    assert transfer.opacity_at(0) == 0
    for value in (300, 500, 700):
        assert transfer.opacity_at(-value) == pytest.approx(transfer.opacity_at(value))
    assert transfer.opacity_at(700) > 0.4
    trough, crest = transfer.color_at([-700, 700])
    assert trough[2] > trough[0]  # blue
    assert crest[0] > crest[2]  # red


def test_labels_are_not_interpolated() -> None:
    blocks = np.kron(np.arange(8).reshape(2, 2, 2), np.ones((8, 8, 8))).astype(np.uint8)
    found = suggested(blocks)
    assert found.interpolation == "nearest"
    assert found.transfer.name == "labels"


@pytest.mark.parametrize("name", MEASURED + LABELS)
def test_real_volumes(data: Path, name: str) -> None:
    volume = opened(data / name)
    found = suggest(volume, statistics(volume))
    shown = visible(found, volume)
    assert shown > 0.002
    assert shown < 0.8 or found.shading == "none"
    assert found.interpolation == ("nearest" if name in LABELS else "linear")


def test_maximum_needs_a_ramp_over_everything(data: Path) -> None:
    volume = opened(data / "mri/ch2_colin27_t1.nii.gz")
    transfer = mip_transfer(volume, statistics(volume))
    bright = transfer.color_at([20, 100, 200])[:, 0]
    assert bright[0] < bright[1] < bright[2]
    assert transfer.opacity_at(100) == 1


@pytest.mark.parametrize("dtype", [np.uint8, np.int16, np.float32, np.float64])
@pytest.mark.parametrize("count", [1, 3])
def test_rare_voxels_are_what_is_shown(dtype: type, count: int) -> None:
    data = np.zeros((40, 48, 56), dtype)
    data[20 : 20 + count, 24 : 24 + count, 28] = 100
    found = suggested(data)
    assert found.transfer.opacity_at(0) == 0
    assert found.transfer.opacity_at(100) > 0.5


def test_numbers_at_the_ends_of_floats() -> None:
    ends = np.where(np.arange(4096).reshape(16, 16, 16) % 16 < 8, -1.7e308, 1.7e308)
    denormal = np.linspace(0, 1e-310, 4096).reshape(16, 16, 16)
    assert suggested(ends).transfer.domain[1] > 1e299
    assert suggested(denormal).transfer.opacity_at(0) > 0
