"""DICOM pixels made by pydicom: rescale, bits, padding, colour, codecs, byte orders."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pydicom
import pytest
from pydicom.dataset import Dataset, FileDataset
from pydicom.uid import ExplicitVRBigEndian, ImplicitVRLittleEndian, generate_uid

import tests.io.dicom_maker as maker
from volviz.errors import LimitError, UnsupportedError
from volviz.io import Limits, load, probe


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


def test_limit_before_allocation(tmp_path: Path) -> None:
    maker.series(tmp_path, 4)
    with pytest.raises(LimitError, match="the limit is"):
        load(tmp_path, limits=Limits(max_bytes=100))
    with pytest.raises(LimitError, match="more than 3 files"):
        load(tmp_path, limits=Limits(max_files=3))


def encapsulated(path: Path, frames: list[bytes], syntax: str, like: np.ndarray, **changes) -> Path:
    """A multi-frame object with encoded frames, described like the samples `like[frames, …]`."""
    from pydicom.encaps import encapsulate

    first = like[0] if like.ndim == 3 else like[0, ..., 0]
    ds = maker.image(first, uid=generate_uid(), syntax=syntax)
    del ds.RescaleSlope, ds.RescaleIntercept
    ds.NumberOfFrames, ds.SpacingBetweenSlices = len(frames), 2
    for keyword, value in changes.items():
        setattr(ds, keyword, value)
    ds.PixelData = encapsulate(frames)
    ds["PixelData"].VR = "OB"
    ds["PixelData"].is_undefined_length = True
    return maker.save(ds, path)


def jpeg(values: np.ndarray, **choices) -> bytes:
    import io

    from PIL import Image

    buffer = io.BytesIO()
    Image.fromarray(values).save(buffer, "JPEG", **choices)
    return buffer.getvalue()


def smooth(*shape: int) -> np.ndarray:
    axes = np.meshgrid(*(np.linspace(0, 1, n) for n in shape), indexing="ij")
    return np.sum(axes, axis=0) / len(shape)


@pytest.mark.parametrize("codec", [True, False])
def test_jpeg_baseline(tmp_path: Path, monkeypatch, codec: bool) -> None:
    import io

    from PIL import Image

    from volviz.io import dicom_codecs

    if not codec:
        monkeypatch.setattr(dicom_codecs, "find_spec", lambda name: None)
    values = (smooth(3, 24, 32) * 255).astype("u1")
    frames = [jpeg(plane, quality=95) for plane in values]
    path = encapsulated(tmp_path / "a.dcm", frames, "1.2.840.10008.1.2.4.50", values)
    volume = load(path)
    expected = [np.asarray(Image.open(io.BytesIO(f))) for f in frames]
    np.testing.assert_array_equal(volume.data, expected)
    assert volume.data.dtype == np.uint8


def test_jpeg_of_twelve_bits_and_lossless(tmp_path: Path) -> None:
    import imagecodecs

    values = (smooth(2, 24, 32) * 4095).astype("u2")
    frames = [imagecodecs.jpeg_encode(plane, bitspersample=12, level=98) for plane in values]
    changes = {"BitsStored": 12, "HighBit": 11}
    path = encapsulated(tmp_path / "a.dcm", frames, "1.2.840.10008.1.2.4.51", values, **changes)
    assert np.abs(load(path).data.astype(int) - values).max() < 40
    frames = [imagecodecs.ljpeg_encode(plane, bitspersample=12) for plane in values]
    path = encapsulated(tmp_path / "b.dcm", frames, "1.2.840.10008.1.2.4.70", values, **changes)
    np.testing.assert_array_equal(load(path).data, values)
    signed = {**changes, "PixelRepresentation": 1}
    path = encapsulated(tmp_path / "c.dcm", frames, "1.2.840.10008.1.2.4.57", values, **signed)
    np.testing.assert_array_equal(load(path).data, (values.astype(int) + 2048) % 4096 - 2048)


def test_jpeg_in_colour(tmp_path: Path) -> None:
    values = np.stack([(smooth(24, 32) * k).astype("u1") for k in (250, 120, 60)], -1)[None]
    path = encapsulated(
        tmp_path / "a.dcm",
        [jpeg(values[0], quality=98)],
        "1.2.840.10008.1.2.4.50",
        values,
        SamplesPerPixel=3,
        PlanarConfiguration=0,
        PhotometricInterpretation="YBR_FULL_422",
    )
    grey = values[0] @ np.array([0.2126, 0.7152, 0.0722])
    assert np.abs(load(path).data[0] - grey).max() < 6


@pytest.mark.parametrize("syntax", ["1.2.840.10008.1.2.4.80", "1.2.840.10008.1.2.4.90"])
def test_lossless_frames(tmp_path: Path, syntax: str) -> None:
    import imagecodecs

    values = (smooth(4, 24, 32) * 60000).astype("u2")
    encode = imagecodecs.jpegls_encode if syntax.endswith("80") else imagecodecs.jpeg2k_encode
    choices = (
        {} if syntax.endswith("80") else {"codecformat": "j2k", "reversible": True, "level": 0}
    )
    frames = [bytes(encode(plane, **choices)) for plane in values]
    path = encapsulated(tmp_path / "a.dcm", frames, syntax, values)
    np.testing.assert_array_equal(load(path).data, values)


def test_modality_lut(tmp_path: Path) -> None:
    from pydicom.sequence import Sequence

    table = Dataset()
    table.add_new("LUTDescriptor", "US", [256, 0, 16])
    table.ModalityLUTType = "US"
    entries = (np.arange(256) * 3 + 7).astype("u2")
    table.add_new("LUTData", "OW", entries.tobytes())
    index = np.arange(40, dtype=np.uint8).reshape(5, 8)
    ds = maker.image(index, uid=generate_uid())
    del ds.RescaleSlope, ds.RescaleIntercept
    ds.ModalityLUTSequence = Sequence([table])
    np.testing.assert_array_equal(load(maker.save(ds, tmp_path / "a.dcm")).data[0], entries[index])


def test_float_pixels(tmp_path: Path) -> None:
    values = smooth(5, 8).astype("f4") - 0.5
    ds = maker.image(values.astype("u2"), uid=generate_uid())
    for keyword in ("PixelData", "RescaleSlope", "RescaleIntercept", "BitsStored", "HighBit"):
        delattr(ds, keyword)
    ds.BitsAllocated = 32
    ds.FloatPixelData = values.tobytes()
    np.testing.assert_array_equal(load(maker.save(ds, tmp_path / "a.dcm")).data[0], values)
