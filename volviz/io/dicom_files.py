"""One DICOM file, opened without trusting it.

pydicom parses the header. Here is what has to hold around it: reads never ask for more than the
file has, a deflated data set is inflated piece by piece under a cap before pydicom sees it (pydicom
would inflate all of it at once), every exception becomes one of ours, and no message repeats
a value of the header (it could be a person's name).
"""

from __future__ import annotations

import io
import math
import struct
import zlib
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

from volviz.errors import InputError, LimitError, VolvizError
from volviz.io.guard import library_errors
from volviz.io.options import Limits
from volviz.io.payload import binary_size, open_regular

DEFLATED = "1.2.840.10008.1.2.1.99"
EXPLICIT_LITTLE = "1.2.840.10008.1.2.1"
_STEP = 1 << 16
_PIXEL_TAGS = {
    0x7FE00010: "PixelData",
    0x7FE00008: "FloatPixelData",
    0x7FE00009: "DoubleFloatPixelData",
}
_LONG_VRS = (b"OB", b"OW", b"OF", b"OD", b"UN")


@dataclass(frozen=True)
class PixelElement:
    """Where the pixels of a file lie.

    keyword: PixelData or its float kin; vr: b"OW", b"OB", …; offset: of the first byte in the
    stream; length: bytes, None where encapsulated; big: byte order.
    """

    keyword: str
    vr: bytes
    offset: int
    length: int | None
    big: bool


class _Clamped(io.BufferedReader):
    """A file whose reads are cut to what is left of it, so that a lying length takes no memory."""

    def __init__(self, raw: Any, size: int) -> None:
        super().__init__(raw)
        self.size = size

    def read(self, size: int | None = -1, /) -> bytes:
        left = max(self.size - self.tell(), 0)
        return super().read(left if size is None or size < 0 else min(size, left))


class _Inflating(io.RawIOBase):
    """`prefix`, then what `source` inflates to: as far as asked for, at most `limit` bytes."""

    def __init__(self, source: BinaryIO, prefix: bytes, limit: int, path: Path) -> None:
        super().__init__()
        self._source = source
        self._engine = zlib.decompressobj(-zlib.MAX_WBITS)
        self._data = bytearray(prefix)
        self._at = 0
        self._ended = False
        self._path = path
        self.limit = limit

    def readable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def tell(self) -> int:
        return self._at

    def seek(self, offset: int, whence: int = 0, /) -> int:
        base = (0, self._at, len(self._data))[whence]
        self._at = max(0, base + offset)
        return self._at

    def read(self, size: int | None = -1, /) -> bytes:
        end = self.limit + 1 if size is None or size < 0 else self._at + size
        self._inflate_to(end)
        part = bytes(memoryview(self._data)[self._at : end])
        self._at += len(part)
        return part

    def _inflate_to(self, end: int) -> None:
        while not self._ended and len(self._data) < end:
            if len(self._data) >= self.limit:
                raise LimitError(
                    f"the deflated data set inflates to more than {binary_size(self.limit)}",
                    file=self._path,
                    field="TransferSyntaxUID",
                    fix="the header does not declare that much: the file is broken or hostile",
                )
            packed = self._engine.unconsumed_tail or self._source.read(_STEP)
            part = self._engine.decompress(packed, _STEP)
            self._data += part
            self._ended = self._engine.eof or (not part and not packed)


@contextmanager
def guarded(path: Path) -> Iterator[None]:
    """Turn whatever pydicom and the codecs raise into an InputError that names the file."""
    from pydicom.config import disable_value_validation

    def explain(error: Exception) -> VolvizError:
        return InputError(
            f"the DICOM data set cannot be decoded ({type(error).__name__})",
            file=path,
            fix="the file is damaged: copy it again",
        )

    with library_errors(path, explain), disable_value_validation():
        yield


@contextmanager
def open_dicom(path: Path, limits: Limits, tags: Sequence[str] | None = None) -> Iterator[Any]:
    """The header as a pydicom Dataset and the stream behind it: `with … as (dataset, stream)`.

    Reads up to the pixels. `tags`: keywords to keep (None: all). Raises InputError for a file
    that is no DICOM or broken, LimitError for one that inflates without end.
    """
    with guarded(path), open_regular(path) as raw:
        stream: Any = _Clamped(raw, path.stat().st_size)
        stream = _inflated(stream, limits, path)
        import pydicom

        head = stream.read(132)
        stream.seek(0)
        marked = head[128:] == b"DICM"
        dataset = pydicom.dcmread(
            stream, stop_before_pixels=True, specific_tags=tags and list(tags), force=not marked
        )
        yield dataset, stream


def pixel_element(dataset: Any, stream: Any) -> PixelElement | None:
    """The pixel element at which `open_dicom` stopped, None if the data set has none."""
    implicit, little = dataset.original_encoding
    order = "<" if little else ">"
    start = stream.tell()
    head = stream.read(12)
    stream.seek(start)
    if len(head) < 12:
        return None
    group, element = struct.unpack(order + "HH", head[:4])
    keyword = _PIXEL_TAGS.get(group << 16 | element)
    if keyword is None:
        return None
    # An explicit VR read as a length would be odd, which no length is: so this tells them apart.
    explicit = not implicit or head[4:8] in tuple(vr + b"\0\0" for vr in _LONG_VRS)
    vr = head[4:6] if explicit else b"OW"
    (length,) = struct.unpack(order + "L", head[8:12] if explicit else head[4:8])
    offset = start + (12 if explicit else 8)
    return PixelElement(keyword, vr, offset, None if length == 0xFFFFFFFF else length, not little)


def raise_cap(stream: Any, nbytes: int) -> None:
    """Let a deflated data set go on for this many bytes: what its header declares as pixels."""
    if isinstance(stream, _Inflating):
        stream.limit = max(stream.limit, stream.tell() + nbytes + _STEP)


def text_of(dataset: Any, keyword: str) -> str:
    """A header value as text, "" where it is missing or broken."""
    try:
        value = dataset.get(keyword)
        return "" if value is None else str(value).strip()
    except Exception:  # lazy conversion of a broken value raises any type
        return ""


def numbers_of(dataset: Any, keyword: str, count: int | None = None) -> tuple[float, ...] | None:
    """A header value as finite floats (exactly `count`, if given), None where it is not that."""
    try:
        value = dataset.get(keyword)
        if value is None or value == "":
            return None
        many = (
            [value]
            if isinstance(value, (str, int, float)) or not hasattr(value, "__len__")
            else value
        )
        found = tuple(float(v) for v in many)
    except Exception:  # lazy conversion of a broken value raises any type
        return None
    if not found or (count is not None and len(found) != count):
        return None
    return found if all(map(math.isfinite, found)) else None


def number_of(dataset: Any, keyword: str) -> float | None:
    """The first of `numbers_of`."""
    found = numbers_of(dataset, keyword)
    return found[0] if found else None


def whole_of(dataset: Any, keyword: str) -> int | None:
    """The same as a whole number."""
    found = number_of(dataset, keyword)
    return int(found) if found is not None and found == int(found) else None


def items_of(dataset: Any, keyword: str) -> Sequence[Any]:
    """The items of a sequence, empty where there are none."""
    try:
        return dataset.get(keyword) or ()
    except Exception:  # lazy conversion of a broken value raises any type
        return ()


def _inflated(stream: Any, limits: Limits, path: Path) -> Any:
    """The stream itself, or for a deflated data set one that inflates it as it is read."""
    head = stream.read(1024)
    stream.seek(0)
    start = _end_of_meta(head) if DEFLATED.encode() in head and head[128:132] == b"DICM" else None
    if start is None:
        return stream
    stream.seek(start)
    uid = EXPLICIT_LITTLE.encode() + b"\0"
    meta = b"\2\0\x10\0UI" + struct.pack("<H", len(uid)) + uid
    return _Inflating(stream, b"\0" * 128 + b"DICM" + meta, limits.max_header, path)


def _end_of_meta(head: bytes) -> int | None:
    """Offset behind group 0002, if that says the rest is deflated."""
    at, deflated = 132, False
    while head[at : at + 2] == b"\2\0":
        long = head[at + 4 : at + 6] in (b"OB", b"OW", b"UN", b"SQ", b"UT", b"OF")
        start = at + (12 if long else 8)
        form = "<L" if long else "<H"
        (length,) = struct.unpack(
            form, head[start - struct.calcsize(form) : start].ljust(struct.calcsize(form), b"\0")
        )
        if head[at + 2 : at + 4] == b"\x10\0":
            deflated = head[start : start + length].rstrip(b"\0 ") == DEFLATED.encode()
        at = start + length
    return at if deflated else None
