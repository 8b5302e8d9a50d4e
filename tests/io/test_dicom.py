"""DICOM against pydicom and SimpleITK on real files, and against known truth on made ones."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import numpy as np
import pydicom
import pytest
import SimpleITK as sitk
from pydicom.dataset import Dataset, FileDataset
from pydicom.uid import ExplicitVRBigEndian, ImplicitVRLittleEndian, generate_uid

import tests.io.dicom_maker as maker
from volviz.errors import Cancelled, InputError, LimitError, UnsupportedError, UsageError
from volviz.io import Limits, ReadOptions, dicom, load, probe
from volviz.progress import Progress

SERIES = [
    "ct_head_phantom_5mm_j2k",
    "ct_head_gantry_tilt_jls",
    "ct_headsq_plain",
    "tiny_j2k",
    "tiny_rle",
    "tiny_nonsquare_pixels",
]
SINGLES = [
    "single_syntaxes/jpeg_lossless_sel1.dcm",
    "single_syntaxes/rle.dcm",
    "single_syntaxes/jpeg_2000.dcm",
    "single_syntaxes/jpeg_ls.dcm",
    "single_syntaxes/explicit_big.dcm",
    "single_syntaxes/implicit_little.dcm",
    "single_syntaxes/deflated.dcm",
]


def corners(volume) -> np.ndarray:
    x, y, z = (n - 1 for n in volume.dims)
    index = np.array([[i, j, k, 1] for i in (0, x) for j in (0, y) for k in (0, z)])
    return (volume.affine @ index.T).T[:, :3]


def itk_corners(img) -> np.ndarray:
    x, y, z = (n - 1 for n in img.GetSize())
    return np.array(
        [
            img.TransformIndexToPhysicalPoint((i, j, k))
            for i in (0, x)
            for j in (0, y)
            for k in (0, z)
        ]
    )


# ------------------------------------------------------------------ real files


@pytest.mark.parametrize("name", SERIES)
def test_series_equals_simpleitk(data: Path, name: str) -> None:
    folder = data / "dicom" / name
    volume = load(folder)
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames(reader.GetGDCMSeriesFileNames(str(folder)))
    img = reader.Execute()
    expected = sitk.GetArrayFromImage(img)
    np.testing.assert_allclose(volume.data, expected, rtol=1e-6, atol=0)
    if "tilt" not in name:  # SimpleITK has no shear
        np.testing.assert_allclose(corners(volume), itk_corners(img), atol=1e-3)
    assert volume.info.space == "LPS"


@pytest.mark.parametrize("name", SERIES)
def test_every_slice_lies_where_its_header_says(data: Path, name: str) -> None:
    files = [pydicom.dcmread(p) for p in (data / "dicom" / name).iterdir()]
    slices = [ds for ds in files if "PixelData" in ds]
    io = np.array(slices[0].ImageOrientationPatient, float)
    normal = np.cross(io[:3], io[3:])
    slices.sort(key=lambda ds: float(np.dot(np.array(ds.ImagePositionPatient, float), normal)))
    volume = load(data / "dicom" / name)
    assert volume.dims == (slices[0].Columns, slices[0].Rows, len(slices))
    row_step, column_step = (float(v) for v in slices[0].PixelSpacing)
    for k, ds in enumerate(slices):
        stored = ds.pixel_array.astype(float)
        values = stored * float(ds.get("RescaleSlope", 1)) + float(ds.get("RescaleIntercept", 0))
        np.testing.assert_allclose(volume.data[k], values, rtol=1e-6)
        for x, y in ((0, 0), (5, 3)):
            truth = (
                np.array(ds.ImagePositionPatient, float)
                + x * column_step * io[:3]
                + y * row_step * io[3:]
            )
            np.testing.assert_allclose((volume.affine @ [x, y, k, 1])[:3], truth, atol=2e-2)


@pytest.mark.parametrize("name", SINGLES)
def test_single_file_equals_simpleitk(data: Path, name: str) -> None:
    path = data / "dicom" / name
    volume = load(path)
    img = sitk.ReadImage(str(path))
    expected = sitk.GetArrayFromImage(img).reshape(volume.data.shape)
    np.testing.assert_allclose(volume.data, expected, rtol=1e-6)
    if volume.info.space:
        np.testing.assert_allclose(corners(volume), itk_corners(img), atol=1e-3)


@pytest.mark.parametrize("name", [n for n in SINGLES if "lossless_sel1" not in n])
def test_single_file_equals_pydicom(data: Path, name: str) -> None:
    ds = pydicom.dcmread(data / "dicom" / name)
    values = ds.pixel_array * float(ds.get("RescaleSlope", 1)) + float(
        ds.get("RescaleIntercept", 0)
    )
    np.testing.assert_allclose(load(data / "dicom" / name).data[0], values, rtol=1e-6)


def test_multi_frame_file(data: Path) -> None:
    path = data / "dicom" / "tiny_multiframe_mr" / "001.dcm"
    volume, ds = load(path), pydicom.dcmread(path)
    np.testing.assert_array_equal(volume.data, ds.pixel_array)
    np.testing.assert_allclose(volume.spacing, (1.59, 1.61, 5.0))
    np.testing.assert_allclose(volume.info.origin, (0, 0, -175))


def test_gantry_tilt_is_a_shear(data: Path) -> None:
    volume = load(data / "dicom" / "ct_head_gantry_tilt_jls")
    x, y, z = volume.affine[:3, :3].T
    normal = np.cross(x, y) / np.linalg.norm(np.cross(x, y))
    angle = np.degrees(np.arccos(z @ normal / np.linalg.norm(z)))
    assert angle == pytest.approx(18.5, abs=0.1)
    assert any("18.5°" in w and "tilt" in w for w in volume.info.warnings)


@pytest.mark.parametrize("name", [*SERIES, "tiny_multiframe_mr", *SINGLES])
def test_probe_says_what_load_gives(data: Path, name: str) -> None:
    info, volume = probe(data / "dicom" / name), load(data / "dicom" / name)
    assert (info.dims, info.dtype, info.padding) == (
        volume.info.dims,
        volume.info.dtype,
        volume.info.padding,
    )
    np.testing.assert_array_equal(info.affine, volume.affine)
    assert info.warnings == volume.info.warnings


def test_modality_unit_window_and_names(data: Path) -> None:
    info = probe(data / "dicom" / "ct_head_phantom_5mm_j2k")
    assert (info.modality, info.value_unit, info.window) == ("CT", "HU", (40.0, 80.0))
    assert info.name == "STD BRAIN 5MM"
    assert "JPEG 2000" in info.encoding
    assert probe(data / "dicom" / "ct_headsq_plain").value_unit is None  # RescaleType US
    assert probe(data / "dicom" / "tiny_j2k").value_unit is None


def test_one_file_of_a_series_says_so(data: Path) -> None:
    info = probe(data / "dicom" / "ct_headsq_plain" / "CTHead3.dcm")
    assert info.dims[2] == 1
    assert any("one of 93 images" in w for w in info.warnings)


def test_folder_of_many_single_images_lists_them(data: Path) -> None:
    with pytest.raises(UsageError, match=r"7 series: 1: CT .*--series") as caught:
        load(data / "dicom" / "single_syntaxes")
    assert caught.value.exit_code == 2
    assert load(data / "dicom" / "single_syntaxes", series="flair").dims == (256, 256, 1)
    assert load(data / "dicom" / "single_syntaxes", series="1").dims == (512, 400, 1)


def test_directory_file_is_no_image(data: Path) -> None:
    with pytest.raises(UnsupportedError, match="open the folder"):
        load(data / "dicom" / "ct_head_phantom_5mm_j2k" / "DIRFILE")


def test_series_list(data: Path) -> None:
    (only,) = dicom.list_series(data / "dicom" / "ct_head_phantom_5mm_j2k", ReadOptions())
    assert (only.number, only.images, only.rows, only.columns) == (1, 28, 512, 512)
    assert (only.modality, only.description, only.series_number) == ("CT", "STD BRAIN 5MM", 201)


# ------------------------------------------------------------------ made files


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


def test_per_slice_slopes(tmp_path: Path) -> None:
    def change(ds: FileDataset, k: int) -> None:
        ds.Modality, ds.Units = "PT", "BQML"
        ds.RescaleSlope, ds.RescaleIntercept = 0.5 + 0.125 * k, 0

    stored = maker.series(tmp_path, 6, change=change)
    volume = load(tmp_path)
    slopes = 0.5 + 0.125 * np.arange(6)
    np.testing.assert_allclose(volume.data, stored * slopes[:, None, None], rtol=1e-6)
    assert (volume.data.dtype, volume.info.value_unit) == (np.float32, "Bq/ml")


def test_whole_slopes_stay_integers(tmp_path: Path) -> None:
    def change(ds: FileDataset, k: int) -> None:
        ds.RescaleSlope, ds.RescaleIntercept = 2 + k % 2, -7

    stored = maker.series(tmp_path, 4, change=change)
    volume = load(tmp_path)
    factor = np.array([2, 3, 2, 3])[:, None, None]
    np.testing.assert_array_equal(volume.data, stored.astype(int) * factor - 7)
    assert volume.data.dtype == np.int32


def test_values_beyond_int16_widen_the_volume(tmp_path: Path) -> None:
    data = maker.voxels(4)
    data[2, 1, 1] = 65000
    maker.series(tmp_path, 4, data=data)
    volume = load(tmp_path)
    assert volume.data.dtype == np.int32
    np.testing.assert_array_equal(volume.data, data.astype(int) - 1024)


def test_twelve_signed_bits_with_overlay_bits(tmp_path: Path) -> None:
    truth = (maker.voxels(3).astype(np.int16) - 1200) % 2048 - 1024

    def change(ds: FileDataset, k: int) -> None:
        ds.BitsStored, ds.HighBit, ds.PixelRepresentation, ds.RescaleIntercept = 12, 11, 1, 0
        ds.PixelData = ((truth[k].astype(np.uint16) & 0xFFF) | 0x5000).tobytes()

    maker.series(tmp_path, 3, change=change)
    np.testing.assert_array_equal(load(tmp_path).data, truth)


def test_high_bit_above_the_stored_bits(tmp_path: Path) -> None:
    truth = maker.voxels(3) % 4096

    def change(ds: FileDataset, k: int) -> None:
        ds.BitsStored, ds.HighBit, ds.RescaleIntercept = 12, 15, 0
        ds.PixelData = (truth[k] << 4 | 3).astype(np.uint16).tobytes()

    maker.series(tmp_path, 3, change=change)
    np.testing.assert_array_equal(load(tmp_path).data, truth)


def test_padding_is_rescaled(tmp_path: Path) -> None:
    def change(ds: FileDataset, k: int) -> None:
        ds.add_new("PixelPaddingValue", "US", 1003)
        ds.add_new("PixelPaddingRangeLimit", "US", 1001)

    stored = maker.series(tmp_path, 3, change=change)
    info = load(tmp_path).info
    assert info.padding == 1003 - 1024
    assert any("-23 to -21" in w for w in info.warnings)
    np.testing.assert_array_equal(load(tmp_path).data, stored.astype(int) - 1024)


def test_monochrome1_keeps_its_values(tmp_path: Path) -> None:
    def change(ds: FileDataset, k: int) -> None:
        ds.PhotometricInterpretation = "MONOCHROME1"

    stored = maker.series(tmp_path, 3, change=change)
    volume = load(tmp_path)
    np.testing.assert_array_equal(volume.data, stored.astype(int) - 1024)
    assert any("MONOCHROME1" in w for w in volume.info.warnings)
    assert volume.info.fields["PhotometricInterpretation"] == "MONOCHROME1"


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


def test_rt_dose_offsets_and_scaling(tmp_path: Path) -> None:
    data = maker.voxels(3).astype(np.uint32)
    ds = maker.image(data[0], uid=generate_uid(), sop="1.2.840.10008.5.1.4.1.1.481.2")
    maker.put_pixels(ds, data)
    del ds.RescaleSlope, ds.RescaleIntercept
    ds.Modality, ds.NumberOfFrames, ds.DoseGridScaling = "RTDOSE", 3, 0.001
    ds.DoseUnits, ds.GridFrameOffsetVector = "GY", [0, 4, 8]
    volume = load(maker.save(ds, tmp_path / "dose.dcm"))
    np.testing.assert_allclose(volume.data, data * 0.001, rtol=1e-6)
    assert (volume.spacing[2], volume.info.value_unit) == (pytest.approx(4), "Gy")


@pytest.mark.parametrize("syntax", [ExplicitVRBigEndian, ImplicitVRLittleEndian])
def test_byte_orders(tmp_path: Path, syntax: str) -> None:
    data = maker.voxels(3)
    uid = generate_uid()
    for k in range(3):
        ds = maker.image(data[k], uid=uid, position=(0, 0, k), syntax=syntax)
        if syntax == ExplicitVRBigEndian:
            ds.PixelData = data[k].astype(">u2").tobytes()
            ds["PixelData"].VR = "OW"
        maker.save(ds, tmp_path / f"{k}.dcm")
    np.testing.assert_array_equal(load(tmp_path).data, data.astype(int) - 1024)


def test_deflated(tmp_path: Path) -> None:
    data = maker.voxels(1, 40, 50)
    ds = maker.image(data[0], uid=generate_uid(), syntax="1.2.840.10008.1.2.1.99")
    path = maker.save(ds, tmp_path / "deflated.dcm")
    np.testing.assert_array_equal(load(path).data, data.astype(int) - 1024)


def test_without_preamble(tmp_path: Path) -> None:
    data = maker.voxels(1)
    ds = maker.image(data[0], uid=generate_uid(), syntax=ImplicitVRLittleEndian)
    body = maker.save(ds, tmp_path / "whole.dcm").read_bytes()
    start = body.index(b"\x08\0\x16\0")
    bare = tmp_path / "bare.dcm"
    bare.write_bytes(body[start:])
    np.testing.assert_array_equal(load(bare).data, data.astype(int) - 1024)


def colour(tmp_path: Path, planar: int, photometric: str = "RGB") -> tuple[Path, np.ndarray]:
    rgb = np.random.default_rng(3).integers(0, 256, (6, 8, 3), dtype=np.uint8)
    ds = maker.image(rgb[..., 0], uid=generate_uid())
    ds.SamplesPerPixel, ds.PlanarConfiguration, ds.PhotometricInterpretation = (
        3,
        planar,
        photometric,
    )
    ds.PixelData = (np.moveaxis(rgb, -1, 0) if planar else rgb).tobytes()
    del ds.RescaleSlope, ds.RescaleIntercept
    return maker.save(ds, tmp_path / "rgb.dcm"), rgb


@pytest.mark.parametrize("planar", [0, 1])
def test_rgb_becomes_luminance(tmp_path: Path, planar: int) -> None:
    path, rgb = colour(tmp_path, planar)
    volume = load(path)
    expected = np.rint(rgb @ np.array([0.2126, 0.7152, 0.0722]))
    np.testing.assert_array_equal(volume.data[0], expected)
    assert volume.data.dtype == np.uint8
    assert any("luminance" in w for w in volume.info.warnings)


def test_ybr_becomes_luminance(tmp_path: Path) -> None:
    path, _ = colour(tmp_path, 0, "YBR_FULL")
    rgb = pydicom.pixels.pixel_array(path)  # converted by pydicom
    expected = np.rint(rgb @ np.array([0.2126, 0.7152, 0.0722]))
    np.testing.assert_array_equal(load(path).data[0], expected)


def test_palette_becomes_luminance(tmp_path: Path) -> None:
    index = np.arange(40, dtype=np.uint8).reshape(5, 8)
    ds = maker.image(index, uid=generate_uid())
    del ds.RescaleSlope, ds.RescaleIntercept
    ds.PhotometricInterpretation = "PALETTE COLOR"
    ramp = np.arange(256, dtype=np.uint8)
    for name, table in (("Red", ramp), ("Green", ramp[::-1]), ("Blue", ramp // 2)):
        setattr(ds, f"{name}PaletteColorLookupTableDescriptor", [256, 0, 8])
        setattr(ds, f"{name}PaletteColorLookupTableData", table.tobytes())
        ds[f"{name}PaletteColorLookupTableDescriptor"].VR = "US"
        ds[f"{name}PaletteColorLookupTableData"].VR = "OW"
    volume = load(maker.save(ds, tmp_path / "palette.dcm"))
    grey = np.rint(0.2126 * ramp + 0.7152 * ramp[::-1] + 0.0722 * (ramp // 2))
    np.testing.assert_array_equal(volume.data[0], grey[index])


def test_rle_of_two_bytes_and_of_frames(tmp_path: Path) -> None:
    from pydicom.pixels import get_encoder

    data = maker.voxels(3, 16, 20)
    ds = maker.image(data[0], uid=generate_uid(), syntax="1.2.840.10008.1.2.5")
    maker.put_pixels(ds, data)
    ds.NumberOfFrames, ds.SpacingBetweenSlices = 3, 2
    encoder = get_encoder("1.2.840.10008.1.2.5")
    from pydicom.encaps import encapsulate

    frames = [
        encoder.encode(
            frame.tobytes(),
            rows=16,
            columns=20,
            samples_per_pixel=1,
            bits_allocated=16,
            bits_stored=16,
            pixel_representation=0,
            photometric_interpretation="MONOCHROME2",
            number_of_frames=1,
        )
        for frame in data
    ]
    ds.PixelData = encapsulate(frames)
    ds["PixelData"].VR = "OB"
    ds["PixelData"].is_undefined_length = True
    np.testing.assert_array_equal(
        load(maker.save(ds, tmp_path / "rle.dcm")).data, data.astype(int) - 1024
    )


@pytest.mark.parametrize("plugin", ["imagecodecs", "pylibjpeg"])
def test_missing_codec_names_syntax_and_cure(data: Path, monkeypatch, plugin: str) -> None:
    from volviz.io import dicom_codecs

    if plugin == "imagecodecs":
        monkeypatch.setattr(dicom_codecs, "find_spec", lambda name: None)
        path, uid = data / "dicom/single_syntaxes/jpeg_lossless_sel1.dcm", "1.2.840.10008.1.2.4.70"
    else:
        from pydicom.pixels.decoders.base import JPEGLSNearLosslessDecoder

        monkeypatch.setattr(JPEGLSNearLosslessDecoder, "_available", {})
        path, uid = data / "dicom/single_syntaxes/jpeg_ls.dcm", "1.2.840.10008.1.2.4.81"
    with pytest.raises(UnsupportedError) as caught:
        load(path)
    assert uid in str(caught.value)
    assert "pip install 'volviz[codecs]'" in str(caught.value)
    assert caught.value.exit_code == 4
    assert probe(path).dims[2] == 1


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


def test_limit_before_allocation(tmp_path: Path) -> None:
    maker.series(tmp_path, 4)
    with pytest.raises(LimitError, match="the limit is"):
        load(tmp_path, limits=Limits(max_bytes=100))
    with pytest.raises(LimitError, match="more than 3 files"):
        load(tmp_path, limits=Limits(max_files=3))


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
