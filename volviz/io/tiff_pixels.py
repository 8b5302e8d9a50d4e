"""Planes of a TIFF into one array.

Raw planes go through the bounded loader. Others are decoded page by page by tifffile (and
imagecodecs, where it is installed), after a look at where each strip lies, what it inflates to
and which size a JPEG in it declares.
"""

from __future__ import annotations

import lzma
import math
import zlib
from collections.abc import Iterator
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import InputError, UnsupportedError
from volviz.io.codestream import j2k_size, jpeg_size
from volviz.io.luminance import luminance
from volviz.io.options import ReadOptions
from volviz.io.payload import Part, check_size, read_parts, resolve_sibling
from volviz.io.tiff_plane import Layout, Plane

_RAW = 1
_JPEG = (6, 7, 33007)
_J2K = (33003, 33004, 33005, 34712)
_DEFLATE = (8, 32946, 50013)
_LZMA = 34925
_BOUNDED = (_RAW, 2, 3, 4, 5, *_DEFLATE, 32773, _LZMA, 50000, 34926, *_JPEG, *_J2K)
_STEP = 1 << 20


def read_planes(
    tif: Any, layout: Layout, time: int, channel: int, *, path: Path, options: ReadOptions
) -> tuple[NDArray[Any], tuple[str, ...]]:
    """The planes of one time and channel, [z, y, x], and warnings. Reads no other planes.

    InputError for missing or broken planes, UnsupportedError for a missing codec, LimitError.
    """
    key = layout.key
    dtype = out_dtype(layout)
    dims = (layout.width, layout.height, layout.depth)
    check_size(dims, dtype, options, file=path, field="ImageWidth, ImageLength, pages")
    samples = int(key.samplesperpixel)
    page_dims = (*dims[:2], samples, int(key.imagedepth))
    check_size(page_dims, key.dtype, options, file=path, field="ImageWidth, ImageLength")
    planes = _planes_of(layout, time, channel // samples if layout.sampled else channel, path)
    if samples == 1 and all(_is_raw(p) for p in planes):
        stored = np.dtype(key.dtype).newbyteorder(tif.byteorder)
        parts = _parts(planes, layout, path)
        data, notes = read_parts(
            parts,
            stored,
            dims[::-1],
            encoding="raw",
            options=options,
            file=path,
            field="StripOffsets",
            trailing=False,
        )
        return _finished(data, layout), notes
    check_codec(layout, path)
    out = np.empty(dims[::-1], dtype=dtype)
    sample = channel % samples if layout.sampled else 0
    for z, page in _pages(tif, planes, path, options):
        options.progress(z / dims[2], f"decoding plane {z + 1} of {dims[2]}")
        out[z] = _decoded(page, layout, sample, path)
    options.progress(1.0, "all planes decoded")
    return _finished(out, layout), ()


def out_dtype(layout: Layout) -> np.dtype[Any]:
    """The type in which the planes are kept while they are read."""
    if layout.palette is not None:
        return np.dtype(np.uint8)
    dtype = np.dtype(layout.key.dtype)
    return np.dtype(np.uint8) if dtype.kind == "b" else dtype.newbyteorder("=")


def final_dtype(layout: Layout) -> np.dtype[Any]:
    """The type in which the volume is delivered."""
    dtype = out_dtype(layout)
    if layout.signed16:
        return np.dtype(np.int16)
    return np.dtype(np.float32) if dtype == np.float16 else dtype


def check_codec(layout: Layout, path: Path) -> None:
    """Raise UnsupportedError for a compression that cannot be decoded, or not within bounds."""
    import tifffile

    key = layout.key
    code = int(key.compression)
    name = getattr(key.compression, "name", str(code))
    packed = int(key.bitspersample) not in (8, 16, 32, 64)
    needs = code not in (_RAW, *_DEFLATE, 32773, _LZMA) or packed or int(key.predictor) != 1
    if needs and find_spec("imagecodecs") is None:
        what = f"compression {name}" if code != _RAW else f"{key.bitspersample}-bit samples"
        raise UnsupportedError(
            f"{what} needs a codec",
            file=path,
            field="Compression",
            fix="pip install 'volviz[codecs]'",
        )
    try:
        known = code == _RAW or tifffile.TIFF.DECOMPRESSORS[code] is not None
    except KeyError:
        known = False
    if not known or code not in _BOUNDED:
        raise UnsupportedError(
            f"compression {name} ({code}) is not read",
            file=path,
            field="Compression",
            fix="save it with LZW, deflate or no compression",
        )


def _planes_of(layout: Layout, time: int, channel: int, path: Path) -> list[Plane]:
    planes = [layout.plane(time, channel, z) for z in range(layout.depth)]
    gone = [z for z, plane in enumerate(planes) if plane is None]
    if gone:
        listed = ", ".join(str(z + 1) for z in gone[:6]) + (" …" if len(gone) > 6 else "")
        raise InputError(
            f"{len(gone)} of {layout.depth} planes are not in the file (plane {listed})",
            file=path,
            field="pages",
            fix="the file is cut off or its description is wrong",
        )
    return [plane for plane in planes if plane is not None]


def _is_raw(plane: Plane) -> bool:
    """The plane's bytes lie uncompressed in the file, in order."""
    if plane.offset is not None:
        return True
    page = plane.page
    if plane.name or page is None or not page.keyframe.is_final or not len(page.dataoffsets):
        return False
    tiled = page.keyframe.is_tiled
    return tiled or len(page.dataoffsets) == 1 or sum(page.databytecounts) == page.keyframe.nbytes


def _parts(planes: list[Plane], layout: Layout, path: Path) -> list[Part]:
    """Where the bytes of the planes lie, neighbours joined."""
    depth = int(layout.key.imagedepth)
    size = int(layout.key.nbytes) // depth
    pieces: list[tuple[int, int]] = []
    for plane in planes:
        page = plane.page
        if plane.offset is not None:
            found = [(plane.offset, size)]
        elif page.keyframe.is_tiled or len(page.dataoffsets) == 1:
            found = [(int(page.dataoffsets[0]), size)]
        else:
            found = [
                (int(o), int(n)) for o, n in zip(page.dataoffsets, page.databytecounts, strict=True)
            ]
        for offset, nbytes in found:
            if pieces and sum(pieces[-1]) == offset:
                pieces[-1] = (pieces[-1][0], pieces[-1][1] + nbytes)
            else:
                pieces.append((offset, nbytes))
    return [Part(path, offset, nbytes) for offset, nbytes in pieces]


def _pages(
    tif: Any, planes: list[Plane], path: Path, options: ReadOptions
) -> Iterator[tuple[int, Any]]:
    """Each z with its page; pages of other files beside this one are opened file by file."""
    import tifffile

    elsewhere: dict[str, list[tuple[int, int]]] = {}
    for z, plane in enumerate(planes):
        if plane.name:
            elsewhere.setdefault(plane.name, []).append((z, plane.number))
        else:
            yield z, plane.page
    for name, wanted in elsewhere.items():
        other = resolve_sibling(
            path, name, field="UUID FileName", allow_outside=options.allow_outside
        )
        with tifffile.TiffFile(other, _multifile=False) as more:
            for z, number in wanted:
                if number >= len(more.pages):
                    raise InputError(
                        f"it has no page {number + 1}",
                        file=other,
                        field="IFD",
                        fix="the file is damaged: copy it again",
                    )
                yield z, more.pages[number]


def _decoded(page: Any, layout: Layout, sample: int, path: Path) -> NDArray[Any]:
    """One plane [y, x] of a page that is compressed, packed, tiled or has several samples."""
    key = page.keyframe
    wanted = layout.key
    same = (key.imagewidth, key.imagelength, key.samplesperpixel, key.dtype)
    if same != (wanted.imagewidth, wanted.imagelength, wanted.samplesperpixel, wanted.dtype):
        raise InputError(
            f"page {page.index + 1} is {same[0]} × {same[1]} of {same[3]}, unlike the others",
            file=path,
            field="pages",
            fix="the file is damaged: copy it again",
        )
    _check_segments(page, path)
    array = page.asarray()
    array = array.reshape(
        array.shape if array.ndim > 1 else (wanted.imagelength, wanted.imagewidth)
    )
    if int(wanted.samplesperpixel) > 1 and int(wanted.planarconfig) == 2:
        array = np.moveaxis(array, 0, -1)
    if layout.colour:
        return luminance(array)
    if layout.sampled:
        return array[..., sample]
    return array


def _check_segments(page: Any, path: Path) -> None:
    """Every strip or tile is in the file and decodes to no more than its share of the image."""
    key = page.keyframe
    count = math.prod(key.chunked)
    size = int(page.parent.filehandle.size)
    offsets, lengths = page.dataoffsets, page.databytecounts
    whole = len(offsets) >= count and len(lengths) >= count
    for k in range(count if whole else 0):
        whole = offsets[k] > 0 and lengths[k] > 0 and offsets[k] + lengths[k] <= size
        if not whole:
            break
    if not whole:
        raise InputError(
            f"page {page.index + 1} is not all in the file",
            file=path,
            field="StripOffsets, StripByteCounts",
            fix="the file is cut off: copy it again",
        )
    share = math.prod(key.chunks) * max(1, int(np.dtype(key.dtype).itemsize))
    if share > 2 * int(key.nbytes) + (64 << 20):
        raise InputError(
            f"the tiles of page {page.index + 1} are far larger than the image",
            file=path,
            field="TileWidth, TileLength",
            fix="the file is damaged: copy it again",
        )
    code = int(key.compression)
    bare = find_spec("imagecodecs") is None
    if code in (*_JPEG, *_J2K) or (bare and code in (*_DEFLATE, _LZMA)):
        for k in range(count):
            page.parent.filehandle.seek(offsets[k])
            _check_stream(page.parent.filehandle.read(lengths[k]), key, share, path)


def _check_stream(data: bytes, key: Any, share: int, path: Path) -> None:
    """A compressed strip or tile decodes to no more than `share` bytes."""
    code = int(key.compression)
    if code in (*_JPEG, *_J2K):
        found = jpeg_size(data) if code in _JPEG else j2k_size(data)
        fits = found is None or found[0] * found[1] <= 2 * math.prod(key.chunks) + (1 << 16)
    else:
        fits = _inflated_size(data, code, share) <= share
    if not fits:
        raise InputError(
            "more data than the header declares",
            file=path,
            field="StripByteCounts",
            fix="the file is broken or hostile",
        )


def _inflated_size(data: bytes, code: int, most: int) -> int:
    """Bytes that a stream inflates to, counted to just beyond `most`, nothing kept."""
    total = 0
    engine = lzma.LZMADecompressor() if code == _LZMA else zlib.decompressobj()
    part = b"."
    while part and total <= most and not engine.eof:
        part = engine.decompress(data, _STEP)
        data = b"" if code == _LZMA else engine.unconsumed_tail  # type: ignore[union-attr]
        total += len(part)
    return total


def _finished(data: NDArray[Any], layout: Layout) -> NDArray[Any]:
    """Palette applied; ImageJ's signed 16-bit samples (stored with 32768 added) as they are."""
    if layout.palette is not None:
        for plane in data:
            plane[...] = layout.palette[plane]
        return data
    if not layout.signed16:
        return data
    return np.bitwise_xor(data, np.uint16(0x8000), out=data).view(np.int16)
