"""The one loader of voxels: sizes are bounded before memory is taken, every byte is filled.

A format's header says where its voxels lie (`Part`), in which encoding and how many. `read_parts`
allocates once, decodes exactly that many bytes into it and raises for one too few or, in a
compressed stream, one too many. No byte that a file did not fill is ever returned.
"""

from __future__ import annotations

import math
import os
import stat
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO, Protocol, cast

import numpy as np
from numpy.typing import DTypeLike, NDArray

from volviz.errors import InputError, LimitError, VolvizError
from volviz.io.decode import AsciiNumbers, HexBytes, Inflated
from volviz.io.detached import resolve_sibling
from volviz.io.options import ReadOptions
from volviz.io.sizes import check_size
from volviz.progress import Progress
from volviz.text import binary_size

__all__ = [
    "Part",
    "binary_size",
    "check_size",
    "open_regular",
    "part_range",
    "read_parts",
    "read_stream",
    "resolve_sibling",
    "taken",
]


STEP = 1 << 20
"""Bytes per decode call, so that progress is told and a cancel is seen."""
REST_CHECKED = 256 << 20
"""A compressed stream is decoded to its check sum if no more than this follows what is wanted."""
_SWAP_ITEMS = 1 << 20


@dataclass(frozen=True)
class Part:
    """A piece of the voxels in one file.

    offset: bytes before it in the file, as stored. nbytes: decoded bytes that it must give.
    skip: decoded bytes before those, -1 for "all but the last nbytes" of a compressed stream.
    rest: decoded bytes that the header declares after those.
    """

    path: Path
    offset: int = 0
    nbytes: int = 0
    skip: int = 0
    rest: int = 0


class ByteSource(Protocol):
    """What voxels are decoded from: fills at most the view, returns 0 only at the end."""

    def readinto(self, view: memoryview, /) -> int:
        """Bytes written to the start of the view."""
        ...


def open_regular(path: Path, *, field: str | None = None) -> BinaryIO:
    """The file opened unbuffered for reading. Pipes and devices are refused, never waited for."""
    try:
        flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
        if not stat.S_ISREG(os.stat(path).st_mode):
            raise InputError("not a regular file", file=path, field=field, fix="give a file")
        handle = os.open(path, flags | getattr(os, "O_CLOEXEC", 0))
    except FileNotFoundError as error:
        raise InputError("no such file", file=path, field=field, fix="check the path") from error
    except OSError as error:
        raise _os_error(error, path, field) from error
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        raise InputError("not a regular file", file=path, field=field, fix="give a file")
    return os.fdopen(handle, "rb", buffering=0)


def part_range(parts: Sequence[Part], start: int, nbytes: int) -> tuple[Part, ...]:
    """The parts that hold decoded bytes [start, start + nbytes) of all of them, cut to fit."""
    chosen = []
    at = 0
    for part in parts:
        low, high = max(start - at, 0), min(start + nbytes - at, part.nbytes)
        if low < high:
            skip = part.skip + low if part.skip >= 0 else -1
            rest = part.rest + part.nbytes - high
            if part.skip < 0 and (low, high) != (0, part.nbytes):
                raise ValueError("a part that is counted from the end cannot be cut")
            chosen.append(replace(part, nbytes=high - low, skip=skip, rest=rest))
        at += part.nbytes
    return tuple(chosen)


def read_parts(
    parts: Sequence[Part],
    dtype: DTypeLike,
    shape: Sequence[int],
    *,
    encoding: str,
    options: ReadOptions,
    file: str | os.PathLike[str],
    field: str = "data",
    trailing: bool = True,
) -> tuple[NDArray[Any], tuple[str, ...]]:
    """The voxels of all parts, one after the other, and warnings for the person.

    dtype: as stored, with its byte order; the array comes back in native order, C-contiguous, of
    `shape`. trailing: warn of bytes after the voxels (switch off where other things may follow).
    Raises InputError for too few bytes, too many in a compressed stream, a broken stream, a value
    that is no number; LimitError for more than `options.limits.max_bytes`; Cancelled.
    """
    stored = np.dtype(dtype)
    total = check_size(shape, stored, options, file=file, field=field)
    declared = sum(part.nbytes for part in parts)
    if declared != total:
        raise _short(declared, total, file, field)
    notes: list[str] = []
    if encoding == "raw":
        notes += _check_raw_sizes(parts, field, trailing)
    array = _allocate(shape, stored, file, field)
    view = array.reshape(-1).view(np.uint8).data
    at = 0
    for part in parts:
        low, high = at / total, (at + part.nbytes) / total
        job = _Job(part, encoding, stored, field, options.progress.part(low, high))
        most = part.nbytes + options.limits.max_header
        notes += job.read(view[at : at + part.nbytes], most=most, trailing=trailing)
        at += part.nbytes
    return _native(array, options.progress), tuple(dict.fromkeys(notes))


def read_stream(
    source: ByteSource,
    dtype: DTypeLike,
    shape: Sequence[int],
    *,
    options: ReadOptions,
    file: str | os.PathLike[str],
    field: str = "data",
) -> NDArray[Any]:
    """The voxels of an open stream (a member of a zip, say) that must hold exactly these bytes."""
    stored = np.dtype(dtype)
    check_size(shape, stored, options, file=file, field=field)
    array = _allocate(shape, stored, file, field)
    view = array.reshape(-1).view(np.uint8).data
    _Job(Part(Path(file)), "raw", stored, field, options.progress).fill(source, view)
    if source.readinto(memoryview(bytearray(1))):
        raise _excess(file, field)
    return _native(array, options.progress)


def taken(data: NDArray[Any], pick: tuple[int | slice, ...], progress: Progress) -> NDArray[Any]:
    """`data[pick]` as a contiguous array: itself where it is one, else copied piece by piece."""
    view: NDArray[Any] = data[pick]
    if view.flags.c_contiguous:
        return view
    out = np.empty(view.shape, dtype=view.dtype)
    for index in range(view.shape[0]):
        progress(None, "taking one channel")
        out[index] = view[index]
    return out


@dataclass(frozen=True)
class _Job:
    """Reading of one part: what every step needs to know to decode, to tell and to complain."""

    part: Part
    encoding: str
    dtype: np.dtype[Any]
    field: str
    progress: Progress

    def read(self, view: memoryview, *, most: int, trailing: bool) -> list[str]:
        """Fill the view; returns warnings. most: bound on a stream that is measured first."""
        part = self.part
        skip = part.skip if part.skip >= 0 else self.measure(most) - part.nbytes
        if skip < 0:
            raise _short(skip + part.nbytes, part.nbytes, part.path, self.field, self.encoding)
        try:
            with open_regular(part.path, field=self.field) as file:
                raw = self.encoding == "raw"
                file.seek(part.offset + (skip if raw else 0))
                source = self.source(file)
                if not raw:
                    self.drop(source, skip)
                self.fill(source, view)
                return self.finish(source, trailing)
        except OSError as error:
            raise _os_error(error, part.path, self.field) from error

    def source(self, file: BinaryIO) -> ByteSource:
        """What decodes this file from where it stands."""
        path = self.part.path
        if self.encoding == "raw":
            return cast(ByteSource, file)
        if self.encoding == "ascii":
            return AsciiNumbers(file, self.dtype, path, self.field)
        if self.encoding == "hex":
            return HexBytes(file, path, self.field)
        return Inflated(file, self.encoding, path=path, field=self.field, progress=self.progress)

    def fill(self, source: ByteSource, view: memoryview) -> None:
        """Every byte of the view, or InputError."""
        total, at = len(view), 0
        message = f"reading {self.part.path.name}"
        while at < total:
            self.progress(at / total, message)
            count = source.readinto(view[at : at + STEP])
            if not count:
                raise _short(at, total, self.part.path, self.field, self.encoding)
            at += count
        self.progress(1.0, message)

    def drop(self, source: ByteSource, count: int) -> None:
        """Decode and forget this many bytes."""
        scratch = memoryview(bytearray(min(max(count, 0), STEP)))
        left = count
        while left > 0:
            self.progress(None, f"skipping in {self.part.path.name}")
            got = source.readinto(scratch[: min(left, len(scratch))])
            if not got:
                raise _short(count - left, count, self.part.path, self.field, self.encoding)
            left -= got

    def finish(self, source: ByteSource, trailing: bool) -> list[str]:
        """Decode to the check sum, where that is not too far, and look at what follows."""
        rest, name = self.part.rest, self.encoding
        if name == "raw":
            return []
        if rest > REST_CHECKED:
            far = binary_size(rest)
            return [f"the check sum of the {name} stream was not read: it lies {far} further on"]
        self.drop(source, rest)
        more = source.readinto(memoryview(bytearray(self.dtype.itemsize)))
        if isinstance(source, Inflated):
            if more:
                raise _excess(self.part.path, self.field)
            follows = source.trailing
            return [f"bytes after the {name} stream were ignored"] if follows and trailing else []
        return ["text after the last value was ignored"] if more and trailing else []

    def measure(self, most: int) -> int:
        """Bytes that a compressed stream holds, refused beyond `most`."""
        scratch = memoryview(bytearray(STEP))
        size = 0
        try:
            with open_regular(self.part.path, field=self.field) as file:
                file.seek(self.part.offset)
                source = self.source(file)
                while got := source.readinto(scratch):
                    self.progress(None, f"measuring {self.part.path.name}")
                    size += got
                    if size > most:
                        raise _excess(self.part.path, self.field)
        except OSError as error:
            raise _os_error(error, self.part.path, self.field) from error
        return size


def _check_raw_sizes(parts: Sequence[Part], field: str, trailing: bool) -> list[str]:
    """Raise for a file that is too short before anything is allocated; tell of one too long."""
    notes = []
    for part in parts:
        try:
            size = part.path.stat().st_size
        except OSError as error:
            raise _os_error(error, part.path, field) from error
        needed = part.skip + part.nbytes + part.rest
        found = max(size - part.offset, 0)
        if found < needed:
            raise _short(found, needed, part.path, field)
        if found > needed and trailing:
            extra = f"{found - needed} extra byte{'s' if found - needed > 1 else ''}"
            notes.append(f"{extra} after the voxels in {part.path.name} ignored")
    return notes


def _allocate(
    shape: Sequence[int], dtype: np.dtype[Any], file: str | os.PathLike[str], field: str
) -> NDArray[Any]:
    try:
        return np.empty(tuple(int(n) for n in shape), dtype=dtype)
    except MemoryError as error:
        need = binary_size(math.prod(int(n) for n in shape) * dtype.itemsize)
        raise LimitError(
            f"the machine has no {need} of memory free",
            file=file,
            field=field,
            fix="close other programs",
        ) from error


def _native(array: NDArray[Any], progress: Progress) -> NDArray[Any]:
    """The same array in native byte order, swapped in place."""
    if array.dtype.isnative:
        return array
    flat = array.reshape(-1)
    for start in range(0, flat.size, _SWAP_ITEMS):
        progress(None, "swapping bytes")
        flat[start : start + _SWAP_ITEMS].byteswap(inplace=True)
    return array.view(array.dtype.newbyteorder("="))


def _short(
    found: int, needed: int, file: str | os.PathLike[str], field: str, encoding: str = "raw"
) -> InputError:
    percent = f"{100 * found / max(needed, 1):.3g} %"
    if encoding in ("gzip", "zlib", "bzip2"):
        what = f"the {encoding} stream ends at byte {found} of {needed} ({percent})"
    else:
        what = f"expected {needed} bytes, found {found} ({percent})"
    fix = "the file is cut off or its header is wrong: copy it again"
    return InputError(what, file=file, field=field, fix=fix)


def _excess(file: str | os.PathLike[str], field: str) -> InputError:
    return InputError(
        "more data than the header declares",
        file=file,
        field=field,
        fix="check sizes and type in the header",
    )


def _os_error(error: OSError, path: Path, field: str | None) -> VolvizError:
    what = (error.strerror or str(error)).lower()
    return InputError(what, file=path, field=field, fix="check the file and its disk")
