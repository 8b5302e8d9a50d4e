from __future__ import annotations

import errno
import gzip
import os
from pathlib import Path

import nibabel as nib
import nrrd as pynrrd
import numpy as np
import pytest
import SimpleITK as sitk

from tests.io.oracle import RAS_TO_LPS, places, same_as_nibabel, same_as_simpleitk
from volviz.errors import Cancelled, OutputError, UsageError
from volviz.io import load
from volviz.io.write import save_volume
from volviz.model.volume import Volume
from volviz.progress import Progress

TYPES = ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"]
TURN = np.array(sitk.Euler3DTransform((0, 0, 0), 0.3, -0.5, 1.1).GetMatrix()).reshape(3, 3)
SHEAR = np.array([[1, 0.1, 0], [0, 1.1, 0.2], [0, 0, 0.9]])
NAMES = ["a.nrrd", "a.nii", "a.nii.gz"]


def volume(dtype: str = "i2", direction: np.ndarray = TURN, **info: object) -> Volume:
    array = np.random.default_rng(3).integers(0, 120, (4, 5, 6)).astype(dtype)
    info.setdefault("space", "LPS")
    return Volume.from_array(
        array, (0.7, 1.3, 2.1), (10.1, -20.3, 30.7), direction=direction, **info
    )


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("direction", [TURN, SHEAR, np.diag([-1.0, 1, -1])])
def test_round_trip(tmp_path: Path, name: str, dtype: str, direction: np.ndarray) -> None:
    before = volume(dtype, direction)
    save_volume(before, tmp_path / name)
    after = load(tmp_path / name)
    np.testing.assert_array_equal(after.data, before.data)
    assert after.data.dtype == before.data.dtype
    assert (after.info.space, after.info.length_unit) == ("LPS", "mm")
    if name.endswith("nrrd"):
        np.testing.assert_array_equal(after.affine, before.affine)
    else:
        np.testing.assert_allclose(after.affine, before.affine, rtol=3e-7, atol=1e-7)
    assert after.info.warnings == ()


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("dtype", TYPES)
def test_others_read_the_same(tmp_path: Path, name: str, dtype: str) -> None:
    before = volume(dtype)
    save_volume(before, tmp_path / name)
    same_as_simpleitk(before, tmp_path / name)
    if name.endswith("nrrd"):
        np.testing.assert_array_equal(
            pynrrd.read(str(tmp_path / name), index_order="C")[0], before.data
        )
        return
    same_as_nibabel(before, tmp_path / name)
    header = nib.load(tmp_path / name).header
    assert (int(header["sform_code"]), int(header["qform_code"])) == (1, 1)
    np.testing.assert_allclose(header.get_qform(), RAS_TO_LPS @ before.affine, atol=1e-5)


def test_a_sheared_grid_has_no_qform(tmp_path: Path) -> None:
    before = volume(direction=SHEAR)
    save_volume(before, tmp_path / "a.nii")
    assert int(nib.load(tmp_path / "a.nii").header["qform_code"]) == 0
    same_as_nibabel(before, tmp_path / "a.nii")


@pytest.mark.parametrize("name", NAMES)
def test_unknown_space_stays_unknown(tmp_path: Path, name: str) -> None:
    before = Volume.from_array(np.zeros((2, 3, 4), "f4"), (0.5, 1, 2))
    save_volume(before, tmp_path / name)
    after = load(tmp_path / name)
    assert after.info.space is None
    np.testing.assert_array_equal(after.affine, before.affine)


def test_nifti_refuses_what_it_cannot_hold(tmp_path: Path) -> None:
    before = volume(space=None)
    save_volume(before, tmp_path / "a.nrrd")
    np.testing.assert_array_equal(load(tmp_path / "a.nrrd").affine, before.affine)
    with pytest.raises(OutputError, match=r"save it as \.nrrd"):
        save_volume(before, tmp_path / "a.nii")
    assert not (tmp_path / "a.nii").exists()


def test_nrrd_keeps_the_meaning(tmp_path: Path) -> None:
    before = volume(modality="CT", value_unit="HU", padding=-2000.0, window=(40.0, 400.5))
    save_volume(before, tmp_path / "a.nrrd")
    info = load(tmp_path / "a.nrrd").info
    assert (info.modality, info.value_unit, info.padding, info.window) == (
        "CT",
        "HU",
        -2000,
        (40, 400.5),
    )
    save_volume(volume("u1", kind="labels"), tmp_path / "b.nrrd")
    assert load(tmp_path / "b.nrrd").info.kind == "labels"


def test_nifti_keeps_labels_and_window(tmp_path: Path) -> None:
    save_volume(volume("u1", kind="labels", window=(50.0, 20.0)), tmp_path / "a.nii.gz")
    info = load(tmp_path / "a.nii.gz").info
    assert (info.kind, info.window) == ("labels", (50, 20))


def test_a_name_cannot_add_lines_to_a_header(tmp_path: Path) -> None:
    save_volume(volume(value_unit="x\nsizes: 1 1 1\n"), tmp_path / "a.nrrd")
    assert load(tmp_path / "a.nrrd").dims == (6, 5, 4)


def test_long_grids_become_nifti_2(tmp_path: Path) -> None:
    before = Volume.from_array(np.arange(40_000, dtype="u2").reshape(1, 1, -1))
    save_volume(before, tmp_path / "a.nii")
    after = load(tmp_path / "a.nii")
    assert after.info.format == "NIfTI-2"
    np.testing.assert_array_equal(after.data, before.data)


def test_compress_or_not_and_the_same_bytes_twice(tmp_path: Path) -> None:
    before = Volume.from_array(np.zeros((20, 20, 20), "u1"))
    save_volume(before, tmp_path / "a.nrrd")
    save_volume(before, tmp_path / "b.nrrd")
    save_volume(before, tmp_path / "raw.nrrd", compress=False)
    assert (tmp_path / "a.nrrd").read_bytes() == (tmp_path / "b.nrrd").read_bytes()
    assert (tmp_path / "a.nrrd").stat().st_size < 500
    assert (tmp_path / "raw.nrrd").stat().st_size > 8000
    assert load(tmp_path / "raw.nrrd").info.encoding == "raw"
    save_volume(before, tmp_path / "a.nii.gz")
    assert len(gzip.decompress((tmp_path / "a.nii.gz").read_bytes())) == 8352


def test_real_volumes_round_trip(data: Path, tmp_path: Path) -> None:
    for name in ("mri/stroke_FLAIR_oblique.nrrd", "mri/prostate_phantom.nrrd"):
        before = load(data / name)
        for out in NAMES:
            save_volume(before, tmp_path / out, overwrite=True)
            after = load(tmp_path / out)
            np.testing.assert_array_equal(after.data, before.data)
            np.testing.assert_allclose(places(after), places(before), atol=1e-4)


@pytest.mark.parametrize("name", NAMES)
def test_nothing_is_overwritten_unasked(tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    path.write_bytes(b"precious")
    with pytest.raises(OutputError, match="exists"):
        save_volume(volume(), path)
    assert path.read_bytes() == b"precious"
    save_volume(volume(), path, overwrite=True)
    assert load(path).dims == (6, 5, 4)


def test_cancel_leaves_what_was_there_and_no_rest(tmp_path: Path) -> None:
    path = tmp_path / "a.nrrd"
    path.write_bytes(b"precious")
    progress = Progress()
    progress.cancel()
    with pytest.raises(Cancelled):
        save_volume(volume(), path, overwrite=True, progress=progress)
    assert path.read_bytes() == b"precious"
    assert os.listdir(tmp_path) == ["a.nrrd"]


@pytest.mark.parametrize("place", ["none/a.nrrd", "folder.nrrd"])
def test_places_that_cannot_be_written(tmp_path: Path, place: str) -> None:
    (tmp_path / "folder.nrrd").mkdir()
    with pytest.raises(OutputError) as caught:
        save_volume(volume(), tmp_path / place, overwrite=True)
    assert caught.value.fix
    assert os.listdir(tmp_path) == ["folder.nrrd"]


def test_a_failing_disk_leaves_what_was_there(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.nrrd"
    path.write_bytes(b"precious")

    def full(handle: int) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OutputError, match="No space left"):
        save_volume(volume(), path, overwrite=True)
    assert path.read_bytes() == b"precious"
    assert os.listdir(tmp_path) == ["a.nrrd"]


def test_other_suffixes_are_refused(tmp_path: Path) -> None:
    for name in ("a.mha", "a", "a.nrrd.txt"):
        with pytest.raises(UsageError, match=r"\.nrrd, \.nii or \.nii\.gz"):
            save_volume(volume(), tmp_path / name)


def test_the_usual_permissions(tmp_path: Path) -> None:
    mask = os.umask(0o027)
    try:
        save_volume(volume(), tmp_path / "a.nrrd")
    finally:
        os.umask(mask)
    assert (tmp_path / "a.nrrd").stat().st_mode & 0o777 == 0o640
