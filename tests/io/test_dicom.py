"""DICOM against pydicom and SimpleITK on real files, and against known truth on made ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pydicom
import pytest
import SimpleITK as sitk

from volviz.errors import UnsupportedError, UsageError
from volviz.io import ReadOptions, dicom, load, probe

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
