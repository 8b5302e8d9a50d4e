"""Voxels of a DICOM stack: one array taken once, each slice decoded, rescaled and put in its place.

The type is chosen from headers before anything is read: as stored where nothing is rescaled; int16
or int32 where slopes and intercepts are whole numbers; float32 otherwise. 16-bit images with an
intercept are tried as int16, which is nearly always enough, and widened once if a value does not
fit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import InputError, UnsupportedError
from volviz.io.dicom_codecs import NATIVE, RLE, decode_frame, is_known_syntax, missing_codec
from volviz.io.dicom_files import PixelElement, open_dicom, pixel_element, raise_cap
from volviz.io.dicom_frames import Frame
from volviz.io.dicom_geometry import Stack
from volviz.io.luminance import luminance
from volviz.io.options import ReadOptions
from volviz.io.payload import check_size

Deliver = Callable[[Frame, int, NDArray[Any]], None]
_TAGS = (
    "Rows",
    "Columns",
    "SamplesPerPixel",
    "PhotometricInterpretation",
    "BitsAllocated",
    "BitsStored",
    "PixelRepresentation",
    "RedPaletteColorLookupTableDescriptor",
    "GreenPaletteColorLookupTableDescriptor",
    "BluePaletteColorLookupTableDescriptor",
    "RedPaletteColorLookupTableData",
    "GreenPaletteColorLookupTableData",
    "BluePaletteColorLookupTableData",
    "SegmentedRedPaletteColorLookupTableData",
    "SegmentedGreenPaletteColorLookupTableData",
    "SegmentedBluePaletteColorLookupTableData",
    "ModalityLUTSequence",
    "ExtendedOffsetTable",
    "ExtendedOffsetTableLengths",
)
COLOUR = ("RGB", "PALETTE COLOR", "YBR_")


@dataclass(frozen=True)
class Plan:
    """How a stack is delivered. dtype: of the volume; widen: the type to go over to where a value
    does not fit; padding: value after rescale that means "nothing measured"; fill: value of
    missing slices.
    """

    dtype: np.dtype[Any]
    widen: np.dtype[Any] | None
    padding: float | None
    fill: float
    warnings: tuple[str, ...] = ()


def is_colour(frame: Frame) -> bool:
    """RGB, YBR or a palette: reduced to luminance."""
    return frame.stored.photometric.startswith(COLOUR)


def plan_stack(stack: Stack) -> Plan:
    """The type and padding of a stack, from its headers alone."""
    frames = [f for f in stack.slots if f is not None]
    dtype, widen = _types(frames)
    padding, warnings = _padding(frames)
    if stack.missing and padding is None:
        dtype, padding = _room_for_padding(dtype, frames)
    fill = np.nan if dtype.kind == "f" else (padding or 0.0)
    return Plan(
        dtype,
        widen,
        padding if dtype.kind != "f" or not _is_nan(padding) else None,
        fill,
        tuple(warnings),
    )


def read_stack(stack: Stack, plan: Plan, options: ReadOptions) -> NDArray[Any]:
    """The voxels, [z, y, x].

    InputError for damaged files, LimitError, UnsupportedError for a missing codec, Cancelled.
    """
    first = stack.first
    dims = (first.columns, first.rows, len(stack.slots))
    check_size(dims, plan.dtype, options, file=first.path, field="Rows, Columns, frames")
    out = np.empty(dims[::-1], dtype=plan.dtype)
    done = 0

    def deliver(frame: Frame, z: int, samples: NDArray[Any]) -> None:
        nonlocal out, done
        options.progress(done / dims[2], f"reading slice {done + 1} of {dims[2]}")
        out = _put(out, rescaled(samples, frame), plan, options, frame=frame, z=z)
        done += 1

    for wanted in _by_file(stack):
        options.progress(done / dims[2], "opening the next file")
        _read_file(wanted, options, deliver)
    for z, slot in enumerate(stack.slots):
        if slot is None:
            out[z] = plan.fill
    options.progress(1.0, "all slices read")
    return out


def rescaled(samples: NDArray[Any], frame: Frame) -> NDArray[Any]:
    """Stored samples times slope plus intercept, as exact integers where both are whole numbers."""
    if frame.slope == 1 and frame.intercept == 0:
        return samples
    if samples.dtype.kind in "iu" and frame.slope.is_integer() and frame.intercept.is_integer():
        return samples.astype(np.int64) * int(frame.slope) + int(frame.intercept)
    return samples * frame.slope + frame.intercept


def _put(
    out: NDArray[Any],
    values: NDArray[Any],
    plan: Plan,
    options: ReadOptions,
    *,
    frame: Frame,
    z: int,
) -> NDArray[Any]:
    """The array with slice z filled; a wider one where the values do not fit."""
    if out.dtype.kind in "iu" and values.dtype != out.dtype:
        bounds = np.iinfo(out.dtype)
        if values.min() < bounds.min or values.max() > bounds.max:
            if plan.widen is None or out.dtype == plan.widen:
                raise InputError(
                    "a value does not fit the declared bits",
                    file=frame.path,
                    field="BitsStored",
                    fix="BitsStored in the header is wrong",
                )
            check_size(
                out.shape, plan.widen, options, file=frame.path, field="Rows, Columns, frames"
            )
            out = out.astype(plan.widen)
    out[z] = values
    return out


def _types(frames: Sequence[Frame]) -> tuple[np.dtype[Any], np.dtype[Any] | None]:
    stored = frames[0].stored
    if is_colour(frames[0]):
        deep = stored.lut_bits > 8 or (not stored.lut_bits and stored.allocated > 8)
        return np.dtype(np.uint16 if deep else np.uint8), None
    if stored.real or frames[0].head.modality_lut:
        return np.dtype(f"f{stored.real // 8}" if stored.real else np.float32), None
    kinds = {(f.stored.allocated, f.stored.signed) for f in frames}
    plain = all(f.slope == 1 and f.intercept == 0 for f in frames)
    if plain and len(kinds) == 1:
        return np.dtype(f"{'i' if stored.signed else 'u'}{stored.allocated // 8}"), None
    whole = all(f.slope.is_integer() and f.intercept.is_integer() for f in frames)
    if not whole or max(f.stored.allocated for f in frames) > 32:
        return np.dtype(np.float32), None
    low, high = _range(frames)
    if low >= -(2**15) and high < 2**15:
        return np.dtype(np.int16), None
    if low >= -(2**31) and high < 2**31:
        small = max(f.stored.bits for f in frames) <= 16 and all(abs(f.slope) == 1 for f in frames)
        return np.dtype(np.int16 if small else np.int32), np.dtype(np.int32)
    return np.dtype(np.float32), None


def _range(frames: Sequence[Frame]) -> tuple[float, float]:
    """Bounds of all values that the stored bits allow."""
    ends = []
    for f in frames:
        bits, signed = f.stored.bits, f.stored.signed
        low, high = (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) if signed else (0, 2**bits - 1)
        ends += [low * f.slope + f.intercept, high * f.slope + f.intercept]
    return min(ends), max(ends)


def _padding(frames: Sequence[Frame]) -> tuple[float | None, list[str]]:
    """PixelPaddingValue after rescale, if it is the same in all slices."""
    if is_colour(frames[0]) or frames[0].head.modality_lut:
        return None, []
    found = {None if f.padding is None else f.padding[0] * f.slope + f.intercept for f in frames}
    if found == {None}:
        return None, []
    if len(found) > 1:
        return None, ["the padding value differs from slice to slice and is shown like any other"]
    notes = []
    pair = frames[0].padding
    if pair is not None and len(pair) > 1:
        ends = sorted(p * frames[0].slope + frames[0].intercept for p in pair)
        notes.append(
            f"values from {ends[0]:g} to {ends[1]:g} are padding; only PixelPaddingValue is masked"
        )
    return found.pop(), notes


def _room_for_padding(
    dtype: np.dtype[Any], frames: Sequence[Frame]
) -> tuple[np.dtype[Any], float | None]:
    """A type and a value in it that no stored sample can have, for missing slices."""
    if dtype.kind == "f":
        return dtype, None
    low, high = _range(frames)
    bounds = np.iinfo(dtype)
    if dtype.kind == "u" and high < bounds.max:
        return dtype, float(bounds.max)
    if dtype.kind == "i" and (low > bounds.min or dtype.itemsize == 2):
        return dtype, float(bounds.min)
    wide = np.dtype(f"i{min(2 * dtype.itemsize, 8)}")
    return wide, float(np.iinfo(wide).min)


def _is_nan(value: float | None) -> bool:
    return value is not None and bool(np.isnan(value))


def _by_file(stack: Stack) -> list[list[tuple[Frame, int]]]:
    wanted: dict[Path, list[tuple[Frame, int]]] = {}
    for z, frame in enumerate(stack.slots):
        if frame is not None:
            wanted.setdefault(frame.path, []).append((frame, z))
    return list(wanted.values())


def _read_file(wanted: Sequence[tuple[Frame, int]], options: ReadOptions, deliver: Deliver) -> None:
    """Hand out each wanted frame of one file with its z and its stored samples [rows, columns]."""
    first = wanted[0][0]
    at = {frame.index: (frame, z) for frame, z in wanted}
    with open_dicom(first.path, options.limits, _TAGS) as (dataset, stream):
        element = pixel_element(dataset, stream)
        if element is None:
            raise InputError(
                "the pixels are gone",
                file=first.path,
                field="PixelData",
                fix="the file is damaged: copy it again",
            )
        for index, raw in _raw_frames(dataset, stream, element, first, sorted(at)):
            frame, z = at[index]
            deliver(frame, z, _samples(raw, dataset, element, frame))


def _raw_frames(
    dataset: Any, stream: Any, element: PixelElement, first: Frame, wanted: Sequence[int]
) -> Iterator[tuple[int, bytes]]:
    if element.length is not None and first.stored.syntax in NATIVE:
        yield from _native_frames(stream, element, first, wanted)
        return
    if not is_known_syntax(first.stored.syntax):
        raise missing_codec(first.stored.syntax, first.path)
    if element.length is not None:
        raise InputError(
            "compressed pixels that are not in fragments",
            file=first.path,
            field="PixelData",
            fix="the file is damaged: copy it again",
        )
    from pydicom.encaps import generate_frames

    stream.seek(element.offset)
    tables = [dataset.get(k) for k in ("ExtendedOffsetTable", "ExtendedOffsetTableLengths")]
    extended = tuple(tables) if all(tables) else None
    left, index = set(wanted), -1
    packed = generate_frames(stream, number_of_frames=first.head.frames, extended_offsets=extended)
    for index, raw in enumerate(packed):
        if index in left:
            left.discard(index)
            yield index, raw
        if not left:
            return
    raise _cut_off(first, f"{index + 1} of {first.head.frames} frames are there")


def _native_frames(
    stream: Any, element: PixelElement, first: Frame, wanted: Sequence[int]
) -> Iterator[tuple[int, bytes]]:
    stored = first.stored
    samples = 2 if stored.photometric == "YBR_FULL_422" else stored.samples
    size = first.rows * first.columns * samples * stored.allocated // 8
    total = size * first.head.frames
    if element.length is not None and element.length < total:
        raise _cut_off(first, f"{element.length} of {total} bytes are declared")
    raise_cap(stream, total)
    for index in wanted:
        stream.seek(element.offset + index * size)
        raw = stream.read(size)
        if len(raw) < size:
            found = index * size + len(raw)
            raise _cut_off(first, f"{found} of {total} bytes are there")
        yield index, raw


def _cut_off(frame: Frame, what: str) -> InputError:
    return InputError(
        f"the pixels are cut off: {what}",
        file=frame.path,
        field="PixelData",
        fix="copy the file again",
    )


def _samples(raw: bytes, dataset: Any, element: PixelElement, frame: Frame) -> NDArray[Any]:
    """[rows, columns] of samples: signed, unused bits dropped, colour reduced, LUT applied."""
    stored = frame.stored
    native = stored.syntax in NATIVE
    if stored.samples not in (1, 3):
        raise UnsupportedError(
            f"{stored.samples} samples per pixel",
            file=frame.path,
            field="SamplesPerPixel",
            fix="one sample or RGB per pixel is read",
        )
    if not native:
        array = decode_frame(raw, frame)
    elif stored.samples == 1:
        array = _native(raw, element, frame)
    else:
        array = _native_colour(raw, element, frame)
    if stored.samples == 3:
        return luminance(_rgb(array, frame, decoded=not native and stored.syntax != RLE))
    if stored.real:
        return array
    array = _integers(array, frame)
    if stored.photometric.startswith("PALETTE"):
        from pydicom.pixels import apply_color_lut

        return luminance(apply_color_lut(array, dataset))
    if frame.head.modality_lut:
        from pydicom.pixels import apply_modality_lut

        return apply_modality_lut(array, dataset)
    return array


def _native(raw: bytes, element: PixelElement, frame: Frame) -> NDArray[Any]:
    stored = frame.stored
    width = stored.allocated // 8
    if width == 1 and element.big and element.vr == b"OW" and len(raw) % 2 == 0:
        # 8-bit samples in big-endian 16-bit words lie swapped (PS3.5 8.1.2, annex A.3).
        raw = np.frombuffer(raw, dtype=">u2").astype("<u2").tobytes()
    order = ">" if element.big else "<"
    array = np.frombuffer(raw, dtype=f"{order}{'f' if stored.real else 'u'}{width}")
    return array.reshape(frame.rows, frame.columns).astype(
        array.dtype.newbyteorder("="), copy=False
    )


def _native_colour(raw: bytes, element: PixelElement, frame: Frame) -> NDArray[Any]:
    """[rows, columns, 3] as stored, subsampled chroma repeated."""
    width = frame.stored.allocated // 8
    order = ">" if element.big else "<"
    flat = np.frombuffer(raw, dtype=f"{order}u{width}").astype(f"u{width}")
    if frame.stored.photometric == "YBR_FULL_422":
        pairs = flat.reshape(-1, 4)
        return np.stack(
            [pairs[:, :2], pairs[:, 2:3].repeat(2, 1), pairs[:, 3:].repeat(2, 1)], -1
        ).reshape(frame.rows, frame.columns, 3)
    if frame.stored.planar:
        return np.moveaxis(flat.reshape(3, frame.rows, frame.columns), 0, -1)
    return flat.reshape(frame.rows, frame.columns, 3)


def _rgb(array: NDArray[Any], frame: Frame, *, decoded: bool) -> NDArray[Any]:
    if decoded or not frame.stored.photometric.startswith("YBR_FULL"):
        return array
    from pydicom.pixels import convert_color_space

    return convert_color_space(array, "YBR_FULL", "RGB")


def _integers(array: NDArray[Any], frame: Frame) -> NDArray[Any]:
    """Drop bits outside BitsStored and give the sign its place."""
    stored = frame.stored
    kind, width = "i" if stored.signed else "u", stored.allocated // 8
    if array.dtype.itemsize != width:
        array = array.astype(f"{array.dtype.kind}{width}")
    spare = stored.allocated - stored.bits
    packed = stored.syntax not in NATIVE and stored.syntax != RLE
    if not spare or (packed and (array.dtype.kind == "i" or not stored.signed)):
        return array.view(f"{kind}{width}")
    if stored.high > stored.bits - 1 and stored.syntax in NATIVE:
        array = array >> (stored.high - stored.bits + 1)
    up = np.left_shift(array.view(f"u{width}"), spare).view(f"{kind}{width}")
    return np.right_shift(up, spare)
