from __future__ import annotations

import bz2
import gzip
from pathlib import Path

import nrrd as pynrrd
import numpy as np
import pytest

from tests.io.nrrd_maker import ARRAY, simple, write
from tests.io.oracle import places, same_as_simpleitk
from volviz.errors import InputError, UsageError
from volviz.io import load, probe
from volviz.model.volume import Volume

REAL = [
    "ct/cranium_head_ct.nrrd",
    "ct/cranium_head_labels.nrrd",
    "mri/stroke_FLAIR_oblique.nrrd",
    "mri/prostate_phantom.nrrd",
    "mri/prostate_phantom_labels.nrrd",
    "simulation/nucleon.nrrd",
    "formats/tooth_bigendian_uint16.nhdr",
    "formats/nrrd/BallBinary30x30x30.nhdr",
    "formats/nrrd/BallBinary30x30x30.nrrd",
    "formats/nrrd/BallBinary30x30x30_byteskip_minus_one.nhdr",
    "formats/nrrd/BallBinary30x30x30_gz.nrrd",
    "formats/nrrd/BallBinary30x30x30_gz_byteskip_minus_one.nrrd",
]


@pytest.mark.parametrize("name", REAL)
def test_real_files_equal_simpleitk(data: Path, name: str) -> None:
    volume = load(data / name)
    same_as_simpleitk(volume, data / name)
    info = probe(data / name)
    assert (info.dims, info.dtype, info.format) == (volume.dims, volume.data.dtype, "NRRD")
    np.testing.assert_array_equal(info.affine, volume.affine)


@pytest.mark.parametrize(
    "name", ["formats/nrrd/test_customFields.nrrd", "formats/nrrd/test_simple4d_raw.nrrd"]
)
def test_real_files_equal_pynrrd_where_simpleitk_refuses(data: Path, name: str) -> None:
    volume = load(data / name)
    if name.endswith("raw.nrrd"):
        expected = np.frombuffer((data / name).read_bytes().split(b"\n\n", 1)[1][:8], "<f8")
        np.testing.assert_allclose(np.diag(volume.affine), [-1.5, -1.5, 1, 1])
        assert volume.info.space == "LPS"
    else:
        expected = pynrrd.read(str(data / name), index_order="C")[0]
        assert volume.info.fields["string list"] == "words are split by space in list"
        assert any("1D" in w for w in volume.info.warnings)
    np.testing.assert_array_equal(volume.data.ravel(), expected)


def test_the_large_labels_header(data: Path) -> None:
    info = probe(data / "large/connectomics_512_labels.nrrd")
    assert (info.dims, info.dtype.name, info.encoding) == ((512,) * 3, "uint16", "gzip")
    assert (info.space, info.length_unit) == (None, "nm")
    np.testing.assert_allclose(info.spacing, np.array([32, 32, 40]) * 1e-6)


@pytest.mark.slow
def test_the_large_labels(data: Path) -> None:
    path = data / "large/connectomics_512_labels.nrrd"
    volume = load(path)
    np.testing.assert_array_equal(volume.data, pynrrd.read(str(path), index_order="C")[0])


def test_nrrd_and_nifti_of_one_scan_land_on_the_same_place(data: Path) -> None:
    one = load(data / "mri/stroke_FLAIR_oblique.nrrd")
    other = load(data / "mri/stroke_FLAIR_oblique.nii.gz")
    np.testing.assert_allclose(places(one), places(other), atol=1e-3)
    np.testing.assert_array_equal(one.data, other.data)


@pytest.mark.parametrize(
    "encoding", ["raw", "gzip", "gz", "bzip2", "bz2", "hex", "ascii", "txt", "text"]
)
@pytest.mark.parametrize("dtype", ["|u1", "|i1", "<i2", ">u2", ">i4", "<f4", ">f8"])
def test_every_encoding_and_byte_order(tmp_path: Path, encoding: str, dtype: str) -> None:
    array = ARRAY.astype(dtype)
    pack = {"raw": bytes, "hex": lambda b: b.hex("\n", 9).encode()}
    pack |= dict.fromkeys(("gzip", "gz"), gzip.compress) | dict.fromkeys(
        ("bzip2", "bz2"), bz2.compress
    )
    text = " ".join(str(v) for v in array.ravel()).encode()
    payload = pack[encoding](array.tobytes()) if encoding in pack else text
    path = write(tmp_path / "a.nrrd", simple(array, encoding=encoding), payload)
    volume = load(path)
    np.testing.assert_array_equal(volume.data, array)
    assert volume.data.dtype == array.dtype.newbyteorder("=")
    if encoding not in ("hex", "txt", "text"):
        np.testing.assert_array_equal(pynrrd.read(str(path), index_order="C")[0], array)


def test_every_spelling_of_a_type(tmp_path: Path) -> None:
    from nrrd.reader import _TYPEMAP_NRRD2NUMPY as known

    for name, code in known.items():
        if name == "block":
            continue
        array = ARRAY[:2, :2, :2].astype("<" + code)
        header = simple(array).replace(simple(array).splitlines()[0], f"type: {name}")
        np.testing.assert_array_equal(
            load(write(tmp_path / "t.nrrd", header, array.tobytes())).data, array
        )


@pytest.mark.parametrize("data_field", ["data file", "datafile", "Data File"])
@pytest.mark.parametrize("suffix", [".nhdr", ".nrrd"])
def test_detached(tmp_path: Path, data_field: str, suffix: str) -> None:
    (tmp_path / "the voxels.raw").write_bytes(ARRAY.tobytes())
    path = tmp_path / f"h{suffix}"
    path.write_text("NRRD0004\n" + simple(ARRAY) + f"\n{data_field}: ./the voxels.raw\n")
    path.write_text(path.read_text().replace("        ", ""))
    np.testing.assert_array_equal(load(path).data, ARRAY)


@pytest.mark.parametrize("encoding", ["raw", "gzip"])
@pytest.mark.parametrize("subdim", ["", " 2", " 3"])
def test_list_of_files(tmp_path: Path, encoding: str, subdim: str) -> None:
    pack = gzip.compress if encoding == "gzip" else bytes
    count = 2 if subdim == " 3" else 4
    for k, part in enumerate(np.split(ARRAY, count)):
        (tmp_path / f"part {k}.x").write_bytes(pack(part.tobytes()))
    names = "\n".join(f"part {k}.x" for k in range(count))
    header = simple(ARRAY, f"data file: LIST{subdim}\n{names}", encoding)
    path = write(tmp_path / "h.nhdr", header, end_blank=False)
    volume = load(path)
    np.testing.assert_array_equal(volume.data, ARRAY)
    assert volume.info.fields["data files"].splitlines()[0] == "part 0.x"
    if encoding == "raw" and subdim != " 3":
        same_as_simpleitk(volume, path)


def test_pattern_of_files(tmp_path: Path) -> None:
    for k, part in enumerate(ARRAY):
        (tmp_path / f"s{10 + 2 * k:03d}.raw").write_bytes(b"junk" + part.tobytes())
    path = write(tmp_path / "h.nhdr", simple(ARRAY, "byte skip: 4\ndata file: s%03d.raw 10 16 2 2"))
    volume = load(path)
    np.testing.assert_array_equal(volume.data, ARRAY)
    same_as_simpleitk(volume, path)
    path.write_text(path.read_text().replace("10 16 2", "16 10 -2"))
    np.testing.assert_array_equal(load(path).data, ARRAY[::-1])


@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_crlf_cp1252_and_odd_spelling(tmp_path: Path, end: str) -> None:
    header = simple(ARRAY, "Space Directions: ( 1, 0, 0 ) (0 ,2,0) (0,0,3)\nSPACE: LPS")
    path = write(
        tmp_path / "a.nrrd", header + "\nkey with: colon:=a=b:c\\nd", ARRAY.tobytes(), end=end
    )
    raw = path.read_bytes()
    path.write_bytes(raw.replace(b"type:", "# größer\ntype:".encode("cp1252"), 1))
    volume = load(path)
    np.testing.assert_array_equal(volume.data, ARRAY)
    assert volume.spacing == (1, 2, 3)
    assert volume.info.fields["comments"] == "größer"


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        ("byte skip: 3", b"abc%s"),
        ("byte skip: -1", b"anything at all\n%s"),
        ("line skip: 2", b"one\ntwo\n%s"),
        ("line skip: 1\nbyte skip: 2", b"one\nxy%s"),
    ],
)
def test_skips(tmp_path: Path, lines: str, expected: bytes) -> None:
    for name, detached in (("a.nrrd", ""), ("a.nhdr", "\ndata file: a.raw")):
        payload = expected.replace(b"%s", ARRAY.tobytes())
        (tmp_path / "a.raw").write_bytes(payload)
        header = simple(ARRAY, lines + detached)
        path = write(tmp_path / name, header, b"" if detached else payload)
        np.testing.assert_array_equal(load(path).data, ARRAY)


def test_skips_of_compressed_data_count_decoded_bytes(tmp_path: Path) -> None:
    inside = gzip.compress(b"abc" + ARRAY.tobytes())
    for skip in (3, -1):
        header = simple(ARRAY, f"line skip: 1\nbyte skip: {skip}", "gzip")
        path = write(tmp_path / "a.nrrd", header, b"a line\n" + inside)
        np.testing.assert_array_equal(load(path).data, ARRAY)


def test_what_the_values_mean(tmp_path: Path) -> None:
    def info(name: str, keys: str):
        return probe(write(tmp_path / name, simple(ARRAY, keys), ARRAY.tobytes()))

    assert (info("a.nrrd", "").modality, info("a.nrrd", "").value_unit) == (None, None)
    ct = info("a.nrrd", "DICOM_0008_0060:=CT")
    assert (ct.modality, ct.value_unit) == ("CT", "HU")
    assert info("a.nrrd", "modality:=MRI").modality == "MR"
    assert info("a.nrrd", "sample units: Hounsfield").value_unit == "HU"
    assert info("a.nrrd", "Segment0_ID:=Segment_1").kind == "labels"
    assert info("a.seg.nrrd", "").kind == "labels"
    assert info("a.seg.nrrd", "").name == "a"
    assert info("a.nrrd", "").kind == "scalar"


def test_own_spacing(tmp_path: Path) -> None:
    more = "space: LPS\nspace directions: (0,2,0) (-3,0,0) (0,0,4)"
    path = write(tmp_path / "a.nrrd", simple(ARRAY, more), ARRAY.tobytes())
    volume = load(path, spacing=(1.0, 1.5, 2.0))
    assert volume.spacing == (1, 1.5, 2)
    np.testing.assert_array_equal(volume.affine[:3, 0], [0, 1, 0])
    with pytest.raises(UsageError, match="spacing"):
        load(path, spacing=(1.0, 0.0, 2.0))


def test_key_values_never_stand_for_fields(tmp_path: Path) -> None:
    path = write(tmp_path / "a.nrrd", simple(ARRAY, "sizes:=9 9 9\ntype:=double"), ARRAY.tobytes())
    volume = load(path)
    assert volume.dims == (6, 5, 4)
    assert volume.info.fields["sizes"] == "6 5 4"
    assert volume.info.fields["sizes :="] == "9 9 9"


def test_a_header_without_end_has_no_voxels(tmp_path: Path) -> None:
    path = tmp_path / "a.nrrd"
    path.write_text("NRRD0004\n" + simple(ARRAY).replace("  ", ""))
    with pytest.raises(InputError, match="ends with its header"):
        load(path)


def test_volume_is_read_only(tmp_path: Path) -> None:
    volume = load(write(tmp_path / "a.nrrd", simple(ARRAY), ARRAY.tobytes()))
    assert isinstance(volume, Volume)
    assert not volume.data.flags.writeable
