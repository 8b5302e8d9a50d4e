from __future__ import annotations

import bz2
import gzip
import itertools
from pathlib import Path

import nrrd as pynrrd
import numpy as np
import pytest

from tests.io.oracle import places, same_as_simpleitk
from volviz.errors import InputError, UnsupportedError, UsageError
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


def write(
    path: Path, header: str, payload: bytes = b"", *, magic: str = "NRRD0004", end: str = "\n"
) -> Path:
    """An attached NRRD of these header lines, plus `end` as line ends."""
    lines = [magic, *(line.strip() for line in header.strip().splitlines())]
    path.write_bytes((end.join(lines) + end + end).encode() + payload)
    return path


def simple(array: np.ndarray, more: str = "", encoding: str = "raw") -> str:
    """Header lines for `array[z, y, x]`."""
    names = {"i1": "int8", "u1": "uchar", "i2": "short", "u2": "ushort", "i4": "int", "f4": "float"}
    endian = "big" if array.dtype.byteorder == ">" else "little"
    return f"""type: {names.get(array.dtype.str[1:], array.dtype.name)}
        dimension: {array.ndim}
        sizes: {" ".join(map(str, array.shape[::-1]))}
        endian: {endian}
        encoding: {encoding}
        {more}""".rstrip()


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


ARRAY = (np.arange(4 * 5 * 6).reshape(4, 5, 6) % 120).astype("<i2")


@pytest.mark.parametrize("encoding", ["raw", "gzip", "gz", "bzip2", "bz2", "hex", "ascii", "txt", "text"])
@pytest.mark.parametrize("dtype", ["|u1", "|i1", "<i2", ">u2", ">i4", "<f4", ">f8"])
def test_every_encoding_and_byte_order(tmp_path: Path, encoding: str, dtype: str) -> None:
    array = ARRAY.astype(dtype)
    pack = {"raw": bytes, "hex": lambda b: b.hex("\n", 9).encode()}
    pack |= dict.fromkeys(("gzip", "gz"), gzip.compress) | dict.fromkeys(("bzip2", "bz2"), bz2.compress)
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
        np.testing.assert_array_equal(load(write(tmp_path / "t.nrrd", header, array.tobytes())).data, array)


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
    path = write(tmp_path / "h.nhdr", header)
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
    path = write(tmp_path / "a.nrrd", header + "\nkey with: colon:=a=b:c\\nd", ARRAY.tobytes(), end=end)
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


@pytest.mark.parametrize(
    ("space", "flips"),
    [
        ("left-posterior-superior", (1, 1, 1)),
        ("LPS", (1, 1, 1)),
        ("right-anterior-superior", (-1, -1, 1)),
        ("RAS", (-1, -1, 1)),
        ("left-anterior-superior", (1, -1, 1)),
        ("LAS", (1, -1, 1)),
    ],
)
def test_spaces_become_lps(tmp_path: Path, space: str, flips: tuple[int, ...]) -> None:
    geometry = f"""space: {space}
        space directions: (0.5,0.1,0) (-0.2,1.5,0.3) (0,0.4,2)
        space origin: (10,-20,30)"""
    path = write(tmp_path / "a.nrrd", simple(ARRAY, geometry), ARRAY.tobytes())
    volume = load(path)
    steps = np.array([[0.5, -0.2, 0], [0.1, 1.5, 0.4], [0, 0.3, 2]])
    np.testing.assert_allclose(volume.affine[:3, :3], np.diag(flips) @ steps)
    np.testing.assert_allclose(volume.info.origin, np.array(flips) * (10, -20, 30))
    assert (volume.info.space, volume.info.length_unit) == ("LPS", "mm")
    assert volume.info.oblique


@pytest.mark.parametrize("space", ["space: scanner-xyz", "space: 3D-right-handed", "space dimension: 3", ""])
def test_other_spaces_stay_unknown(tmp_path: Path, space: str) -> None:
    geometry = f"{space}\nspace directions: (2,0,0) (0,3,0) (0,0,4)\nspace origin: (1,2,3)"
    info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, geometry), ARRAY.tobytes()))
    assert (info.space, info.length_unit, info.orientation) == (None, None, None)
    assert (info.spacing, info.origin) == ((2, 3, 4), (1, 2, 3))


def test_left_handed_and_unheard_of_spaces_are_told(tmp_path: Path) -> None:
    for space, word in (("3D-left-handed", "mirrored"), ("banana", "banana")):
        info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, f"space: {space}"), ARRAY.tobytes()))
        assert any(word in w for w in info.warnings)
        assert info.space is None


@pytest.mark.parametrize(
    ("unit", "name", "factor"),
    [("um", "µm", 1e-3), ("µm", "µm", 1e-3), ("m", "m", 1e3), ("cm", "cm", 10), ("nm", "nm", 1e-6)],
)
def test_units(tmp_path: Path, unit: str, name: str, factor: float) -> None:
    more = f"""space dimension: 3
        space directions: (2,0,0) (0,3,0) (0,0,4)
        space origin: (1,2,3)
        space units: "{unit}" "{unit}" "{unit}" """
    info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, more), ARRAY.tobytes()))
    np.testing.assert_allclose(info.spacing, np.array([2, 3, 4]) * factor)
    np.testing.assert_allclose(info.origin, np.array([1, 2, 3]) * factor)
    assert info.length_unit == name
    more = f'spacings: 2 3 4\nunits: "{unit}" "{unit}" "{unit}"'
    info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, more), ARRAY.tobytes()))
    np.testing.assert_allclose(info.spacing, np.array([2, 3, 4]) * factor)


def test_spacings_that_say_nothing(tmp_path: Path) -> None:
    info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, "spacings: nan 0 -2"), ARRAY.tobytes()))
    np.testing.assert_allclose(np.diag(info.affine), [1, 1, -2, 1])
    assert len(info.warnings) == 2


def test_axis_mins_and_maxs(tmp_path: Path) -> None:
    more = "axis mins: 0 10 0\naxis maxs: 6 20 3\ncenterings: cell cell node"
    info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, more), ARRAY.tobytes()))
    np.testing.assert_allclose(info.spacing, (1, 2, 1))
    np.testing.assert_allclose(info.origin, (0.5, 11, 0))


@pytest.mark.parametrize(
    "directions",
    [
        "(1,0,0) (0,1,0) (0,0,nan)",
        "(1,0,0) (2,0,0) (0,0,1)",
        "(1,0,0) (0,1,0) (0,0,0)",
        "(1e300,0,0) (0,1,0) (0,0,1)",
        "(inf,0,0) (0,1,0) (0,0,1)",
    ],
)
def test_singular_directions_give_spacing_1_and_a_warning(tmp_path: Path, directions: str) -> None:
    more = f"space: LPS\nspace directions: {directions}\nspace origin: (nan,0,0)"
    volume = load(write(tmp_path / "a.nrrd", simple(ARRAY, more), ARRAY.tobytes()))
    np.testing.assert_array_equal(volume.affine, np.eye(4))
    assert any("space directions" in w for w in volume.info.warnings)
    assert any("origin" in w for w in volume.info.warnings)


def test_extreme_spacings_are_kept(tmp_path: Path) -> None:
    for step in (1e-30, 1e30):
        more = f"spacings: {step} {step} {step}"
        info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, more), ARRAY.tobytes()))
        np.testing.assert_allclose(info.spacing, [step] * 3)
        assert info.warnings == ()


FOUR = np.random.default_rng(5).integers(0, 200, (3, 4, 5, 6)).astype("u1")
FIVE = np.random.default_rng(6).integers(0, 200, (2, 4, 5, 6, 3)).astype("u1")
VECTORS = "(2,0,0) (0,3,0) (0,0,4)"


@pytest.mark.parametrize("encoding", ["raw", "gzip", "hex"])
@pytest.mark.parametrize("kinds", ["domain domain domain time", "", "domain domain domain list"])
def test_last_axis_of_times_or_channels(tmp_path: Path, encoding: str, kinds: str) -> None:
    pack = {"raw": bytes, "gzip": gzip.compress, "hex": lambda b: b.hex().encode()}[encoding]
    more = f"space: LPS\nspace directions: {VECTORS} none" + (f"\nkinds: {kinds}" if kinds else "")
    path = write(tmp_path / "a.nrrd", simple(FOUR, more, encoding), pack(FOUR.tobytes()))
    what = "channel" if kinds.endswith("list") else "time"
    for k in range(3):
        volume = load(path, **{what: k})
        np.testing.assert_array_equal(volume.data, FOUR[k])
        assert volume.spacing == (2, 3, 4)
        assert getattr(volume.info, what + "s") == 3
        assert getattr(volume.info, what) == k
        assert any(f"--{what}" in w for w in volume.info.warnings)
    with pytest.raises(UsageError, match="choose 0 to 2"):
        load(path, **{what: 3})
    with pytest.raises(UsageError, match="choose 0 to 2"):
        load(path, **{what: -1})


@pytest.mark.parametrize("kind", ["vector", "RGB-color", "list", "???"])
def test_first_axis_of_channels(tmp_path: Path, kind: str) -> None:
    array = np.ascontiguousarray(np.moveaxis(FOUR, 0, -1))
    more = f"space: RAS\nspace directions: none {VECTORS}\nkinds: {kind} domain domain domain"
    path = write(tmp_path / "a.nrrd", simple(array, more), array.tobytes())
    for k in range(3):
        volume = load(path, channel=k)
        np.testing.assert_array_equal(volume.data, FOUR[k])
        np.testing.assert_allclose(np.diag(volume.affine), [-2, -3, 4, 1])
        assert (volume.info.channels, volume.info.times) == (3, 1)


def test_kinds_alone_and_nan_spacings_tell_channels(tmp_path: Path) -> None:
    array = np.ascontiguousarray(np.moveaxis(FOUR, 0, -1))
    for more in ("kinds: 3-color domain domain domain", "spacings: nan 2 3 4"):
        path = write(tmp_path / "a.nrrd", simple(array, more), array.tobytes())
        np.testing.assert_array_equal(load(path, channel=1).data, FOUR[1])
    path = write(tmp_path / "b.nrrd", simple(FOUR), FOUR.tobytes())
    np.testing.assert_array_equal(load(path, time=2).data, FOUR[2])


def test_five_axes_have_channels_and_times(tmp_path: Path) -> None:
    more = f"space: LPS\nspace directions: none {VECTORS} none\nkinds: vector space space space time"
    path = write(tmp_path / "a.nrrd", simple(FIVE, more), FIVE.tobytes())
    for time, channel in itertools.product(range(2), range(3)):
        volume = load(path, time=time, channel=channel)
        np.testing.assert_array_equal(volume.data, FIVE[time, ..., channel])


def test_two_lists_are_channels_then_times(tmp_path: Path) -> None:
    array = np.ascontiguousarray(np.moveaxis(FIVE, -1, 1))
    more = f"space: LPS\nspace directions: {VECTORS} none none\nkinds: space space space list list"
    path = write(tmp_path / "a.nrrd", simple(array, more), array.tobytes())
    np.testing.assert_array_equal(load(path, time=1, channel=2).data, FIVE[1, ..., 2])


def test_too_many_axes(tmp_path: Path) -> None:
    header = "type: uchar\ndimension: 6\nsizes: 2 2 2 2 2 2\nencoding: raw"
    with pytest.raises(UnsupportedError, match="6 axes"):
        load(write(tmp_path / "a.nrrd", header, bytes(64)))
    header = simple(np.zeros((2, 2, 2, 2, 2), "u1"), "kinds: list time time space space")
    with pytest.raises(UnsupportedError, match="more than one axis"):
        load(write(tmp_path / "a.nrrd", header, bytes(32)))


@pytest.mark.parametrize(
    ("shape", "more", "dims"),
    [
        ((5, 6), "", (6, 5, 1)),
        ((6,), "spacings: 0.5", (6, 1, 1)),
        ((5, 6), "space dimension: 3\nspace directions: (0,2,0) (0,0,3)", (6, 5, 1)),
        ((5, 6), "space dimension: 2\nspace directions: (2,0) (0,3)\nspace origin: (4,5)", (6, 5, 1)),
        ((6,), "space dimension: 3\nspace directions: (0,2,0)", (6, 1, 1)),
        ((5, 6, 1), "kinds: scalar domain domain", (6, 5, 1)),
    ],
)
def test_fewer_dimensions_are_one_sample_thick(
    tmp_path: Path, shape: tuple[int, ...], more: str, dims: tuple[int, int, int]
) -> None:
    array = np.arange(np.prod(shape), dtype="u1").reshape(shape)
    volume = load(write(tmp_path / "a.nrrd", simple(array, more), array.tobytes()))
    assert volume.dims == dims
    np.testing.assert_array_equal(volume.data.ravel(), array.ravel())
    assert any("one sample thick" in w for w in volume.info.warnings)
    assert abs(np.linalg.det(volume.affine)) > 0


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
