from __future__ import annotations

import gzip
import shutil
from pathlib import Path

import nibabel as nib
import numpy as np
import pytest

from tests.io.oracle import RAS_TO_LPS, same_as_nibabel, same_as_simpleitk
from volviz.errors import UnsupportedError, UsageError
from volviz.io import load, probe

THREE = [
    "ct/ct_pitch_oblique.nii.gz",
    "ct/totalseg_torso_ct.nii.gz",
    "ct/totalseg_torso_sm_ct.nii.gz",
    "ct/totalseg_torso_sm_labels117.nii.gz",
    "ct/totalseg_torso_vertebrae_labels.nii.gz",
    "mri/ch2_aal_labels.nii.gz",
    "mri/ch2_colin27_t1.nii.gz",
    "mri/stroke_FLAIR_oblique.nii.gz",
    "mri/stroke_T1_oblique.nii.gz",
    "formats/anatomical_bigendian.nii",
    "classics/bonsai_256.nii.gz",
]
FOUR = [
    "mri/asl_4d.nii.gz",
    "mri/example4d.nii.gz",
    "formats/functional_4d_slope_inter.nii",
    "formats/example_nifti2.nii.gz",
]
RNG = np.random.default_rng(9)
ARRAY = RNG.integers(0, 100, (6, 5, 4)).astype("i2")
OBLIQUE = np.array([[1.2, 0.3, 0, -10], [-0.4, 1.5, 0.2, 20], [0, 0.1, 2, 30], [0, 0, 0, 1.0]])


def save(
    path: Path, array: np.ndarray, affine: np.ndarray | None = OBLIQUE, **fields: object
) -> Path:
    """`array[x, y, z, …]` as nibabel writes it, with some header fields set by hand."""
    order = fields.pop("order", "<")
    two = fields.pop("two", False)
    header = (nib.Nifti2Header if two else nib.Nifti1Header)(endianness=order)
    header.set_data_dtype(array.dtype)
    header.set_data_shape(array.shape)
    header["vox_offset"] = header.single_vox_offset
    header["pixdim"][1:4] = 1
    if affine is not None:
        header.set_sform(affine, 1)
    for key, value in fields.items():
        header[key] = value
    data = array.astype(array.dtype.newbyteorder(order)).tobytes("F")
    content = header.binaryblock + bytes(4) + data
    path.write_bytes(gzip.compress(content) if path.name.endswith(".gz") else content)
    return path


@pytest.mark.parametrize("name", THREE)
def test_real_files_equal_nibabel(data: Path, name: str) -> None:
    volume = load(data / name)
    same_as_nibabel(volume, data / name)
    info = probe(data / name)
    assert (info.dims, info.dtype, info.space) == (volume.dims, volume.data.dtype, "LPS")


@pytest.mark.parametrize("name", ["ct/ct_pitch_oblique.nii.gz", "mri/stroke_T1_oblique.nii.gz"])
def test_real_files_equal_simpleitk(data: Path, name: str) -> None:
    same_as_simpleitk(load(data / name), data / name)


@pytest.mark.slow
def test_the_large_one(data: Path) -> None:
    same_as_nibabel(
        load(data / "simulation/heptane_302.nii.gz"), data / "simulation/heptane_302.nii.gz"
    )


@pytest.mark.parametrize("name", FOUR)
def test_times_equal_nibabel(data: Path, name: str) -> None:
    times = probe(data / name).times
    assert times == nib.load(data / name).shape[3]
    for time in {0, times // 2, times - 1}:
        volume = load(data / name, time=time)
        same_as_nibabel(volume, data / name, (time,))
        assert volume.info.time == time
    with pytest.raises(UsageError, match=f"choose 0 to {times - 1}"):
        load(data / name, time=times)


@pytest.mark.parametrize("kind", ["u1", "i1", "u2", "i2", "u4", "i4", "u8", "i8", "f4", "f8"])
def test_every_type(data: Path, kind: str) -> None:
    path = data / f"formats/nifti_dtypes/{np.dtype(kind).name}.nii"
    volume = load(path)
    same_as_nibabel(volume, path)
    assert volume.data.dtype == np.dtype(kind)


def test_all_orientations_show_the_same_head_in_the_same_place(data: Path) -> None:
    """Every voxel of every file has the value that RAS.nii.gz has at that world position."""
    folder = data / "mri/nifti_orientations"
    reference = load(folder / "RAS.nii.gz")
    back = np.linalg.inv(reference.affine)
    files = sorted(folder.glob("*.nii.gz"))
    assert len(files) == 13
    for path in files:
        volume = load(path)
        same_as_nibabel(volume, path)
        assert volume.info.orientation == path.name[:3]
        z, y, x = np.indices(volume.data.shape).reshape(3, -1)
        index = (back @ volume.affine @ np.stack([x, y, z, np.ones_like(x)]))[:3]
        nearest = np.rint(index).astype(int)
        np.testing.assert_allclose(index, nearest, atol=1e-3)
        np.testing.assert_array_equal(
            reference.data[nearest[2], nearest[1], nearest[0]], volume.data.ravel()
        )


@pytest.mark.parametrize("order", "<>")
@pytest.mark.parametrize("two", [False, True])
@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz"])
def test_both_versions_and_byte_orders(tmp_path: Path, order: str, two: bool, name: str) -> None:
    path = save(tmp_path / name, ARRAY, order=order, two=two)
    volume = load(path)
    np.testing.assert_array_equal(volume.data, ARRAY.T)
    np.testing.assert_allclose(volume.affine, RAS_TO_LPS @ OBLIQUE, rtol=1e-6)
    assert volume.info.format == ("NIfTI-2" if two else "NIfTI-1")
    same_as_nibabel(volume, path)


def test_gzip_is_seen_by_content(tmp_path: Path) -> None:
    packed = save(tmp_path / "a.nii.gz", ARRAY)
    plain = save(tmp_path / "b.nii", ARRAY)
    shutil.copy(packed, tmp_path / "c.nii")
    shutil.copy(plain, tmp_path / "d.nii.gz")
    shutil.copy(packed, tmp_path / "e.nrrd")
    for name in ("c.nii", "d.nii.gz", "e.nrrd"):
        np.testing.assert_array_equal(load(tmp_path / name).data, ARRAY.T)


@pytest.mark.parametrize("suffix", ["", ".gz"])
@pytest.mark.parametrize("kind", [nib.Nifti1Pair, nib.Nifti2Pair])
def test_pairs_open_from_either_file(tmp_path: Path, suffix: str, kind: type) -> None:
    image = kind(ARRAY, OBLIQUE)
    nib.save(image, tmp_path / f"a.b.img{suffix}")
    for end in (".hdr", ".img"):
        volume = load(tmp_path / f"a.b{end}{suffix}")
        np.testing.assert_array_equal(volume.data, ARRAY.T)
        np.testing.assert_allclose(volume.affine, RAS_TO_LPS @ OBLIQUE, rtol=1e-6)
        assert volume.info.name == "a.b"


@pytest.mark.parametrize("order", "<>")
def test_analyze(tmp_path: Path, order: str) -> None:
    header = nib.AnalyzeHeader(endianness=order)
    image = nib.AnalyzeImage(ARRAY, np.diag([-2.0, 3, 4, 1]), header)
    nib.save(image, tmp_path / "a.img")
    for name in ("a.hdr", "a.img"):
        volume = load(tmp_path / name)
        np.testing.assert_array_equal(volume.data, ARRAY.T)
        assert (volume.info.format, volume.info.space) == ("Analyze 7.5", None)
        assert volume.spacing == (2, 3, 4)
        assert any("left and right" in w for w in volume.info.warnings)


@pytest.mark.parametrize("name", ["a.nii", "a.nii.gz"])
def test_times_and_vectors(tmp_path: Path, name: str) -> None:
    array = RNG.integers(0, 1000, (6, 5, 4, 3, 2)).astype("u2")
    path = save(tmp_path / name, array)
    for time in range(3):
        for channel in range(2):
            volume = load(path, time=time, channel=channel)
            np.testing.assert_array_equal(volume.data, array[..., time, channel].T)
    info = probe(path)
    assert (info.times, info.channels) == (3, 2)
    with pytest.raises(UsageError):
        load(path, channel=2)


@pytest.mark.parametrize(
    ("dtype", "result"),
    [
        ("u1", "f4"),
        ("i2", "f4"),
        ("u2", "f4"),
        ("i4", "f8"),
        ("i8", "f8"),
        ("f4", "f4"),
        ("f8", "f8"),
    ],
)
def test_slope_and_intercept(tmp_path: Path, dtype: str, result: str) -> None:
    array = RNG.integers(0, 100, (6, 5, 4)).astype(dtype)
    path = save(tmp_path / "a.nii", array, scl_slope=0.37, scl_inter=-5.25)
    volume = load(path)
    assert volume.data.dtype == np.dtype(result) == probe(path).dtype
    np.testing.assert_allclose(volume.data, nib.load(path).get_fdata().T, rtol=1e-6)


@pytest.mark.parametrize("slope", [0, np.nan, np.inf, -np.inf, 1])
def test_slopes_that_change_nothing_keep_integers(tmp_path: Path, slope: float) -> None:
    inter = 0 if slope == 1 else 7
    volume = load(save(tmp_path / "a.nii", ARRAY, scl_slope=slope, scl_inter=inter))
    assert volume.data.dtype == np.int16
    np.testing.assert_array_equal(volume.data, ARRAY.T)


def test_a_broken_intercept_is_told(tmp_path: Path) -> None:
    volume = load(save(tmp_path / "a.nii", ARRAY, scl_slope=2, scl_inter=np.nan))
    np.testing.assert_array_equal(volume.data, 2 * ARRAY.T)
    assert any("scl_inter" in w for w in volume.info.warnings)


def test_wide_integers_keep_their_precision(tmp_path: Path) -> None:
    array = np.array([[[2**24 + 1, 2**31 - 1]]], "i4")
    volume = load(save(tmp_path / "a.nii", array, scl_slope=1, scl_inter=1))
    assert volume.data.ravel().tolist() == [2**24 + 2, 2**31]


def test_nan_voxels_are_kept(tmp_path: Path) -> None:
    array = np.full((3, 3, 3), np.nan, "f4")
    assert np.isnan(load(save(tmp_path / "a.nii", array)).data).all()
    array[0], array[1] = np.inf, 4
    np.testing.assert_array_equal(load(save(tmp_path / "a.nii", array)).data, array.T)


def test_qform_and_sform(tmp_path: Path) -> None:
    header = nib.Nifti1Header()
    header.set_qform(np.diag([2.0, 3, 4, 1]), 1)
    fields = {k: header[k] for k in ("qform_code", "quatern_b", "quatern_c", "quatern_d", "pixdim")}
    path = save(tmp_path / "a.nii", ARRAY, None, **fields)
    volume = load(path)
    np.testing.assert_allclose(volume.affine, np.diag([-2, -3, 4, 1]))
    same_as_nibabel(volume, path)
    path = save(tmp_path / "b.nii", ARRAY, OBLIQUE, **fields)
    volume = load(path)
    np.testing.assert_allclose(volume.affine, RAS_TO_LPS @ OBLIQUE, rtol=1e-6)
    warning = next(w for w in volume.info.warnings if "differ by" in w)
    ends = np.array([[x, y, z, 1] for x in (0, 5) for y in (0, 4) for z in (0, 3)])
    apart = np.linalg.norm((ends @ (OBLIQUE - np.diag([2.0, 3, 4, 1])).T)[:, :3], axis=1).max()
    assert f"{apart:.3g} mm; the sform is used" in warning


def test_a_qform_with_negative_qfac(tmp_path: Path) -> None:
    header = nib.Nifti1Header()
    turned = nib.affines.from_matvec(
        nib.eulerangles.euler2mat(0.3, 0.2, 0.1) @ np.diag([2, 3, -4]), (1, 2, 3)
    )
    header.set_qform(turned, 1)
    names = (
        "qform_code",
        "quatern_b",
        "quatern_c",
        "quatern_d",
        "qoffset_x",
        "qoffset_y",
        "qoffset_z",
        "pixdim",
    )
    path = save(tmp_path / "a.nii", ARRAY, None, **{k: header[k] for k in names})
    volume = load(path)
    np.testing.assert_allclose(volume.affine, RAS_TO_LPS @ turned, atol=1e-5)
    same_as_simpleitk(volume, path)


def test_no_form_is_no_space(tmp_path: Path) -> None:
    path = save(tmp_path / "a.nii", ARRAY, None, pixdim=[1, 2, -3, 0, 0, 0, 0, 0])
    info = probe(path)
    assert (info.space, info.orientation) == (None, None)
    assert info.spacing == (2, 3, 1)
    assert any("neither sform nor qform" in w for w in info.warnings)
    assert any("pixdim" in w for w in info.warnings)


def test_broken_forms_give_way(tmp_path: Path) -> None:
    path = save(tmp_path / "a.nii", ARRAY, np.zeros((4, 4)), pixdim=[1, 2, 3, 4, 0, 0, 0, 0])
    info = probe(path)
    assert info.spacing == (2, 3, 4)
    assert any("sform is set but" in w for w in info.warnings)
    path = save(
        tmp_path / "b.nii", ARRAY, None, qform_code=1, quatern_b=9, pixdim=[1, 2, 3, 4, 0, 0, 0, 0]
    )
    assert any("qform is set but" in w for w in probe(path).warnings)
    path = save(tmp_path / "c.nii", ARRAY, srow_x=[1, 0, 0, np.nan])
    info = probe(path)
    assert np.all(np.isfinite(info.affine))
    assert any("origin" in w for w in info.warnings)


@pytest.mark.parametrize(
    ("code", "unit", "factor"),
    [(1, "m", 1e3), (2, "mm", 1), (3, "µm", 1e-3), (0, "mm", 1), (11, "µm", 1e-3)],
)
def test_units(tmp_path: Path, code: int, unit: str, factor: float) -> None:
    info = probe(save(tmp_path / "a.nii", ARRAY, xyzt_units=code))
    scale = np.diag([factor, factor, factor, 1])
    np.testing.assert_allclose(info.affine, scale @ RAS_TO_LPS @ OBLIQUE, rtol=1e-6)
    assert info.length_unit == unit


def test_labels_and_window(tmp_path: Path) -> None:
    info = probe(save(tmp_path / "a.nii", ARRAY, intent_code=1002, cal_min=10, cal_max=50))
    assert (info.kind, info.window, info.modality) == ("labels", (30, 40), None)
    info = probe(save(tmp_path / "a.nii", ARRAY, cal_min=50, cal_max=10))
    assert (info.kind, info.window) == ("scalar", None)


def coloured(path: Path, channels: int) -> np.ndarray:
    """An RGB24 or RGBA32 file; returns its `[x, y, z, channel]`."""
    array = RNG.integers(0, 255, (6, 5, 4, channels)).astype("u1")
    header = nib.Nifti1Header()
    header["datatype"], header["bitpix"] = (128, 24) if channels == 3 else (2304, 32)
    header["dim"] = [3, 6, 5, 4, 1, 1, 1, 1]
    header["vox_offset"] = 352
    header.set_sform(OBLIQUE, 1)
    path.write_bytes(header.binaryblock + bytes(4) + array.transpose(2, 1, 0, 3).tobytes())
    return array


@pytest.mark.parametrize("channels", [3, 4])
def test_colours_are_channels(tmp_path: Path, channels: int) -> None:
    path = tmp_path / "a.nii"
    array = coloured(path, channels)
    for k in range(channels):
        volume = load(path, channel=k)
        np.testing.assert_array_equal(volume.data, array[..., k].T)
        assert volume.info.channels == channels
    names = np.asarray(nib.load(path).dataobj).dtype.names
    np.testing.assert_array_equal(np.asarray(nib.load(path).dataobj)[names[1]], array[..., 1])


@pytest.mark.parametrize("dtype", ["c8", "c16"])
def test_complex_is_magnitude(tmp_path: Path, dtype: str) -> None:
    array = (RNG.normal(size=(6, 5, 4)) + 1j * RNG.normal(size=(6, 5, 4))).astype(dtype)
    volume = load(save(tmp_path / "a.nii", array, scl_slope=2, scl_inter=1))
    np.testing.assert_allclose(volume.data, np.abs(array * 2 + 1).T, rtol=1e-6)
    assert volume.data.dtype.itemsize * 2 == np.dtype(dtype).itemsize
    assert any("magnitude" in w for w in volume.info.warnings)


@pytest.mark.parametrize("code", [1, 1536, 2048])
def test_types_that_are_not_read(tmp_path: Path, code: int) -> None:
    with pytest.raises(UnsupportedError, match="datatype"):
        load(save(tmp_path / "a.nii", ARRAY, datatype=code))


@pytest.mark.parametrize("shape", [(6,), (6, 5), (1, 1, 1), (3, 1, 7)])
def test_small_and_thin(tmp_path: Path, shape: tuple[int, ...]) -> None:
    array = RNG.integers(0, 100, shape).astype("i2")
    volume = load(save(tmp_path / "a.nii", array))
    assert volume.dims == (*shape, 1, 1)[:3]
    np.testing.assert_array_equal(volume.data.ravel(), array.ravel("F"))


def test_zero_offset_means_behind_the_header(tmp_path: Path) -> None:
    np.testing.assert_array_equal(load(save(tmp_path / "a.nii", ARRAY, vox_offset=0)).data, ARRAY.T)


def test_own_spacing(tmp_path: Path) -> None:
    volume = load(save(tmp_path / "a.nii", ARRAY), spacing=(1.0, 2.0, 3.0))
    np.testing.assert_allclose(volume.spacing, (1, 2, 3))


def test_the_header_is_shown_as_it_is(data: Path) -> None:
    fields = probe(data / "formats/example_nifti2.nii.gz").fields
    assert fields["sizeof_hdr"] == "540"
    assert fields["dim"].split()[:5] == ["4", "32", "20", "12", "2"]
    assert fields["magic"].startswith("n+2")
    assert all(isinstance(v, str) and "\0" not in v for v in fields.values())
