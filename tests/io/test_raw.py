"""RAW files: names, flags, descriptors, and the layouts that are suggested."""

from __future__ import annotations

import gzip
import json
from pathlib import Path

import nrrd
import numpy as np
import pytest

from volviz.errors import InputError, LimitError, UsageError
from volviz.io import Limits, load, probe
from volviz.io.raw_layout import fitting_layouts, layout_from_name


def grid(x: int, y: int, z: int, dtype: str = "u1") -> np.ndarray:
    return np.arange(x * y * z, dtype=np.int64).reshape(z, y, x).astype(dtype)


@pytest.mark.parametrize("name", ["neghip_66x66x66_uint8.raw", "neghip.dat", "neghip.json"])
def test_neghip(data: Path, name: str) -> None:
    folder = data / "simulation"
    expected = np.fromfile(folder / "neghip_66x66x66_uint8.raw", "u1").reshape(66, 66, 66)
    volume = load(folder / name)
    np.testing.assert_array_equal(volume.data, expected)
    assert volume.spacing == (1, 1, 1)
    assert probe(folder / name).dims == (66, 66, 66)


def test_ball(data: Path) -> None:
    path = data / "formats" / "nrrd" / "BallBinary30x30x30.raw"
    expected, _ = nrrd.read(str(path.with_suffix(".nhdr")), index_order="C")
    volume = load(path)
    np.testing.assert_array_equal(volume.data, expected)
    text = " ".join(volume.info.warnings)
    assert "uint16 is assumed" in text
    assert "describes this file" in text
    np.testing.assert_array_equal(load(path, dtype="int16").data, expected)


@pytest.mark.parametrize("name", ["simulation/nucleon.raw", "formats/tooth.raw"])
def test_voxels_of_a_header_say_which(data: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"these are the voxels of .*open ") as caught:
        load(data / name)
    assert caught.value.exit_code == 3


def test_no_shape_at_all(data: Path, tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"--shape X,Y,Z"):
        load(data / "structured" / "comb_q.bin")
    path = tmp_path / "what.raw"
    path.write_bytes(bytes(64**3))
    with pytest.raises(UsageError, match="64x64x64 uint8"):
        load(path)


@pytest.mark.parametrize(
    ("name", "dims", "dtype", "endian"),
    [
        ("foot_256x256x256_uint8.raw", (256, 256, 256), "u1", None),
        ("BallBinary30x30x30.raw", (30, 30, 30), None, None),
        ("head_256X128x64_u8.raw", (256, 128, 64), "u1", None),
        ("a_10x20x30_ushort_be.raw", (10, 20, 30), "u2", "big"),
        ("a-10x20x30-int16-le.raw", (10, 20, 30), "i2", "little"),
        ("a_float_10x20x30.raw", (10, 20, 30), "f4", None),
        ("a_float32_10x20x30_bigendian.raw", (10, 20, 30), "f4", "big"),
        ("a_unsigned_short_10x20x30.raw", (10, 20, 30), "u2", None),
        ("a_10x20x30_16bit.raw", (10, 20, 30), "u2", None),
        ("a_10x20x30_8bits.raw", (10, 20, 30), "u1", None),
        ("double_10x20x30.bin", (10, 20, 30), "f8", None),
        ("real.raw", None, None, None),
        ("beetle_832x832x494_uint16.raw", (832, 832, 494), "u2", None),
        ("a_0x20x30.raw", None, None, None),
        ("vis_male_128x256x256_uint8.raw", (128, 256, 256), "u1", None),
    ],
)
def test_names(name: str, dims, dtype: str | None, endian: str | None) -> None:
    found = layout_from_name(name)
    assert found.dims == dims
    assert found.dtype == (None if dtype is None else np.dtype(dtype))
    assert found.endian == endian


@pytest.mark.parametrize("dtype", ["uint8", "i2", "uint16", "int32", "float", "double"])
@pytest.mark.parametrize("endian", ["little", "big"])
@pytest.mark.parametrize("packed", [False, True])
def test_flags(tmp_path: Path, dtype: str, endian: str, packed: bool) -> None:
    code = {"uint8": "u1", "i2": "i2", "uint16": "u2", "int32": "i4", "float": "f4", "double": "f8"}
    order = "<" if endian == "little" else ">"
    values = grid(7, 5, 3, order + code[dtype])
    content = b"head" + values.tobytes()
    path = tmp_path / ("a.raw.gz" if packed else "a.raw")
    path.write_bytes(gzip.compress(content) if packed else content)
    name = "int16" if dtype == "i2" else dtype
    volume = load(path, shape=(7, 5, 3), dtype=name, endian=endian, offset=4, spacing=(1, 2, 0.5))
    np.testing.assert_array_equal(volume.data, values)
    assert (volume.spacing, volume.info.length_unit) == ((1, 2, 0.5), "mm")


def test_gzip_with_a_name(tmp_path: Path) -> None:
    values = grid(7, 5, 3, "f4")
    path = tmp_path / "a_7x5x3.raw.gz"
    path.write_bytes(gzip.compress(values.tobytes()))
    np.testing.assert_array_equal(load(path).data, values)
    path.write_bytes(gzip.compress(values.tobytes()[:-8]))
    with pytest.raises(InputError, match="do not fit 7x5x3"):
        load(path)


@pytest.mark.parametrize(
    ("nbytes", "choices", "error", "hint"),
    [
        (
            256 * 256 * 128,
            {"shape": (256, 256, 128), "dtype": "uint16"},
            UsageError,
            "256x256x128 uint8",
        ),
        (64**3 * 2, {"shape": (64, 64, 32), "dtype": "uint16"}, UsageError, "64x64x64 uint16"),
        (64**3 + 352, {"shape": (64, 64, 64), "dtype": "uint8"}, UsageError, "--offset 352"),
        (64**3 * 4, {"shape": (64, 64, 64), "dtype": "uint16"}, UsageError, "64x64x64 uint32"),
        (1009, {"shape": (64, 64, 64), "dtype": "uint16"}, UsageError, "--shape"),
    ],
)
def test_misfits_suggest_what_fits(tmp_path: Path, nbytes: int, choices, error, hint: str) -> None:
    path = tmp_path / "a.raw"
    path.write_bytes(bytes(nbytes))
    with pytest.raises(error) as caught:
        load(path, **choices)
    assert hint in str(caught.value)
    assert caught.value.exit_code == 2


def test_misfit_of_a_name_is_the_files_fault(tmp_path: Path) -> None:
    path = tmp_path / "a_64x64x64_uint16.raw"
    path.write_bytes(bytes(64**3))
    with pytest.raises(InputError, match=r"64x64x64 uint8") as caught:
        load(path)
    assert caught.value.exit_code == 3


def test_suggestions_are_few_and_exact() -> None:
    for nbytes in (64**3, 256**3 * 2, 1000, 512 * 512 * 100 * 2):
        found = fitting_layouts(nbytes, None, None)
        assert len(found) <= 5
        for text in found:
            dims, name = text.split()
            assert np.prod([int(n) for n in dims.split("x")]) * np.dtype(name).itemsize == nbytes


@pytest.mark.parametrize(
    "choices",
    [
        {"shape": (0, 4, 4)},
        {"shape": (4, 4)},
        {"shape": (4, 4, 4), "dtype": "uint9"},
        {"shape": (4, 4, 4), "dtype": "uint8", "endian": "middle"},
        {"shape": (4, 4, 4), "dtype": "uint8", "offset": -3},
        {"shape": (4, 4, 4), "dtype": "uint8", "time": 1},
    ],
)
def test_wrong_flags(tmp_path: Path, choices) -> None:
    path = tmp_path / "a.raw"
    path.write_bytes(bytes(64))
    with pytest.raises(UsageError):
        load(path, **choices)


def test_unknown_type_gets_a_proposal(tmp_path: Path) -> None:
    path = tmp_path / "a.raw"
    path.write_bytes(bytes(64))
    with pytest.raises(UsageError, match="did you mean 'uint16'"):
        load(path, shape=(4, 4, 2), dtype="unit16")


def test_limit_before_allocation(tmp_path: Path) -> None:
    path = tmp_path / "a.raw"
    path.write_bytes(bytes(64))
    with pytest.raises(LimitError):
        load(path, shape=(4, 4, 4), dtype="uint8", limits=Limits(max_bytes=63))


def describe(tmp_path: Path, text: str, values: np.ndarray, name: str = "v.raw") -> Path:
    (tmp_path / name).write_bytes(values.tobytes())
    path = tmp_path / "v.dat"
    path.write_text(text)
    return path


def test_voreen_descriptor(tmp_path: Path) -> None:
    text = (
        "ObjectFileName: v.raw\nTaggedFileName: ---\nResolution: 7 5 3\nSliceThickness: 1 2 3\n"
        "Format: USHORT\nNbrTags: 0\nObjectType: TEXTURE_VOLUME_OBJECT\nObjectModel: I\n"
        "GridType: EQUIDISTANT\n"
    )
    values = grid(7, 5, 3, "<u2")
    volume = load(describe(tmp_path, text, values))
    np.testing.assert_array_equal(volume.data, values)
    assert volume.spacing == (1, 2, 3)
    assert volume.info.fields["gridtype"] == "EQUIDISTANT"


def test_inviwo_basis(tmp_path: Path) -> None:
    text = (
        "RawFile: v.raw\nResolution: 4 5 2\nFormat: FLOAT32\nByteOffset: 0\n"
        "BasisVector1: 8 0 0\nBasisVector2: 0 5 0\nBasisVector3: 0 0 6\nOffset: -4 -2.5 -3\n"
    )
    volume = load(describe(tmp_path, text, grid(4, 5, 2, "<f4")))
    assert volume.spacing == (2, 1, 3)
    np.testing.assert_allclose(volume.info.origin, (-3, -2, -1.5))


def test_json_descriptor_with_offset_and_order(tmp_path: Path) -> None:
    values = grid(4, 5, 2, ">i2")
    (tmp_path / "v.raw").write_bytes(b"xyz" + values.tobytes())
    path = tmp_path / "v.json"
    path.write_text(
        json.dumps(
            {
                "file": "v.raw",
                "dims": [4, 5, 2],
                "dtype": "int16",
                "byteorder": "big",
                "offset": 3,
                "spacing": [0.5, 1, 2],
                "origin": [1, 2, 3],
            }
        )
    )
    volume = load(path)
    np.testing.assert_array_equal(volume.data, values)
    assert (volume.spacing, volume.info.origin) == ((0.5, 1, 2), (1, 2, 3))


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("RawFile: v.raw\nResolution: 7 5\nFormat: UINT8\n", "resolution"),
        ("RawFile: v.raw\nResolution: 7 5 -3\nFormat: UINT8\n", "Resolution"),
        ("RawFile: v.raw\nResolution: 7 5 nan\nFormat: UINT8\n", "resolution"),
        ("RawFile: v.raw\nFormat: UINT8\n", "Resolution"),
        ("RawFile: v.raw\nResolution: 7 5 3\nFormat: UINT9\n", "Format"),
        ("RawFile: v.raw\nResolution: 7 5 3\nFormat: UINT8\nByteOffset: x\n", "ByteOffset"),
        ("RawFile: v.raw\nResolution: 7 5 3\nFormat: UINT8\nByteOrder: pdp\n", "ByteOrder"),
        ("RawFile: v.raw\nResolution: 7 5 3\nFormat: UINT8\nObjectModel: RGBA\n", "ObjectModel"),
        ("RawFile: gone.raw\nResolution: 7 5 3\nFormat: UINT8\n", "RawFile"),
        ("RawFile:\nResolution: 7 5 3\nFormat: UINT8\n", "RawFile"),
        ("RawFile: v.raw\nResolution: 7 5 4\nFormat: UINT8\n", "file name"),
    ],
)
def test_wrong_descriptors(tmp_path: Path, text: str, field: str) -> None:
    from volviz.errors import VolvizError

    path = describe(tmp_path, text, grid(7, 5, 3))
    with pytest.raises(VolvizError) as caught:
        load(path)
    assert caught.value.field == field
    assert caught.value.exit_code in (3, 4)
