"""Labels are told from measurements, and every label gets its own colour."""

from __future__ import annotations

from pathlib import Path

import nibabel as nib
import numpy as np
import pytest
import SimpleITK as sitk
from numpy.typing import NDArray

from volviz.classify.labels import label_color, label_transfer, looks_like_labels
from volviz.fields.statistics import statistics
from volviz.model.transfer import srgb_to_linear
from volviz.model.volume import Volume

LABELS = [
    "formats/frogtissue.mhd",
    "mri/ch2_aal_labels.nii.gz",
    "ct/totalseg_torso_sm_labels117.nii.gz",
    "ct/totalseg_torso_vertebrae_labels.nii.gz",
    "ct/cranium_head_labels.nrrd",
    "mri/prostate_phantom_labels.nrrd",
    "microscopy/tgmm_mini_4d_labels.tif",
]
MEASURED = [
    "formats/nrrd/BallBinary30x30x30.nrrd",
    "formats/tooth_bigendian_uint16.nhdr",
    "formats/anatomical_bigendian.nii",
    "formats/example_nifti2.nii.gz",
    "formats/nifti_dtypes/uint8.nii",
    "formats/nifti_dtypes/int64.nii",
    "ct/ct_pitch_oblique.nii.gz",
    "ct/totalseg_torso_sm_ct.nii.gz",
    "ct/totalseg_torso_ct.nii.gz",
    "ct/cranium_head_ct.nrrd",
    "mri/ch2_colin27_t1.nii.gz",
    "mri/stroke_T1_oblique.nii.gz",
    "mri/stroke_FLAIR_oblique.nii.gz",
    "mri/prostate_phantom.nrrd",
    "mri/example4d.nii.gz",
    "microscopy/snow.tif",
    "microscopy/droplet_4d.tif",
    "microscopy/ome_multichannel_z.ome.tif",
    "classics/bonsai_256.nii.gz",
    "simulation/nucleon.raw",
    "simulation/neghip_66x66x66_uint8.raw",
    "classics/stent.npz",
]


def opened(file: Path) -> Volume:
    """A volume through libraries that are not ours; the first time point and channel."""
    if file.suffix == ".raw":
        array: NDArray[np.generic] = np.fromfile(file, np.uint8)
        array = array.reshape([round(array.size ** (1 / 3))] * 3)
    elif file.suffix == ".npz":
        array = np.load(file)["arr_0"]
    elif file.suffix == ".tif":
        import tifffile

        array = tifffile.imread(file)
        array = array[0] if array.ndim == 4 else array
    elif ".nii" in file.name:
        array = np.asanyarray(nib.load(file).dataobj)
        array = (array[..., 0] if array.ndim == 4 else array).T
    else:
        array = sitk.GetArrayFromImage(sitk.ReadImage(str(file)))
    return Volume.from_array(array)


@pytest.mark.parametrize("name", LABELS)
def test_label_files(data: Path, name: str) -> None:
    volume = opened(data / name)
    assert looks_like_labels(volume, statistics(volume))


@pytest.mark.slow
def test_the_large_label_file(data: Path) -> None:
    volume = opened(data / "large/connectomics_512_labels.nrrd")
    assert looks_like_labels(volume, statistics(volume))


@pytest.mark.parametrize("name", MEASURED)
def test_measured_files(data: Path, name: str) -> None:
    volume = opened(data / name)
    assert not looks_like_labels(volume, statistics(volume))


def test_the_header_decides(rng: np.random.Generator) -> None:
    noise = rng.integers(0, 200, (6, 6, 6)).astype(np.uint8)
    said = Volume.from_array(noise, kind="labels")
    assert looks_like_labels(said, statistics(said))
    blocks = np.kron(np.arange(1, 9).reshape(2, 2, 2), np.ones((8, 8, 8))).astype(np.int16)
    found = Volume.from_array(blocks)
    assert looks_like_labels(found, statistics(found))
    ct = Volume.from_array(blocks, modality="CT")
    assert not looks_like_labels(ct, statistics(ct))


def table_color(volume: Volume, label: int) -> NDArray[np.float64]:
    """What nearest lookup in the table gives for a label, as the shader does it."""
    transfer = label_transfer(volume, statistics(volume))
    size = transfer.table_size(integers=True)
    low, high = transfer.domain
    index = round((label - low) / (high - low) * (size - 1))
    return transfer.table(size)[index].astype(np.float64)


@pytest.mark.parametrize(
    "labels", [[0, 1, 2], [0, 3, 4, 117], [5, 6], [7], list(range(2524)), [0, 1, 40_000, 65_535]]
)
def test_every_label_hits_its_color(labels: list[int]) -> None:
    array = np.array(labels, np.uint16).reshape(1, 1, -1)
    volume = Volume.from_array(array, kind="labels")
    transfer = label_transfer(volume, statistics(volume))
    assert transfer.table_size(integers=True) <= 65536
    for label in labels[:: max(1, len(labels) // 60)]:
        got = table_color(volume, label)
        np.testing.assert_allclose(got[:3], srgb_to_linear(label_color(label)), atol=1e-5)
        assert got[3] == (0 if label == 0 else 1)


def test_ids_beyond_the_table_still_work() -> None:
    array = np.array([0, 10**6, 10**9, 2**40], np.int64).reshape(1, 2, 2)
    volume = Volume.from_array(array, kind="labels")
    transfer = label_transfer(volume, statistics(volume))
    assert transfer.table_size(integers=True) <= 65536
    assert transfer.opacity_at(0) == 0
    assert transfer.opacity_at(2**40) == 1


def test_colors_are_distinct_and_visible() -> None:
    colors = np.array([label_color(i) for i in range(1, 40)])
    assert ((colors >= 0) & (colors <= 1)).all()
    gaps = np.abs(colors[:, None] - colors[None]).max(axis=-1) + np.eye(len(colors))
    assert gaps.min() > 0.02
    neighbours = np.abs(np.diff(colors, axis=0)).max(axis=1)
    assert neighbours.min() > 0.2
    assert colors.max(axis=1).min() > 0.5
    assert label_color(17) == label_color(17)
