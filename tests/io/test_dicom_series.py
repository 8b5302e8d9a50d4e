"""DICOM series made by pydicom: grouping, order, gaps, duplicates, tilt, times, frames, privacy."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pydicom
import pytest
from pydicom.dataset import Dataset, FileDataset
from pydicom.uid import ImplicitVRLittleEndian, generate_uid

import tests.io.dicom_maker as maker
from volviz.errors import Cancelled, InputError, UnsupportedError, UsageError
from volviz.io import load, probe
from volviz.progress import Progress


def test_plain_series(tmp_path: Path) -> None:
    stored = maker.series(tmp_path)
    volume = load(tmp_path)
    np.testing.assert_array_equal(volume.data, stored.astype(int) - 1024)
    assert volume.data.dtype == np.int16
    np.testing.assert_allclose(volume.spacing, (0.75, 0.5, 2.5))
    np.testing.assert_allclose(volume.info.origin, (10, 20, 30))
    assert volume.info.warnings == ()


def test_names_and_numbers_do_not_order_the_slices(tmp_path: Path) -> None:
    names = ["10.dcm", "9", "zz.ima", "1.dcm", "02.dcm", "a b.dcm"]
    stored = maker.series(tmp_path, names=names)
    np.testing.assert_array_equal(load(tmp_path).data, stored.astype(int) - 1024)


def test_nested_one_level(tmp_path: Path) -> None:
    stored = maker.series(tmp_path / "DICOM")
    np.testing.assert_array_equal(load(tmp_path).data, stored.astype(int) - 1024)


def test_two_series_and_a_report(tmp_path: Path) -> None:
    maker.series(tmp_path, 4)

    def second(ds: FileDataset, k: int) -> None:
        ds.SeriesNumber, ds.SeriesDescription = 9, "../../x\x1b[31m"

    stored = maker.series(tmp_path, 3, change=second, names=["x1", "x2", "x3"], uid=generate_uid())
    report = maker.image(stored[0], uid=generate_uid(), sop="1.2.840.10008.5.1.4.1.1.88.11")
    for keyword in ("PixelData", "Rows", "Columns"):
        del report[keyword]
    maker.save(report, tmp_path / "report.dcm")
    with pytest.raises(UsageError) as caught:
        load(tmp_path)
    message = str(caught.value)
    assert "2 series" in message
    assert "1: CT 'made for a test', 4 images of 7 × 5" in message
    assert "2: CT '../../x" in message
    assert "\x1b" not in message
    assert "CANARY" not in message
    volume = load(tmp_path, series="2")
    assert volume.dims == (7, 5, 3)
    assert any("1 × Basic Text SR Storage" in w for w in volume.info.warnings)
    with pytest.raises(UsageError, match="no series matches 'liver'"):
        load(tmp_path, series="liver")
    with pytest.raises(UnsupportedError, match="Basic Text SR Storage"):
        load(tmp_path / "report.dcm")


def test_localiser_of_another_direction_is_split_out(tmp_path: Path) -> None:
    uid = generate_uid()

    def turn(ds: FileDataset, k: int) -> None:
        ds.ImageOrientationPatient = [1, 0, 0, 0, 0, -1]

    stored = maker.series(tmp_path, 5, uid=uid)
    maker.series(tmp_path, 1, uid=uid, change=turn, names=["localiser.dcm"])
    volume = load(tmp_path)
    np.testing.assert_array_equal(volume.data, stored.astype(int) - 1024)
    assert any("one other series" in w for w in volume.info.warnings)


def test_missing_slice_is_left_empty(tmp_path: Path) -> None:
    stored = maker.series(tmp_path, 8)
    (tmp_path / "slice004.dcm").unlink()
    volume = load(tmp_path)
    assert volume.dims[2] == 8
    keep = [0, 1, 2, 3, 5, 6, 7]
    np.testing.assert_array_equal(volume.data[keep], stored[keep].astype(int) - 1024)
    assert volume.info.padding == -32768
    assert (volume.data[4] == -32768).all()
    assert any("slice 5 at z = 40.00 mm" in w for w in volume.info.warnings)


def test_missing_slice_of_floats_is_nan(tmp_path: Path) -> None:
    def change(ds: FileDataset, k: int) -> None:
        ds.RescaleSlope = 0.25

    maker.series(tmp_path, 6, change=change)
    (tmp_path / "slice002.dcm").unlink()
    volume = load(tmp_path)
    assert volume.data.dtype == np.float32
    assert np.isnan(volume.data[2]).all()
    assert np.isfinite(volume.data[[0, 1, 3, 4, 5]]).all()


def test_missing_slice_needs_a_value_that_no_voxel_has(tmp_path: Path) -> None:
    def change(ds: FileDataset, k: int) -> None:
        ds.RescaleIntercept = 0

    data = maker.voxels(6)
    data[0, 0, 0], data[0, 0, 1] = 0, 65535
    maker.series(tmp_path, 6, change=change, data=data)
    (tmp_path / "slice002.dcm").unlink()
    volume = load(tmp_path)
    assert volume.data[0, 0, 1] == 65535
    assert volume.info.padding is not None
    assert not np.isin(volume.info.padding, data)
    assert (volume.data[2] == volume.info.padding).all()


def test_uneven_slices_are_told(tmp_path: Path) -> None:
    def change(ds: FileDataset, k: int) -> None:
        ds.ImagePositionPatient = [0, 0, k * 2.0 + (0.7 if k > 3 else 0)]

    maker.series(tmp_path, 7, change=change)
    volume = load(tmp_path)
    assert volume.dims[2] == 7
    assert any("not evenly spaced" in w and "slice 4 and 5" in w for w in volume.info.warnings)


def test_duplicates_are_told_and_the_first_is_kept(tmp_path: Path) -> None:
    stored = maker.series(tmp_path, 6)
    ds = pydicom.dcmread(tmp_path / "slice003.dcm")
    (tmp_path / "copy.dcm").write_bytes((tmp_path / "slice002.dcm").read_bytes())
    ds.SOPInstanceUID = ds.file_meta.MediaStorageSOPInstanceUID = generate_uid()
    ds.InstanceNumber = 77
    ds.PixelData = b"\0" * len(ds.PixelData)
    maker.save(ds, tmp_path / "again.dcm")
    volume = load(tmp_path)
    np.testing.assert_array_equal(volume.data, stored.astype(int) - 1024)
    text = " ".join(volume.info.warnings)
    assert "1 duplicate file of the same image" in text
    assert "1 duplicate slice" in text
    assert "37.50 mm" in text


@pytest.mark.parametrize("tag", ["EchoTime", "TemporalPositionIdentifier", "DiffusionBValue", None])
def test_images_at_one_place_are_times(tmp_path: Path, tag: str | None) -> None:
    uid = generate_uid()
    for t in range(3):

        def change(ds: FileDataset, k: int, t: int = t) -> None:
            ds.InstanceNumber = 100 * t + k
            if tag:
                setattr(ds, tag, 10 * (2 - t) + 5)

        data = maker.voxels(4) + np.uint16(t)
        maker.series(
            tmp_path, 4, uid=uid, change=change, names=[f"{t}{k}" for k in range(4)], data=data
        )
    assert probe(tmp_path).times == 3
    for t in range(3):
        made = 2 - t if tag else t
        volume = load(tmp_path, time=t)
        np.testing.assert_array_equal(volume.data, maker.voxels(4).astype(int) + made - 1024)
    assert any((tag or "InstanceNumber") in w for w in volume.info.warnings)
    with pytest.raises(UsageError, match="no time 3"):
        load(tmp_path, time=3)


def test_made_tilt(tmp_path: Path) -> None:
    maker.series(tmp_path, 5, step=(0.0, 1.0, 2.0))
    volume = load(tmp_path)
    np.testing.assert_allclose(volume.affine[:3, 2], (0, 1, 2))
    assert any("26.6°" in w for w in volume.info.warnings)


def test_slices_run_along_the_normal(tmp_path: Path) -> None:
    """Feet to head or head to feet: index z always grows along row × column."""
    maker.series(tmp_path, 5, step=(0.0, 0.0, -2.0))
    volume = load(tmp_path)
    np.testing.assert_allclose(volume.affine[:3, 2], (0, 0, 2))
    assert volume.info.origin[2] == pytest.approx(30 - 8)
    np.testing.assert_array_equal(volume.data, maker.voxels(5)[::-1].astype(int) - 1024)


def test_enhanced_multi_frame(tmp_path: Path) -> None:
    ds, stored = maker.enhanced(5)
    volume = load(maker.save(ds, tmp_path / "enhanced.dcm"))
    # row × column = (0, 1, 0) × (0, 0, -1) = (-1, 0, 0): z grows to -x, as the positions do
    np.testing.assert_array_equal(volume.data, stored.astype(int) * 2 - 1000)
    expected = np.array([[0, 0, -3, -50], [0.6, 0, 0, 5], [0, -0.4, 0, 70], [0, 0, 0, 1]])
    np.testing.assert_allclose(volume.affine, expected)
    assert volume.info.value_unit == "HU"


def test_old_multi_frame_is_spread_along_the_normal(tmp_path: Path) -> None:
    data = maker.voxels(4)
    ds = maker.image(data[0], uid=generate_uid(), position=(1, 2, 3))
    maker.put_pixels(ds, data)
    ds.NumberOfFrames, ds.SpacingBetweenSlices = 4, 2
    volume = load(maker.save(ds, tmp_path / "nm.dcm"))
    np.testing.assert_allclose(volume.affine[:3, 2], (0, 0, 2))
    np.testing.assert_array_equal(volume.data, data.astype(int) - 1024)


def test_film_frames_are_times(tmp_path: Path) -> None:
    data = maker.voxels(4)
    ds = maker.image(data[0], uid=generate_uid())
    maker.put_pixels(ds, data)
    ds.NumberOfFrames, ds.FrameTime = 4, 40
    ds.FrameIncrementPointer = 0x00181063
    path = maker.save(ds, tmp_path / "film.dcm")
    volume = load(path, time=2)
    assert (volume.info.times, volume.dims[2]) == (4, 1)
    np.testing.assert_array_equal(volume.data[0], data[2].astype(int) - 1024)


def test_without_preamble(tmp_path: Path) -> None:
    data = maker.voxels(1)
    ds = maker.image(data[0], uid=generate_uid(), syntax=ImplicitVRLittleEndian)
    body = maker.save(ds, tmp_path / "whole.dcm").read_bytes()
    start = body.index(b"\x08\0\x16\0")
    bare = tmp_path / "bare.dcm"
    bare.write_bytes(body[start:])
    np.testing.assert_array_equal(load(bare).data, data.astype(int) - 1024)


def test_no_name_of_a_person_outside_the_fields(tmp_path: Path) -> None:
    def change(ds: FileDataset, k: int) -> None:
        ds.SeriesDescription = ""

    maker.series(tmp_path / "exam", 4, change=change)
    (tmp_path / "exam" / "slice002.dcm").unlink()
    info = load(tmp_path / "exam").info
    assert "CANARY" in info.fields["PatientName"]
    assert info.name == "exam"
    assert "CANARY" not in " ".join([info.name, info.format, info.encoding, *info.warnings])


def test_fields_hold_no_control_characters(tmp_path: Path) -> None:
    def change(ds: FileDataset, k: int) -> None:
        ds.SpecificCharacterSet = "ISO_IR 192"
        ds.PatientName = "X\x1b]0;owned\x07^\u202eabc"

    maker.series(tmp_path, 2, change=change)
    text = load(tmp_path).info.fields["PatientName"]
    assert not any(c in text for c in "\x1b\x07\u202e")


def test_no_geometry_is_said(tmp_path: Path) -> None:
    def change(ds: FileDataset, k: int) -> None:
        for keyword in ("ImagePositionPatient", "ImageOrientationPatient", "PixelSpacing"):
            del ds[keyword]
        ds.InstanceNumber = k
        del ds.SliceThickness

    stored = maker.series(tmp_path, 3, change=change, names=["c", "b", "a"])
    volume = load(tmp_path)
    assert (volume.info.space, volume.info.length_unit, volume.spacing) == (None, None, (1, 1, 1))
    np.testing.assert_array_equal(volume.data, stored.astype(int) - 1024)
    assert any("orientation and position are unknown" in w for w in volume.info.warnings)


@pytest.mark.parametrize(
    ("keyword", "value"),
    [
        ("ImageOrientationPatient", [0, 0, 0, 0, 0, 0]),
        ("ImageOrientationPatient", [1, 0, 0, 1, 0, 0]),
        ("PixelSpacing", [0, 0]),
        ("PixelSpacing", [-1, 1]),
    ],
)
def test_broken_geometry_never_gives_a_singular_affine(tmp_path: Path, keyword: str, value) -> None:
    maker.series(tmp_path, 3, change=lambda ds, k: setattr(ds, keyword, value))
    volume = load(tmp_path)
    assert abs(np.linalg.det(volume.affine)) > 1e-6
    assert volume.info.warnings


def test_spacing_from_the_user(tmp_path: Path) -> None:
    maker.series(tmp_path, 3)
    np.testing.assert_allclose(load(tmp_path, spacing=(1, 2, 3)).spacing, (1, 2, 3))


def test_links_to_regular_files_are_followed(tmp_path: Path) -> None:
    stored = maker.series(tmp_path / "store", 4)
    view = tmp_path / "view"
    view.mkdir()
    for path in (tmp_path / "store").iterdir():
        (view / path.name).symlink_to(path)
    (view / "dangling.dcm").symlink_to(tmp_path / "nothing")
    (view / "zero.dcm").symlink_to("/dev/zero")
    os.mkfifo(view / "pipe.dcm")
    np.testing.assert_array_equal(load(view).data, stored.astype(int) - 1024)


def test_cancel_between_files(tmp_path: Path) -> None:
    maker.series(tmp_path, 8)
    seen: list[str] = []

    def report(fraction: float | None, message: str) -> None:
        seen.append(message)
        if message.startswith("reading slice 3"):
            progress.cancel()

    progress = Progress(report)
    with pytest.raises(Cancelled):
        load(tmp_path, progress=progress)
    assert seen[-1].startswith("reading slice 3")


def test_damaged_file_in_a_folder_is_named(tmp_path: Path) -> None:
    stored = maker.series(tmp_path, 5)
    whole = (tmp_path / "slice002.dcm").read_bytes()
    (tmp_path / "slice002.dcm").write_bytes(whole[:-20])
    with pytest.raises(InputError, match=r"slice002\.dcm: PixelData: the pixels are cut off"):
        load(tmp_path)
    (tmp_path / "slice002.dcm").write_bytes(whole[:200])
    volume = load(tmp_path)
    np.testing.assert_array_equal(
        volume.data[[0, 1, 3, 4]], stored[[0, 1, 3, 4]].astype(int) - 1024
    )
    assert any("1 missing" in w or "missing (slice 3" in w for w in volume.info.warnings)


def nested(depth: int) -> bytes:
    """Implicit little-endian sequences of undefined length, one in the other."""
    item = b"\x08\x00\x40\x11" + b"\xff" * 4 + b"\xfe\xff\x00\xe0" + b"\xff" * 4
    return item * depth


def test_three_thousand_nested_sequences(tmp_path: Path) -> None:
    path = tmp_path / "deep.dcm"
    ds = maker.image(maker.voxels(1)[0], uid=generate_uid(), syntax=ImplicitVRLittleEndian)
    body = maker.save(ds, path).read_bytes()
    at = body.index(b"\x08\0\x16\0")
    path.write_bytes(body[:at] + nested(3000))
    limit = sys.getrecursionlimit()
    with pytest.raises(InputError, match="nested too deeply"):
        load(path)
    assert sys.getrecursionlimit() == limit


def test_sequence_items_are_counted_in_fields(tmp_path: Path) -> None:
    def change(ds: FileDataset, k: int) -> None:
        ds.ReferencedImageSequence = [Dataset(), Dataset()]

    maker.series(tmp_path, 2, change=change)
    assert load(tmp_path).info.fields["ReferencedImageSequence"] == "2 items"


def test_folders_as_deep_as_on_a_disc(tmp_path: Path) -> None:
    stored = maker.series(tmp_path / "DICOM" / "ST0" / "SE0", 4)
    np.testing.assert_array_equal(load(tmp_path).data, stored.astype(int) - 1024)


def test_enhanced_times(tmp_path: Path) -> None:
    """Two times at each of three places, told apart by TemporalPositionIndex."""
    ds, data = maker.enhanced(6, shuffle=False)
    for k, group in enumerate(ds.PerFrameFunctionalGroupsSequence):
        content = Dataset()
        content.TemporalPositionIndex = 1 + k % 2
        group.FrameContentSequence = [content]
        group.PlanePositionSequence[0].ImagePositionPatient = [-50.0 - 3.0 * (k // 2), 5, 70]
    path = maker.save(ds, tmp_path / "4d.dcm")
    for t in (0, 1):
        volume = load(path, time=t)
        assert volume.info.times == 2
        np.testing.assert_array_equal(volume.data, data[t::2].astype(int) * 2 - 1000)
