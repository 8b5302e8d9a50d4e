"""The Hounsfield table, and telling CT from other things."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.classify.test_labels import opened
from volviz.classify.hounsfield import HOUNSFIELD, hounsfield_offset
from volviz.fields.statistics import statistics
from volviz.model.volume import Volume

# the survey's figures
SURVEY = {
    "air": -1000, "fat": (-75, -55), "water": 0, "tissue": (20, 60), "blood": (70, 90),
    "muscle": (50, 90), "spongy bone": (50, 150), "compact bone": (700, 1900),
    "enamel": (2300, 3100), "metal": 4000,
}  # fmt: skip


def test_table_is_the_surveys() -> None:
    assert {m.name for m in HOUNSFIELD} == set(SURVEY)
    for material in HOUNSFIELD:
        told = SURVEY[material.name]
        if isinstance(told, tuple):
            assert (material.low, material.high) == told
        else:
            assert material.low <= told <= material.high
    assert [m.middle for m in HOUNSFIELD] == sorted(m.middle for m in HOUNSFIELD)


def body(rng: np.random.Generator, offset: float = 0) -> NDArray[np.int16]:
    """Air around, fat, muscle and some bone, with noise."""
    parts = [(-1000, 40000), (-90, 9000), (50, 12000), (300, 1500), (1100, 1000)]
    values = np.concatenate([rng.normal(m, 18, n) for m, n in parts])
    return (values + offset).astype(np.int16)[: 39 * 40 * 40].reshape(39, 40, 40)


def test_found_by_histogram(rng: np.random.Generator) -> None:
    for array in (body(rng), body(rng).astype(np.int32), body(rng).astype(np.float32)):
        volume = Volume.from_array(array)
        assert hounsfield_offset(volume, statistics(volume)) == 0


@pytest.mark.parametrize("offset", [1000, 1024])
def test_raw_scanner_numbers(rng: np.random.Generator, offset: int) -> None:
    array = np.clip(body(rng, offset), 0, 4095).astype(np.uint16)
    for modality in ("CT", None):
        volume = Volume.from_array(array, modality=modality)
        assert hounsfield_offset(volume, statistics(volume)) == offset


def test_what_the_file_says(rng: np.random.Generator) -> None:
    told = Volume.from_array(body(rng), value_unit="HU", modality="CT")
    assert hounsfield_offset(told, statistics(told)) == 0
    other = Volume.from_array(body(rng), modality="MR")
    assert hounsfield_offset(other, statistics(other)) is None


def test_not_ct(rng: np.random.Generator) -> None:
    arrays = [
        rng.integers(0, 4096, (20, 20, 20)).astype(np.uint16),
        np.abs(rng.normal(0, 900, (20, 20, 20))).astype(np.uint16),
        rng.normal(0, 300, (20, 20, 20)).astype(np.int16),
        rng.integers(0, 256, (20, 20, 20)).astype(np.uint8),
        np.zeros((4, 4, 4), np.int16),
        np.full((4, 4, 4), np.nan, np.float32),
    ]
    for array in arrays:
        volume = Volume.from_array(array)
        assert hounsfield_offset(volume, statistics(volume)) is None


@pytest.mark.parametrize(
    ("name", "offset"),
    [
        ("ct/cranium_head_ct.nrrd", 0),
        ("ct/totalseg_torso_ct.nii.gz", 0),
        ("ct/totalseg_torso_sm_ct.nii.gz", 0),
        ("ct/ct_pitch_oblique.nii.gz", None),
        ("mri/ch2_colin27_t1.nii.gz", None),
        ("mri/prostate_phantom.nrrd", None),
        ("mri/example4d.nii.gz", None),
        ("formats/tooth_bigendian_uint16.nhdr", None),
        ("microscopy/snow.tif", None),
        ("classics/stent.npz", None),
    ],
)
def test_real_volumes(data: Path, name: str, offset: float | None) -> None:
    volume = opened(data / name)
    assert hounsfield_offset(volume, statistics(volume)) == offset
