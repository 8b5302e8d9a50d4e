"""TIFF against tifffile, whole arrays; OME and ImageJ geometry against what was written."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
import tifffile

from volviz.errors import Cancelled, InputError, LimitError, UnsupportedError, UsageError
from volviz.io import Limits, load, probe, tiff, tiff_pixels
from volviz.progress import Progress


def stack(*shape: int, dtype: str = "u2") -> np.ndarray:
    return np.arange(np.prod(shape), dtype=np.int64).reshape(shape).astype(dtype)


def write(path: Path, values: np.ndarray, **choices) -> None:
    tifffile.imwrite(path, values, **{"photometric": "minisblack", **choices})


# ------------------------------------------------------------------ real files


@pytest.mark.parametrize(
    ("name", "time"), [("droplet_4d.tif", 20), ("tgmm_mini_4d_labels.tif", 7), ("snow.tif", 0)]
)
def test_imagej_equals_tifffile(data: Path, name: str, time: int) -> None:
    path = data / "microscopy" / name
    whole = tifffile.imread(path)
    expected = whole[time] if whole.ndim == 4 else whole
    volume = load(path, time=time)
    np.testing.assert_array_equal(volume.data, expected)
    assert volume.data.dtype == expected.dtype.newbyteorder("=")
    assert volume.info.times == (len(whole) if whole.ndim == 4 else 1)
    assert volume.info.space is None


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_ome_equals_tifffile(data: Path, channel: int) -> None:
    path = data / "microscopy" / "ome_multichannel_z.ome.tif"
    np.testing.assert_array_equal(load(path, channel=channel).data, tifffile.imread(path)[channel])


def test_scifio_scales(data: Path) -> None:
    info = probe(data / "microscopy" / "tgmm_mini_4d_labels.tif")
    assert info.spacing == (1, 1, 5)
    assert any("unit" in w for w in info.warnings)


def test_display_range_is_the_window(data: Path) -> None:
    assert probe(data / "microscopy" / "snow.tif").window == (18999.5, 37999)


@pytest.mark.parametrize("name", ["droplet_4d.tif", "snow.tif", "ome_multichannel_z.ome.tif"])
def test_probe_says_what_load_gives(data: Path, name: str) -> None:
    path = data / "microscopy" / name
    info, volume = probe(path), load(path)
    assert (info.dims, info.dtype, info.warnings) == (
        volume.info.dims,
        volume.info.dtype,
        volume.info.warnings,
    )
    np.testing.assert_array_equal(info.affine, volume.affine)


# ------------------------------------------------------------------ made files


@pytest.mark.parametrize("dtype", ["u1", "i1", "u2", "i2", "u4", "i4", "f4", "f8", "f2"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_plain_stack(tmp_path: Path, dtype: str, order: str) -> None:
    values = stack(3, 5, 7, dtype=dtype)
    path = tmp_path / "a.tif"
    write(path, values, byteorder=order, metadata=None, photometric="minisblack")
    volume = load(path)
    np.testing.assert_array_equal(volume.data, values.astype("f4") if dtype == "f2" else values)
    assert (volume.spacing, volume.info.length_unit) == ((1, 1, 1), None)
    assert any("spacing unknown" in w for w in volume.info.warnings)
    assert probe(path).dtype == volume.data.dtype


@pytest.mark.parametrize(
    "compression", ["zlib", "lzw", "packbits", "lzma", "zstd", "deflate", "jpeg2000"]
)
@pytest.mark.parametrize("tile", [None, (16, 16)])
def test_compressions(tmp_path: Path, compression: str, tile) -> None:
    values = stack(3, 20, 24)
    path = tmp_path / "a.tif"
    write(path, values, compression=compression, tile=tile, metadata=None)
    np.testing.assert_array_equal(load(path).data, values)


def test_tiled_uncompressed_and_predictor(tmp_path: Path) -> None:
    values = stack(2, 40, 50)
    write(tmp_path / "t.tif", values, tile=(16, 32), metadata=None)
    np.testing.assert_array_equal(load(tmp_path / "t.tif").data, values)
    write(tmp_path / "p.tif", values, compression="zlib", predictor=True, metadata=None)
    np.testing.assert_array_equal(load(tmp_path / "p.tif").data, values)


def test_strips_and_bigtiff(tmp_path: Path) -> None:
    values = stack(4, 33, 20)
    write(tmp_path / "b.tif", values, bigtiff=True, rowsperstrip=5, metadata=None)
    np.testing.assert_array_equal(load(tmp_path / "b.tif").data, values)


def test_resolution_of_paper_means_nothing(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    write(path, stack(2, 4, 4), resolution=(300, 300), resolutionunit=2, metadata=None)
    assert probe(path).spacing == (1, 1, 1)


@pytest.mark.parametrize("shape", [(4, 6, 8), (2, 4, 6, 8), (2, 3, 4, 6, 8)])
def test_imagej_hyperstacks(tmp_path: Path, shape: tuple[int, ...]) -> None:
    values = stack(*shape)
    axes = {3: "ZYX", 4: "CZYX", 5: "TZCYX"}[len(shape)]
    ordered = np.moveaxis(values, 0, 1) if len(shape) == 4 else values
    path = tmp_path / "ij.tif"
    metadata = {"axes": axes.replace("CZYX", "ZCYX"), "spacing": 2.5, "unit": "micron"}
    write(path, ordered, imagej=True, resolution=(4, 2), metadata=metadata)
    info = probe(path)
    np.testing.assert_allclose(info.spacing, np.array([0.25, 0.5, 2.5]) * 1e-3)
    assert (info.length_unit, info.format) == ("µm", "TIFF (ImageJ)")
    for t in range(info.times):
        for c in range(info.channels):
            expected = {
                3: lambda: values,
                4: lambda c=c: values[c],
                5: lambda t=t, c=c: values[t, :, c],
            }[len(shape)]()
            np.testing.assert_array_equal(load(path, time=t, channel=c).data, expected)
    with pytest.raises(UsageError, match="there is no time"):
        load(path, time=info.times)
    with pytest.raises(UsageError, match="there is no channel"):
        load(path, channel=info.channels)


@pytest.mark.parametrize(
    ("unit", "name", "mm"),
    [("\\u00B5m", "µm", 1e-3), ("um", "µm", 1e-3), ("cm", "cm", 10), ("nm", "nm", 1e-6)],
)
def test_imagej_units(tmp_path: Path, unit: str, name: str, mm: float) -> None:
    path = tmp_path / "ij.tif"
    write(
        path, stack(3, 4, 5), imagej=True, resolution=(1, 1), metadata={"unit": unit, "spacing": 3}
    )
    info = probe(path)
    assert info.length_unit == name
    np.testing.assert_allclose(info.spacing, (mm, mm, 3 * mm))


def test_imagej_signed_sixteen_bits(tmp_path: Path) -> None:
    values = stack(2, 4, 5) + np.uint16(32000)
    path = tmp_path / "ij.tif"
    metadata = {"axes": "ZYX", "cf": 0, "c0": -32768, "c1": 1, "vunit": "gray value"}
    write(path, values, imagej=True, metadata=metadata)
    volume = load(path)
    assert volume.data.dtype == probe(path).dtype == np.int16
    np.testing.assert_array_equal(volume.data, values.astype(int) - 32768)


def test_imagej_one_header_and_a_raw_tail(tmp_path: Path) -> None:
    """ImageJ stacks beyond 4 GB have one IFD, and all planes one after the other behind it."""
    values = stack(5, 4, 6)
    text = "ImageJ=1.53\nimages=5\nslices=5\n"
    path = tmp_path / "tail.tif"
    write(path, values[0], description=text, metadata=None, photometric="minisblack")
    with tifffile.TiffFile(path) as tif:
        offset = tif.pages[0].dataoffsets[0]
    content = path.read_bytes()
    assert offset + values[0].nbytes == len(content)
    path.write_bytes(content + values[1:].tobytes())
    np.testing.assert_array_equal(load(path).data, values)
    path.write_bytes(content + values[1:].tobytes()[:-3])
    with pytest.raises(InputError):
        load(path)


def test_sizes_of_pages_that_differ(tmp_path: Path) -> None:
    path = tmp_path / "mixed.tif"
    with tifffile.TiffWriter(path) as writer:
        writer.write(stack(9, 9), metadata=None)
        writer.write(stack(5, 8, 6), metadata=None)
        writer.write(stack(4, 4), metadata=None)
    volume = load(path)
    np.testing.assert_array_equal(volume.data, stack(5, 8, 6))
    text = " ".join(volume.info.warnings)
    assert "2 pages of another size or type left out" in text
    assert "9 × 9" in text


def test_rgb_becomes_luminance(tmp_path: Path) -> None:
    rgb = np.random.default_rng(1).integers(0, 256, (3, 5, 7, 3), dtype=np.uint8)
    for planar in ("contig", "separate"):
        path = tmp_path / f"{planar}.tif"
        values = rgb if planar == "contig" else np.moveaxis(rgb, -1, 1)
        write(path, values, photometric="rgb", planarconfig=planar, metadata=None)
        volume = load(path)
        expected = np.rint(rgb @ np.array([0.2126, 0.7152, 0.0722]))
        np.testing.assert_array_equal(volume.data, expected)
        assert any("luminance" in w for w in volume.info.warnings)


def test_samples_that_are_no_colours_are_channels(tmp_path: Path) -> None:
    values = stack(3, 5, 7, 2)
    path = tmp_path / "a.tif"
    write(path, values, photometric="minisblack", planarconfig="contig", metadata=None)
    assert probe(path).channels == 2
    np.testing.assert_array_equal(load(path, channel=1).data, values[..., 1])


def test_palette(tmp_path: Path) -> None:
    index = (stack(2, 16, 16) % 256).astype("u1")
    table = np.zeros((3, 256), "u2")
    table[1] = np.arange(256)[::-1] * 257
    write(tmp_path / "p.tif", index, photometric="palette", colormap=table, metadata=None)
    volume = load(tmp_path / "p.tif")
    expected = np.rint(table[1] * 0.7152).astype(int) // 257
    np.testing.assert_array_equal(volume.data, expected[index])
    write(tmp_path / "ij.tif", index, imagej=True, colormap=table, metadata={"axes": "ZYX"})
    np.testing.assert_array_equal(load(tmp_path / "ij.tif").data, index)


def test_miniswhite_keeps_its_values(tmp_path: Path) -> None:
    path = tmp_path / "w.tif"
    write(path, stack(2, 4, 4), photometric="miniswhite", metadata=None)
    volume = load(path)
    np.testing.assert_array_equal(volume.data, stack(2, 4, 4))
    assert any("MinIsWhite" in w for w in volume.info.warnings)


def test_bilevel(tmp_path: Path) -> None:
    values = stack(2, 9, 17) % 3 == 0
    path = tmp_path / "b.tif"
    write(path, values, metadata=None)
    np.testing.assert_array_equal(load(path).data, values)


def test_only_the_needed_planes_are_read(tmp_path: Path, monkeypatch) -> None:
    values = stack(4, 3, 2, 16, 16)
    path = tmp_path / "ij.tif"
    write(path, values, imagej=True, metadata={"axes": "TZCYX"}, compression="zlib")
    count = 0
    original = tiff_pixels._decoded

    def counted(*args):
        nonlocal count
        count += 1
        return original(*args)

    monkeypatch.setattr(tiff_pixels, "_decoded", counted)
    np.testing.assert_array_equal(load(path, time=2, channel=1).data, values[2, :, 1])
    assert count == 3


def test_missing_codec_is_named(tmp_path: Path, monkeypatch) -> None:
    path = tmp_path / "lzw.tif"
    write(path, stack(3, 20, 20), compression="lzw", metadata=None)
    monkeypatch.setattr(tiff_pixels, "find_spec", lambda name: None)
    with pytest.raises(UnsupportedError, match=r"LZW.*volviz\[codecs\]") as caught:
        load(path)
    assert caught.value.exit_code == 4
    assert probe(path).encoding == "lzw"


def test_deflate_without_imagecodecs_is_bounded(tmp_path: Path, monkeypatch) -> None:
    import zlib

    path = tmp_path / "z.tif"
    values = stack(1, 20, 20)
    write(path, values, compression="zlib", metadata=None)
    monkeypatch.setattr(tiff_pixels, "find_spec", lambda name: None)
    np.testing.assert_array_equal(load(path).data, values)
    bomb = zlib.compress(bytes(50 << 20), 9)
    content = bytearray(path.read_bytes())
    with tifffile.TiffFile(path) as tif:
        tags = tif.pages[0].tags
        at = {n: tags[n].valueoffset for n in ("StripOffsets", "StripByteCounts")}
        order = tif.byteorder
    struct.pack_into(order + "I", content, at["StripOffsets"], len(content))
    struct.pack_into(order + "I", content, at["StripByteCounts"], len(bomb))
    path.write_bytes(bytes(content) + bomb)
    with pytest.raises(InputError, match="more data than the header declares"):
        load(path)


def test_cancel(tmp_path: Path) -> None:
    path = tmp_path / "z.tif"
    write(path, stack(30, 8, 8), compression="zlib", metadata=None)
    progress = Progress(
        lambda f, m: progress.cancel() if m.startswith("decoding plane 5") else None
    )
    with pytest.raises(Cancelled):
        load(path, progress=progress)


def test_limit(tmp_path: Path) -> None:
    path = tmp_path / "z.tif"
    write(path, stack(30, 8, 8), compression="zlib", metadata=None)
    with pytest.raises(LimitError):
        load(path, limits=Limits(max_bytes=1000))


def test_user_spacing(tmp_path: Path) -> None:
    path = tmp_path / "a.tif"
    write(path, stack(3, 4, 5), metadata=None)
    info = probe(path, spacing=(1, 2, 3))
    assert (info.spacing, info.length_unit) == ((1, 2, 3), "mm")
    assert not any("spacing" in w for w in info.warnings)


def test_complex_is_unsupported(tmp_path: Path) -> None:
    path = tmp_path / "c.tif"
    write(path, stack(3, 4, 5).astype("c8"), metadata=None)
    with pytest.raises(UnsupportedError, match="complex64"):
        load(path)


def test_module_stays_silent(tmp_path: Path, capfd) -> None:
    path = tmp_path / "cut.tif"
    write(path, stack(3, 40, 50), metadata=None)
    path.write_bytes(path.read_bytes()[:-2000])
    with pytest.raises(InputError):
        tiff.read(path, __import__("volviz.io").io.ReadOptions())
    assert capfd.readouterr().err == ""
