"""Folders of pictures against Pillow."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import numpy as np
import pytest
import tifffile
from PIL import Image

from volviz.errors import Cancelled, InputError, LimitError, UnsupportedError
from volviz.io import Limits, load, probe
from volviz.io.naming import natural_key, numbering_gaps
from volviz.progress import Progress


def slices(folder: Path, count: int = 5, *, suffix: str = ".png", dtype: str = "u1") -> np.ndarray:
    folder.mkdir(exist_ok=True)
    values = np.random.default_rng(count).integers(0, 250, (count, 6, 9)).astype(dtype)
    if dtype == "u2":
        values *= 200
    for k, plane in enumerate(values):
        Image.fromarray(plane).save(folder / f"s{k}{suffix}")
    return values


@pytest.mark.parametrize("part", ["image", "label"])
def test_real_stack_equals_pillow(data: Path, part: str) -> None:
    folder = data / "microscopy" / "em_isbi_png" / part
    expected = np.stack([np.asarray(Image.open(p)) for p in sorted(folder.iterdir())])
    volume = load(folder)
    np.testing.assert_array_equal(volume.data, expected)
    assert (volume.info.space, volume.info.length_unit) == (None, None)
    assert probe(folder).dims == volume.dims


def test_parent_of_slice_folders_names_them(data: Path) -> None:
    with pytest.raises(InputError, match=r"image, label"):
        load(data / "microscopy" / "em_isbi_png")


@pytest.mark.parametrize("suffix", [".png", ".bmp", ".tif"])
def test_lossless_kinds(tmp_path: Path, suffix: str) -> None:
    values = slices(tmp_path / "s", suffix=suffix)
    np.testing.assert_array_equal(load(tmp_path / "s").data, values)


def test_sixteen_bits_stay(tmp_path: Path) -> None:
    values = slices(tmp_path / "s", dtype="u2")
    volume = load(tmp_path / "s")
    assert volume.data.dtype == np.uint16
    np.testing.assert_array_equal(volume.data, values)


def test_jpeg(tmp_path: Path) -> None:
    slices(tmp_path / "s", suffix=".jpg")
    expected = [np.asarray(Image.open(p)) for p in sorted((tmp_path / "s").iterdir())]
    np.testing.assert_array_equal(load(tmp_path / "s").data, expected)


def test_natural_order(tmp_path: Path) -> None:
    values = slices(tmp_path / "s", 12)
    np.testing.assert_array_equal(load(tmp_path / "s").data, values)
    names = ["b2.png", "B10.png", "b1.png", "a.png", "b02x.png"]
    assert sorted(names, key=natural_key) == ["a.png", "b1.png", "b2.png", "b02x.png", "B10.png"]


def test_gaps_in_numbers_are_told(tmp_path: Path) -> None:
    values = slices(tmp_path / "s", 12)
    (tmp_path / "s" / "s4.png").unlink()
    volume = load(tmp_path / "s")
    np.testing.assert_array_equal(volume.data, np.delete(values, 4, axis=0))
    assert any("1 numbers are missing" in w and "(4)" in w for w in volume.info.warnings)


def test_numbering() -> None:
    assert numbering_gaps([f"a1b{n}" for n in (3, 5, 6, 7, 8, 11)]) == [4, 9, 10]
    assert numbering_gaps(["x0", "x10", "x20", "x30"]) == []
    assert numbering_gaps(["p1_q1", "p2_q2", "p3_q4"]) == []
    assert numbering_gaps(["a", "b", "c"]) == []


def test_colour_becomes_luminance(tmp_path: Path) -> None:
    rgb = np.random.default_rng(0).integers(0, 256, (3, 6, 9, 3), dtype=np.uint8)
    for k, plane in enumerate(rgb):
        Image.fromarray(plane).save(tmp_path / f"{k}.png")
    volume = load(tmp_path)
    np.testing.assert_array_equal(volume.data, np.rint(rgb @ [0.2126, 0.7152, 0.0722]))
    assert volume.data.dtype == np.uint8
    assert any("luminance" in w for w in volume.info.warnings)


@pytest.mark.parametrize("mode", ["P", "RGBA", "LA", "1"])
def test_other_modes(tmp_path: Path, mode: str) -> None:
    grey = np.arange(54, dtype=np.uint8).reshape(6, 9) * 4
    image = Image.fromarray(np.stack([grey] * 3, -1)).convert("L").convert("RGB")
    path = tmp_path / "a.png"
    image.convert("L").convert(mode).save(path)
    volume = load(path)
    assert volume.dims == (9, 6, 1)
    expected = (grey > 127).astype("u1") if mode == "1" else grey
    if mode != "1":  # Pillow dithers
        np.testing.assert_array_equal(volume.data[0], expected)
    assert any("one sample thick" in w for w in volume.info.warnings)


def test_first_offender_is_named(tmp_path: Path) -> None:
    slices(tmp_path / "s", 5)
    Image.fromarray(np.zeros((7, 9), "u1")).save(tmp_path / "s" / "s2.png")
    Image.fromarray(np.zeros((8, 8), "u1")).save(tmp_path / "s" / "s3.png")
    with pytest.raises(InputError, match=r"s2\.png: this slice is 9 × 7 L, the first .* 9 × 6 L"):
        load(tmp_path / "s")
    Image.fromarray(np.zeros((6, 9, 3), "u1")).save(tmp_path / "s" / "s2.png")
    with pytest.raises(InputError, match=r"s2\.png: .*RGB"):
        load(tmp_path / "s")


def test_tiff_slices_with_a_pixel_size(tmp_path: Path) -> None:
    values = np.arange(3 * 20, dtype="u2").reshape(3, 4, 5)
    for k, plane in enumerate(values):
        tifffile.imwrite(
            tmp_path / f"{k}.tif", plane, imagej=True, resolution=(2, 2), metadata={"unit": "um"}
        )
    volume = load(tmp_path)
    np.testing.assert_array_equal(volume.data, values)
    np.testing.assert_allclose(volume.spacing, (0.5e-3, 0.5e-3, 0.5e-3))
    assert any("spacing along z unknown" in w for w in volume.info.warnings)


def test_folder_of_stacks(tmp_path: Path) -> None:
    tifffile.imwrite(tmp_path / "a.tif", np.zeros((5, 8, 8), "u1"), photometric="minisblack")
    with pytest.raises(InputError, match=r"a\.tif: 5 planes"):
        load(tmp_path)


def test_hidden_and_other_files_are_left_alone(tmp_path: Path) -> None:
    values = slices(tmp_path / "s", 3)
    (tmp_path / "s" / "._s1.png").write_bytes(b"\0\5\x16\7")
    (tmp_path / "s" / "notes.txt").write_text("x")
    np.testing.assert_array_equal(load(tmp_path / "s").data, values)


def test_animation_and_cmyk(tmp_path: Path) -> None:
    frames = [Image.fromarray(np.full((5, 5), v, "u1")) for v in (1, 2, 3)]
    frames[0].save(tmp_path / "a.png", save_all=True, append_images=frames[1:])
    with pytest.raises(UnsupportedError, match="animation of 3 frames"):
        load(tmp_path / "a.png")
    Image.new("CMYK", (5, 5)).save(tmp_path / "c.jpg")
    with pytest.raises(UnsupportedError, match="CMYK"):
        load(tmp_path / "c.jpg")


def chunk(kind: bytes, body: bytes) -> bytes:
    return struct.pack(">I", len(body)) + kind + body + struct.pack(">I", zlib.crc32(kind + body))


def png(width: int, height: int) -> bytes:
    ihdr = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    return (
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", ihdr)
        + chunk(b"IDAT", zlib.compress(b"\0" * 100))
        + chunk(b"IEND", b"")
    )


def test_giant_pictures(tmp_path: Path) -> None:
    path = tmp_path / "big.png"
    path.write_bytes(png(20_000, 15_000))
    with pytest.raises(LimitError) as caught:
        load(path)
    assert caught.value.exit_code == 6
    path.write_bytes(png(3000, 3000))
    with pytest.raises(LimitError):
        load(path, limits=Limits(max_bytes=1 << 20))


def test_truncated(tmp_path: Path) -> None:
    slices(tmp_path / "s", 3)
    path = tmp_path / "s" / "s1.png"
    path.write_bytes(path.read_bytes()[:-30])
    with pytest.raises(InputError, match=r"s1\.png"):
        load(tmp_path / "s")


def test_cancel(tmp_path: Path) -> None:
    slices(tmp_path / "s", 9)
    progress = Progress(lambda f, m: progress.cancel() if "slice 4" in m else None)
    with pytest.raises(Cancelled):
        load(tmp_path / "s", progress=progress)
