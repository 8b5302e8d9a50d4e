"""One encoded DICOM frame to samples.

The size that the codestream itself declares is compared with Rows and Columns before any codec
allocates for it. RLE (PS3.5 annex G) is decoded here, bounded; JPEG 2000, HTJ2K, JPEG-LS and colour
JPEG go through pydicom's plugins; one-channel JPEG, also 12 bits and lossless, through imagecodecs.
"""

from __future__ import annotations

import struct
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import InputError, UnsupportedError, safe_text
from volviz.io.codestream import j2k_size, jpeg_size
from volviz.io.dicom_frames import Frame

RLE = "1.2.840.10008.1.2.5"
_JPEG = {f"1.2.840.10008.1.2.4.{n}" for n in (50, 51, 53, 55, 57, 70)}
_JPEG_LS = {"1.2.840.10008.1.2.4.80", "1.2.840.10008.1.2.4.81"}
_J2K = {f"1.2.840.10008.1.2.4.{n}" for n in (90, 91, 92, 93, 201, 202, 203)}
NATIVE = (
    "1.2.840.10008.1.2",
    "1.2.840.10008.1.2.1",
    "1.2.840.10008.1.2.1.99",
    "1.2.840.10008.1.2.2",
)


def syntax_name(uid: str) -> str:
    """The standard's name of a transfer syntax, or the UID itself."""
    from pydicom.uid import UID

    return safe_text(UID(uid, validation_mode=0).name, 120)


def is_known_syntax(uid: str) -> bool:
    """True for the transfer syntaxes that a decoder may exist for."""
    return uid == RLE or uid in _JPEG | _J2K | _JPEG_LS


def decode_frame(data: bytes, frame: Frame) -> NDArray[Any]:
    """Samples of an encoded frame, [rows, columns] or [rows, columns, 3] as RGB.

    Raises InputError for a damaged stream or one of another size, UnsupportedError where the codec
    is missing; codecs may raise anything else (the caller guards).
    """
    syntax, path = frame.stored.syntax, frame.path
    if syntax == RLE:
        return _rle(data, frame)
    _check_stream(data, frame)
    if syntax in _JPEG and frame.stored.samples == 1:
        if find_spec("imagecodecs") is not None:
            import imagecodecs

            return _shaped(np.asarray(imagecodecs.jpeg_decode(data)), frame)
        if not (syntax.endswith(".50") and frame.stored.bits <= 8):
            raise missing_codec(syntax, path)
    return _shaped(_by_pydicom(data, frame), frame)


def missing_codec(syntax: str, path: Path) -> UnsupportedError:
    """The error for a transfer syntax that cannot be decoded here."""
    if not is_known_syntax(syntax):
        return UnsupportedError(
            f"pixels encoded as {syntax_name(syntax)} ({safe_text(syntax, 64)}) are not read",
            file=path,
            field="TransferSyntaxUID",
            fix="save it uncompressed or as lossless JPEG 2000",
        )
    return UnsupportedError(
        f"the pixels are encoded as {syntax_name(syntax)} ({syntax}), which needs a codec",
        file=path,
        field="TransferSyntaxUID",
        fix="pip install 'volviz[codecs]'",
    )


def _by_pydicom(data: bytes, frame: Frame) -> NDArray[Any]:
    from pydicom.encaps import encapsulate
    from pydicom.pixels import get_decoder

    stored = frame.stored
    try:
        decoder = get_decoder(stored.syntax)
    except NotImplementedError:
        raise missing_codec(stored.syntax, frame.path) from None
    if not decoder.is_available:
        raise missing_codec(stored.syntax, frame.path)
    plugin = "pylibjpeg" if "pylibjpeg" in decoder.available_plugins else ""
    array, _ = decoder.as_array(
        encapsulate([data], has_bot=False),
        index=0,
        decoding_plugin=plugin,
        rows=frame.rows,
        columns=frame.columns,
        number_of_frames=1,
        samples_per_pixel=stored.samples,
        bits_allocated=stored.allocated,
        bits_stored=stored.bits,
        pixel_representation=int(stored.signed),
        photometric_interpretation=stored.photometric,
        planar_configuration=stored.planar,
        pixel_keyword="PixelData",
    )
    return np.asarray(array)


def _shaped(array: NDArray[Any], frame: Frame) -> NDArray[Any]:
    wanted = (frame.rows, frame.columns) + ((3,) if frame.stored.samples == 3 else ())
    if array.shape != wanted:
        raise InputError(
            f"the encoded image is {' × '.join(map(str, array.shape))}, the header says "
            f"{' × '.join(map(str, wanted))}",
            file=frame.path,
            field="PixelData",
            fix="the file is damaged: copy it again",
        )
    return array


def _check_stream(data: bytes, frame: Frame) -> None:
    """Compare the size that the codestream declares with Rows and Columns."""
    found = j2k_size(data) if frame.stored.syntax in _J2K else jpeg_size(data)
    if found is None:
        raise InputError(
            f"the pixels are no {syntax_name(frame.stored.syntax)} stream",
            file=frame.path,
            field="PixelData",
            fix="the file is damaged: copy it again",
        )
    rows, columns, components = found
    if (rows, columns) != (frame.rows, frame.columns) or components > 4:
        raise InputError(
            f"the encoded image is {rows} × {columns} × {components}, the header says "
            f"{frame.rows} × {frame.columns} × {frame.stored.samples}",
            file=frame.path,
            field="PixelData",
            fix="the file is damaged: copy it again",
        )


def _rle(data: bytes, frame: Frame) -> NDArray[Any]:
    """PS3.5 annex G: byte planes, most significant first, each packed on its own."""
    planes = frame.stored.samples * frame.stored.allocated // 8
    count = frame.rows * frame.columns
    offsets = struct.unpack("<16L", data[:64].ljust(64, b"\0"))
    if offsets[0] != planes or any(not 64 <= o <= len(data) for o in offsets[1 : planes + 1]):
        raise _rle_error(
            f"{offsets[0]} RLE segments instead of {planes}, or beyond the data", frame
        )
    ends = [*offsets[2 : planes + 1], len(data)]
    out = np.empty((planes, count), dtype=np.uint8)
    for plane, (start, end) in enumerate(zip(offsets[1 : planes + 1], ends, strict=True)):
        if unpack_bits(data[start:end], memoryview(out[plane])) != count:
            raise _rle_error("an RLE segment ends before the image is full", frame)
    width = frame.stored.allocated // 8
    samples = out.reshape(frame.stored.samples, width, count).transpose(0, 2, 1)
    values = (
        np.ascontiguousarray(samples)
        .view(f">u{width}")
        .reshape(frame.stored.samples, frame.rows, frame.columns)
    )
    native = values.astype(values.dtype.newbyteorder("="))
    return native[0] if frame.stored.samples == 1 else np.moveaxis(native, 0, -1)


def unpack_bits(data: bytes, out: memoryview) -> int:
    """PackBits from `data` into `out`, never past its end; returns the bytes written."""
    at, done, size, full = 0, 0, len(data), len(out)
    while at < size and done < full:
        code = data[at]
        if code < 128:
            part = data[at + 1 : at + 2 + code][: full - done]
            out[done : done + len(part)] = part
            done += len(part)
            at += 2 + code
        elif code > 128:
            count = min(257 - code, full - done)
            if at + 1 >= size:
                break
            out[done : done + count] = data[at + 1 : at + 2] * count
            done += count
            at += 2
        else:
            at += 1
    return done


def _rle_error(what: str, frame: Frame) -> InputError:
    return InputError(
        what, file=frame.path, field="PixelData", fix="the file is damaged: copy it again"
    )
