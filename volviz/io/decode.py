"""Streams of decoded bytes: deflate and bzip2 under a cap, numbers in text, hexadecimal.

Each has `readinto(view)`, which decodes at most len(view) bytes, whatever a stream claims, and
returns 0 only at a proper end. RFC 1950–1952 for zlib and gzip; NRRD's "ascii" and "hex".
"""

from __future__ import annotations

import binascii
import bz2
import zlib
from pathlib import Path
from typing import Any, BinaryIO, Protocol

import numpy as np

from volviz.errors import InputError, safe_text
from volviz.progress import Progress

_INPUT = 1 << 18
_TEXT = 1 << 18
_TOKEN = 512
_WBITS = {"gzip": 31, "zlib": 47}
_MEMBER = {"gzip": b"\x1f\x8b", "bzip2": b"BZh"}
_BLANK = b" \t\r\n\v\f"


class _Decoder(Protocol):
    @property
    def eof(self) -> bool: ...
    @property
    def needs_input(self) -> bool: ...
    @property
    def unused_data(self) -> bytes: ...
    def decompress(self, data: bytes, cap: int, /) -> bytes: ...


class _Deflate:
    """zlib's decompressor with the interface of bz2's: what is not consumed is kept here."""

    def __init__(self, wbits: int) -> None:
        self._zlib = zlib.decompressobj(wbits)
        self._tail = b""

    @property
    def eof(self) -> bool:
        return self._zlib.eof

    @property
    def needs_input(self) -> bool:
        return not self._tail

    @property
    def unused_data(self) -> bytes:
        return self._zlib.unused_data

    def decompress(self, data: bytes, cap: int, /) -> bytes:
        out = self._zlib.decompress(data or self._tail, cap)
        self._tail = self._zlib.unconsumed_tail
        return out


class Inflated:
    """The content of a gzip (any number of members), zlib or bzip2 stream.

    `trailing` tells, at the end, whether other bytes follow the stream. The end is reached only
    with the stream's check sum right.
    """

    def __init__(
        self, source: BinaryIO, encoding: str, *, path: Path, field: str, progress: Progress
    ) -> None:
        self.encoding = encoding
        self.trailing = False
        self._source = source
        self._path, self._field = path, field
        self._progress = progress
        self._decoder: _Decoder | None = self._start()
        self._held = b""
        self._given = 0

    def readinto(self, view: memoryview, /) -> int:
        """Decoded bytes written to the view: at least one, 0 at the end. Raises InputError."""
        while self._decoder is not None:
            if self._decoder.eof:
                self._next_member()
                continue
            data, dry = b"", False
            if self._decoder.needs_input:
                data, self._held = self._held or self._read(), b""
                dry = not data
            part = self._decompress(self._decoder, data, len(view))
            if part:
                view[: len(part)] = part
                self._given += len(part)
                return len(part)
            if dry and not self._decoder.eof:
                raise self._broken(
                    f"the {self.encoding} stream ends at byte {self._given}, unfinished"
                )
        return 0

    def _start(self) -> _Decoder:
        if self.encoding == "bzip2":
            return bz2.BZ2Decompressor()
        return _Deflate(_WBITS[self.encoding])

    def _read(self) -> bytes:
        self._progress()
        return self._source.read(_INPUT) or b""

    def _decompress(self, decoder: _Decoder, data: bytes, cap: int) -> bytes:
        try:
            return decoder.decompress(data, cap)
        except (zlib.error, OSError, ValueError, EOFError) as error:
            reason = safe_text(error, 100)
            raise self._broken(
                f"the {self.encoding} stream is damaged at byte {self._given} ({reason})"
            ) from error

    def _next_member(self) -> None:
        """Go on with a further member of the stream, or end it."""
        assert self._decoder is not None
        follows = self._decoder.unused_data
        while len(follows) < 3 and (more := self._read()):
            follows += more
        magic = _MEMBER.get(self.encoding)
        if magic is not None and follows.startswith(magic):
            self._decoder, self._held = self._start(), follows
        else:
            self._decoder = None
            self.trailing = bool(follows.strip(b"\0"))

    def _broken(self, what: str) -> InputError:
        fix = "the file is cut off or damaged: copy or export it again"
        return InputError(what, fix=fix, file=self._path, field=self._field)


class AsciiNumbers:
    """Numbers in text, separated by blanks or commas, as the bytes of an array of `dtype`."""

    def __init__(self, source: BinaryIO, dtype: np.dtype[Any], path: Path, field: str) -> None:
        self._source = source
        self._dtype = dtype
        self._path, self._field = path, field
        self._text = b""
        self._ready = memoryview(b"")

    def readinto(self, view: memoryview, /) -> int:
        """Bytes of the next numbers written to the view, 0 at the end. Raises InputError."""
        while not self._ready:
            chunk = self._source.read(_TEXT)
            text = self._text + (chunk or b" ")
            cut = max(text.rfind(bytes((c,))) for c in _BLANK + b",")
            whole, self._text = text[: cut + 1], text[cut + 1 :]
            if len(self._text) > _TOKEN:
                raise self._error(self._text)
            tokens = whole.replace(b",", b" ").split()
            if tokens:
                self._ready = memoryview(self._parse(tokens))
            elif not chunk:
                return 0
        count = min(len(view), len(self._ready))
        view[:count] = self._ready[:count]
        self._ready = self._ready[count:]
        return count

    def _parse(self, tokens: list[bytes]) -> bytes:
        if max(map(len, tokens)) > _TOKEN:
            raise self._error(max(tokens, key=len))
        if self._dtype.kind == "f":
            with np.errstate(over="ignore"):
                values = np.array([self._number(float, t) for t in tokens]).astype(self._dtype)
            return values.tobytes()
        bounds = np.iinfo(self._dtype)
        whole = [self._number(int, t) for t in tokens]
        for value, token in zip(whole, tokens, strict=True):
            if not bounds.min <= value <= bounds.max:
                raise self._error(token)
        return np.array(whole, dtype=self._dtype).tobytes()

    def _number(self, kind: type, token: bytes) -> Any:
        try:
            return kind(token)
        except ValueError as error:
            raise self._error(token) from error

    def _error(self, token: bytes) -> InputError:
        shown = safe_text(token[:40].decode("latin-1"))
        return InputError(
            f"'{shown}' is no {self._dtype.name} value",
            file=self._path,
            field=self._field,
            fix="check type and encoding in the header",
        )


class HexBytes:
    """Pairs of hexadecimal digits as bytes; blanks do not count."""

    def __init__(self, source: BinaryIO, path: Path, field: str) -> None:
        self._source = source
        self._path, self._field = path, field
        self._digits = b""
        self._ready = memoryview(b"")

    def readinto(self, view: memoryview, /) -> int:
        """Bytes written to the view, 0 at the end. Raises InputError."""
        while not self._ready:
            chunk = self._source.read(_TEXT)
            if not chunk:
                return 0
            digits = self._digits + chunk.translate(None, _BLANK)
            even = len(digits) & ~1
            self._digits = digits[even:]
            try:
                self._ready = memoryview(binascii.unhexlify(digits[:even]))
            except binascii.Error as error:
                raise InputError(
                    "the data are no hexadecimal digits",
                    file=self._path,
                    field=self._field,
                    fix="check the encoding in the header",
                ) from error
        count = min(len(view), len(self._ready))
        view[:count] = self._ready[:count]
        self._ready = self._ready[count:]
        return count
