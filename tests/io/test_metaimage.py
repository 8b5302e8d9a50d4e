from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
import pytest
import SimpleITK as sitk

from tests.io.oracle import corners, places, same_as_simpleitk
from volviz.errors import InputError, UnsupportedError, UsageError
from volviz.io import load, probe

ARRAY = (np.arange(4 * 5 * 6).reshape(4, 5, 6) % 120).astype("<i2")
TYPES = ["i1", "u1", "i2", "u2", "i4", "u4", "i8", "u8", "f4", "f8"]


def header(
    lines: str = "", *, size: str = "6 5 4", kind: str = "MET_SHORT", data: str = "LOCAL"
) -> bytes:
    """A header by hand."""
    count = len(size.split())
    more = "\n".join(line.strip() for line in lines.strip().splitlines() if line.strip())
    text = f"ObjectType = Image\nNDims = {count}\nDimSize = {size}\nElementType = {kind}\n"
    return (text + more + ("\n" if more else "") + f"ElementDataFile = {data}\n").encode()


def image(array: np.ndarray, **options: bool) -> sitk.Image:
    """An ITK image with a geometry that gives a mistake away."""
    made = sitk.GetImageFromArray(array, **options)
    count = made.GetDimension()
    made.SetSpacing((0.5, 0.7, 2.0, 1.5)[:count])
    made.SetOrigin((10.0, -20.0, 30.0, 0.0)[:count])
    if count == 3:
        made.SetDirection((0, 0, 1, 1, 0, 0, 0, 1, 0))
    return made


def test_real_file_with_a_wrong_compressed_size(data: Path) -> None:
    """ITK stops at CompressedDataSize, 2067 bytes early, and leaves the last slices unfilled."""
    path = data / "formats/frogtissue.mhd"
    volume = load(path)
    plain = zlib.decompress((data / "formats/frogtissue.zraw").read_bytes())
    np.testing.assert_array_equal(volume.data, np.frombuffer(plain, "u1").reshape(136, 470, 500))
    made = sitk.ReadImage(str(path))
    np.testing.assert_array_equal(volume.data[:130], sitk.GetArrayFromImage(made)[:130])
    expected = [made.TransformIndexToPhysicalPoint(c) for c in corners(volume.dims)]
    np.testing.assert_allclose(places(volume), expected)
    info = probe(path)
    assert (info.format, info.encoding, info.stored_bytes) == ("MetaImage", "zlib", 262087)
    assert (info.dims, info.dtype) == (volume.dims, volume.data.dtype)
    assert any("CompressedDataSize" in w for w in info.warnings)


@pytest.mark.parametrize("name", ["a.mha", "a.mhd"])
@pytest.mark.parametrize("packed", [False, True])
@pytest.mark.parametrize("dtype", TYPES)
def test_every_type_as_itk_writes_it(tmp_path: Path, name: str, packed: bool, dtype: str) -> None:
    path = tmp_path / name
    sitk.WriteImage(image(ARRAY.astype(dtype)), str(path), packed)
    volume = load(path)
    same_as_simpleitk(volume, path)
    assert volume.data.dtype == np.dtype(dtype)
    assert (volume.info.space, volume.info.length_unit) == ("LPS", "mm")
    assert volume.info.encoding == ("zlib" if packed else "raw")


def test_oblique_direction(tmp_path: Path) -> None:
    path = tmp_path / "a.mha"
    made = image(ARRAY)
    turn = sitk.Euler3DTransform((0, 0, 0), 0.3, -0.5, 1.1)
    made.SetDirection(turn.GetMatrix())
    sitk.WriteImage(made, str(path))
    volume = load(path)
    same_as_simpleitk(volume, path)
    assert volume.info.oblique


def test_long_has_32_bits(tmp_path: Path) -> None:
    for kind, dtype in (("MET_LONG", "<i4"), ("MET_ULONG", "<u4"), ("MET_LONG_LONG", "<i8")):
        path = tmp_path / "a.mha"
        path.write_bytes(header(kind=kind) + ARRAY.astype(dtype).tobytes())
        volume = load(path)
        same_as_simpleitk(volume, path)
        assert volume.data.dtype == np.dtype(dtype)


@pytest.mark.parametrize("key", ["BinaryDataByteOrderMSB", "ElementByteOrderMSB"])
def test_big_endian(tmp_path: Path, key: str) -> None:
    path = tmp_path / "a.mha"
    path.write_bytes(header(f"{key} = True") + ARRAY.astype(">i2").tobytes())
    same_as_simpleitk(load(path), path)


def test_ascii(tmp_path: Path) -> None:
    path = tmp_path / "a.mha"
    text = " ".join(map(str, ARRAY.ravel())).encode()
    path.write_bytes(header("BinaryData = False") + text)
    np.testing.assert_array_equal(load(path).data, ARRAY)


@pytest.mark.parametrize("size", [None, 4, 10**6])
def test_zlib_with_any_statement_of_its_size(tmp_path: Path, size: int | None) -> None:
    path = tmp_path / "a.mha"
    stated = "" if size is None else f"CompressedDataSize = {size}"
    payload = zlib.compress(ARRAY.tobytes())
    path.write_bytes(header(f"CompressedData = True\n{stated}") + payload)
    np.testing.assert_array_equal(load(path).data, ARRAY)


@pytest.mark.parametrize("packed", [False, True])
def test_list_of_files(tmp_path: Path, packed: bool) -> None:
    for k, part in enumerate(ARRAY):
        raw = part.tobytes()
        (tmp_path / f"part {k}.x").write_bytes(zlib.compress(raw) if packed else raw)
    names = "\n".join(f"part {k}.x" for k in range(4))
    path = tmp_path / "a.mhd"
    more = "CompressedData = True" if packed else ""
    for depth in ("", " 2", " 2D"):
        path.write_bytes(header(more, data=f"LIST{depth}\n{names}"))
        np.testing.assert_array_equal(load(path).data, ARRAY)
    if not packed:
        same_as_simpleitk(load(path), path)


@pytest.mark.parametrize(
    ("rest", "numbers"), [("3 9 2", (3, 5, 7, 9)), ("1 4", (1, 2, 3, 4)), ("0", range(4))]
)
def test_pattern_of_files(tmp_path: Path, rest: str, numbers: tuple[int, ...]) -> None:
    for number, part in zip(numbers, ARRAY, strict=True):
        (tmp_path / f"s{number:03d}.raw").write_bytes(part.tobytes())
    path = tmp_path / "a.mhd"
    path.write_bytes(header(data=f"s%03d.raw {rest}"))
    np.testing.assert_array_equal(load(path).data, ARRAY)
    if len(rest.split()) > 2:
        same_as_simpleitk(load(path), path)


@pytest.mark.parametrize("skip", [7, -1])
def test_header_size(tmp_path: Path, skip: int) -> None:
    (tmp_path / "a.raw").write_bytes(b"7 bytes" + ARRAY.tobytes())
    path = tmp_path / "a.mhd"
    path.write_bytes(header(f"HeaderSize = {skip}", data="a.raw"))
    same_as_simpleitk(load(path), path)


@pytest.mark.parametrize("packed", [False, True])
def test_channels(tmp_path: Path, packed: bool) -> None:
    array = np.random.default_rng(4).integers(0, 250, (4, 5, 6, 3)).astype("u1")
    path = tmp_path / "a.mha"
    sitk.WriteImage(image(array, isVector=True), str(path), packed)
    for k in range(3):
        volume = load(path, channel=k)
        np.testing.assert_array_equal(volume.data, array[..., k])
        assert (volume.info.channels, volume.info.channel) == (3, k)
    with pytest.raises(UsageError, match="choose 0 to 2"):
        load(path, channel=3)


@pytest.mark.parametrize("packed", [False, True])
def test_times(tmp_path: Path, packed: bool) -> None:
    array = np.random.default_rng(4).integers(0, 250, (3, 4, 5, 6)).astype("<u2")
    path = tmp_path / "a.mha"
    sitk.WriteImage(image(array, isVector=False), str(path), packed)
    for k in range(3):
        volume = load(path, time=k)
        np.testing.assert_array_equal(volume.data, array[k])
        assert (volume.info.times, volume.info.time) == (3, k)
        np.testing.assert_allclose(volume.spacing, (0.5, 0.7, 2.0))
        np.testing.assert_allclose(volume.info.origin, (10, -20, 30))


def test_two_dimensions_are_one_slice(tmp_path: Path) -> None:
    path = tmp_path / "a.mha"
    sitk.WriteImage(image(ARRAY[0]), str(path))
    volume = load(path)
    np.testing.assert_array_equal(volume.data[0], ARRAY[0])
    assert volume.dims == (6, 5, 1)
    assert any("one sample thick" in w for w in volume.info.warnings)


@pytest.mark.parametrize("turn", ["TransformMatrix", "Rotation", "Orientation"])
@pytest.mark.parametrize("place", ["Offset", "Position", "Origin"])
def test_synonyms_and_the_row_of_an_axis(tmp_path: Path, turn: str, place: str) -> None:
    path = tmp_path / "a.mha"
    more = f"{turn} = 0 1 0 0 0 1 1 0 0\n{place} = 1 2 3\nElementSize = 2 3 4"
    path.write_bytes(header(more) + ARRAY.tobytes())
    volume = load(path)
    same_as_simpleitk(volume, path)
    np.testing.assert_array_equal(volume.affine @ (1, 0, 0, 1), [1, 4, 3, 1])


@pytest.mark.parametrize(
    ("more", "space"),
    [
        ("ElementSpacing = 1 2 3", None),
        ("AnatomicalOrientation = ???", None),
        ("AnatomicalOrientation = RAI", "LPS"),
        ("Modality = MET_MOD_CT", "LPS"),
        ("TransformMatrix = 1 0 0 0 1 0 0 0 1", "LPS"),
    ],
)
def test_when_the_space_is_known(tmp_path: Path, more: str, space: str | None) -> None:
    path = tmp_path / "a.mha"
    path.write_bytes(header(more) + ARRAY.tobytes())
    info = probe(path)
    assert info.space == space
    assert info.length_unit == ("mm" if space else None)
    assert info.modality == ("CT" if "CT" in more else None)
    assert info.value_unit == ("HU" if "CT" in more else None)


def test_geometry_that_cannot_be_used(tmp_path: Path) -> None:
    path = tmp_path / "a.mha"
    more = "ElementSpacing = 0 nan -2\nOffset = inf 0 0"
    path.write_bytes(header(more) + ARRAY.tobytes())
    info = probe(path)
    np.testing.assert_array_equal(info.affine, np.diag([1, 1, -2, 1]))
    assert len(info.warnings) == 3
    more = "TransformMatrix = 1 0 0 1 0 0 0 0 1"
    path.write_bytes(header(more) + ARRAY.tobytes())
    np.testing.assert_array_equal(probe(path).affine, np.eye(4))


def test_unknown_keys_crlf_and_cp1252_are_no_trouble(tmp_path: Path) -> None:
    path = tmp_path / "a.mha"
    text = header("Comment = grün\nWhatever = 3 # 4\nDistanceUnits = um\nElementSpacing = 2 2 2")
    text = text.decode().replace("\n", "\r\n").encode("cp1252")
    path.write_bytes(text + ARRAY.tobytes())
    volume = load(path)
    np.testing.assert_array_equal(volume.data, ARRAY)
    np.testing.assert_allclose(volume.spacing, [0.002] * 3)
    assert volume.info.length_unit == "µm"
    assert volume.info.fields["Comment"] == "grün"
    assert volume.info.fields["Whatever"] == "3 # 4"


def test_intensity_function_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.mha"
    path.write_bytes(header("ElementToIntensityFunctionSlope = 2.5") + ARRAY.tobytes())
    volume = load(path)
    same_as_simpleitk(volume, path)
    assert any("ElementToIntensityFunction" in w for w in volume.info.warnings)


@pytest.mark.parametrize(
    ("text", "field"),
    [
        (header().replace(b"NDims = 3", b"NDims = 11"), "NDims"),
        (header().replace(b"NDims = 3", b"NDims = x"), "NDims"),
        (header().replace(b"NDims = 3\n", b""), "NDims"),
        (header().replace(b"ElementType = MET_SHORT\n", b""), "ElementType"),
        (header(kind="MET_STRING"), "ElementType"),
        (header(size="6 5 -4"), "DimSize"),
        (header(size="6 5 0"), "DimSize"),
        (header(size="6 5 4.5"), "DimSize"),
        (header(size="6 5 4").replace(b"6 5 4", b"6 5"), "DimSize"),
        (header("Offset = 1 2"), "Offset"),
        (header("Offset = a b c"), "Offset"),
        (header("TransformMatrix = 1 0 0"), "TransformMatrix"),
        (header("HeaderSize = -2"), "HeaderSize"),
        (header("HeaderSize = 99999"), "HeaderSize"),
        (header("HeaderSize = 3"), "HeaderSize"),
        (header("ElementNumberOfChannels = 0"), "ElementNumberOfChannels"),
        (header("DimSize = 6 5 3"), "lines 3 and 5 both give 'DimSize'"),
        (header(data="LIST 7"), "ElementDataFile"),
        (header(data="LIST\na.raw"), "ElementDataFile"),
        (header(data="s%03d.raw 4 1 1"), "ElementDataFile"),
        (header(data="s%03d%s.raw 1 4 1"), "ElementDataFile"),
        (header(data="s%03d.raw 1 4 1 7"), "ElementDataFile"),
        (header(data=""), "ElementDataFile"),
        (header().replace(b"ElementDataFile = LOCAL\n", b""), "header"),
        (header("no sign here"), "header"),
    ],
)
def test_bad_headers_name_the_field(tmp_path: Path, text: bytes, field: str) -> None:
    path = tmp_path / "bad.mha"
    path.write_bytes(text + ARRAY.tobytes())
    with pytest.raises(InputError) as caught:
        load(path)
    assert str(caught.value).startswith(str(path))
    assert field in str(caught.value)
    assert caught.value.fix


def test_valid_but_not_read(tmp_path: Path) -> None:
    path = tmp_path / "a.mha"
    for text in (header(size="2 2 2 2 2"), header().replace(b"Image", b"Tube")):
        path.write_bytes(text + bytes(64))
        with pytest.raises(UnsupportedError):
            load(path)
