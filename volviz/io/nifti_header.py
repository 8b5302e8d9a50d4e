"""The 348 or 540 bytes of a NIfTI or Analyze header and the files that belong to it.

https://nifti.nimh.nih.gov/nifti-1, /nifti-2. The fields are unpacked by nibabel, without its
checks, which repair or reject by rules of their own; what matters is checked here.
"""

from __future__ import annotations

import os
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from volviz.errors import InputError, UnsupportedError
from volviz.io.decode import Inflated
from volviz.io.options import ReadOptions
from volviz.io.payload import open_regular, resolve_sibling
from volviz.progress import silent

_SIZE1, _SIZE2 = 348, 540
_SINGLE, _PAIR = (b"n+1\0", b"n+2\0"), (b"ni1\0", b"ni2\0")
_DTYPES = {
    2: "u1",
    4: "i2",
    8: "i4",
    16: "f4",
    32: "c8",
    64: "f8",
    128: "u1",
    256: "i1",
    512: "u2",
    768: "u4",
    1024: "i8",
    1280: "u8",
    1792: "c16",
    2304: "u1",
}
_COLOURS = {128: 3, 2304: 4}
_NOT_READ = {1: "1-bit", 1536: "128-bit float", 2048: "256-bit complex"}


@dataclass(frozen=True)
class NiftiHeader:
    """format: "NIfTI-1", "NIfTI-2" or "Analyze 7.5". raw: nibabel's header object.

    path, data_path: files of the header and of the voxels (the same for .nii). gzipped: whether
    the voxels are. dims: x, y, z, times, vectors (dim[5] to dim[7] multiplied). dimension: dim[0].
    colours: samples per voxel of an RGB type, else 1. data_offset: decoded bytes before the voxels.
    """

    format: str
    raw: Any
    path: Path
    data_path: Path
    gzipped: bool
    dimension: int
    dims: tuple[int, int, int, int, int]
    dtype: np.dtype[Any]
    colours: int
    data_offset: int

    def number(self, field: str, index: int | None = None) -> float:
        """A field, or one element of it, as a number."""
        value = self.raw[field]
        return float(value if index is None else value[index])

    def for_display(self) -> dict[str, str]:
        """The whole header as text."""
        return {key: _shown(self.raw[key]) for key in self.raw.keys()}  # noqa: SIM118


def read_nifti_header(path: Path, options: ReadOptions) -> NiftiHeader:
    """Read the header of a .nii, .hdr or .img, gzipped or not. Raises InputError."""
    header_path = _header_of(path, options)
    block, gzipped = _block(header_path)
    name, raw, single = _unpack(header_path, block)
    dimension, dims = _dims(header_path, raw)
    dtype, colours = _dtype(header_path, raw)
    if single:
        data_path = header_path
    else:
        data_path = _data_of(header_path, options)
        gzipped = _is_gzip(data_path)
    offset = _offset(header_path, raw, single=single)
    if offset > (options.limits.max_header if gzipped else data_path.stat().st_size):
        raise InputError(
            f"the voxels are said to begin at byte {offset}, beyond the file",
            file=header_path,
            field="vox_offset",
            fix="correct the header, or copy the file again",
        )
    return NiftiHeader(
        name, raw, header_path, data_path, gzipped, dimension, dims, dtype, colours, offset
    )


def _header_of(path: Path, options: ReadOptions) -> Path:
    """The header's file: the .hdr beside an .img, else the file itself."""
    lower = path.name.lower()
    for end in (".img", ".img.gz"):
        if lower.endswith(end):
            return _beside(path, path.name[: -len(end)], (".hdr", ".hdr.gz"), "header", options)
    return path


def _data_of(header: Path, options: ReadOptions) -> Path:
    lower = header.name.lower()
    ends = (".hdr.gz", ".hdr", ".nii.gz", ".nii")
    base = next((header.name[: -len(e)] for e in ends if lower.endswith(e)), header.stem)
    return _beside(header, base, (".img", ".img.gz"), "voxels", options)


def _beside(path: Path, base: str, ends: tuple[str, str], what: str, options: ReadOptions) -> Path:
    for end in (*ends, *(e.upper() for e in ends)):
        if os.path.exists(path.parent / (base + end)):
            return resolve_sibling(
                path, base + end, field=what, allow_outside=options.allow_outside
            )
    raise InputError(
        f"the {what} of this pair are missing; expected {path.parent / (base + ends[0])}",
        file=path,
        field=what,
        fix="put both files of the pair into one folder",
    )


def _is_gzip(path: Path) -> bool:
    """By content and name: plain voxels, too, may begin with those bytes."""
    with open_regular(path, field="voxels") as file:
        magic = file.read(3)
    return magic == b"\x1f\x8b\x08" and path.name.lower().endswith(".gz")


def _block(path: Path) -> tuple[bytes, bool]:
    """At most the first 540 bytes, inflated if need be; and whether they were gzipped."""
    with open_regular(path) as file:
        magic = file.read(2)
        file.seek(0)
        if magic != b"\x1f\x8b":
            return file.read(_SIZE2), False
        return _inflate(file, path), True


def _inflate(file: BinaryIO, path: Path) -> bytes:
    source = Inflated(file, "gzip", path=path, field="header", progress=silent())
    view = memoryview(bytearray(_SIZE2))
    at = 0
    while at < _SIZE2 and (count := source.readinto(view[at:])):
        at += count
    return bytes(view[:at])


def _unpack(path: Path, block: bytes) -> tuple[str, Any, bool]:
    """Format name, nibabel's header object, and whether header and voxels share a file."""
    import nibabel as nib

    if len(block) < _SIZE1:
        raise InputError(
            f"{len(block)} bytes are too few for a header",
            file=path,
            field="sizeof_hdr",
            fix="the file is cut off: copy it again",
        )
    for order in ("<", ">"):
        size = struct.unpack(order + "i", block[:4])[0]
        if size == _SIZE2 and block[4:8] in (_SINGLE[1], _PAIR[1]) and len(block) >= _SIZE2:
            raw = nib.Nifti2Header(block, endianness=order, check=False)
            return "NIfTI-2", raw, block[4:8] == _SINGLE[1]
        if size == _SIZE1 and block[344:348] in (_SINGLE[0], _PAIR[0]):
            raw = nib.Nifti1Header(block[:_SIZE1], endianness=order, check=False)
            return "NIfTI-1", raw, block[344:348] == _SINGLE[0]
        if size == _SIZE1 and path.name.lower().endswith((".hdr", ".hdr.gz")):
            raw = nib.Spm99AnalyzeHeader(block[:_SIZE1], endianness=order, check=False)
            return "Analyze 7.5", raw, False
    size = struct.unpack("<i", block[:4])[0]
    if size in (_SIZE1, _SIZE2) or struct.unpack(">i", block[:4])[0] in (_SIZE1, _SIZE2):
        raise InputError(
            "the mark 'n+1', 'ni1', 'n+2' or 'ni2' is missing",
            file=path,
            field="magic",
            fix="check that it is a NIfTI file",
        )
    raise InputError(
        f"it is {size}, not 348 (NIfTI-1) or 540 (NIfTI-2)",
        file=path,
        field="sizeof_hdr",
        fix="check that it is a NIfTI file",
    )


def _dims(path: Path, raw: Any) -> tuple[int, tuple[int, int, int, int, int]]:
    """dim[0], and x, y, z, times, vectors. Trailing zeros beyond z count as 1."""
    dim = [int(n) for n in raw["dim"]]
    dimension = dim[0]
    if not 1 <= dimension <= 7:
        raise InputError(
            f"dim[0] is {dimension}, not 1 to 7",
            file=path,
            field="dim",
            fix="correct the header, or copy the file again",
        )
    sizes = [dim[i] if i <= dimension else 1 for i in range(1, 8)]
    sizes[3:] = [1 if n == 0 else n for n in sizes[3:]]
    for axis, size in enumerate(sizes, start=1):
        if size < 1:
            raise InputError(
                f"dim[{axis}] is {size}, not positive",
                file=path,
                field="dim",
                fix="correct the header",
            )
    vectors = sizes[4] * sizes[5] * sizes[6]
    return dimension, (sizes[0], sizes[1], sizes[2], sizes[3], vectors)


def _dtype(path: Path, raw: Any) -> tuple[np.dtype[Any], int]:
    code = int(raw["datatype"])
    if code in _NOT_READ:
        raise UnsupportedError(
            f"{_NOT_READ[code]} voxels (code {code})",
            file=path,
            field="datatype",
            fix="save them as 32- or 64-bit floats",
        )
    if code not in _DTYPES:
        raise InputError(
            f"{code} is no code of a data type",
            file=path,
            field="datatype",
            fix="correct the header, or copy the file again",
        )
    return np.dtype(_DTYPES[code]).newbyteorder(raw.endianness), _COLOURS.get(code, 1)


def _offset(path: Path, raw: Any, *, single: bool) -> int:
    """Bytes before the voxels. 0 in a single file means right behind the header."""
    value = float(raw["vox_offset"])
    least = (int(raw["sizeof_hdr"]) + 4) if single else 0
    if value == 0:
        return least
    if not np.isfinite(value) or value < least or value != int(value):
        raise InputError(
            f"the voxels are said to begin at byte {value:g}; "
            + (f"the header ends at {least}" if single else "that is no place in a file"),
            file=path,
            field="vox_offset",
            fix="correct the header, or copy the file again",
        )
    return int(value)


def _shown(value: Any) -> str:
    array = np.asarray(value)
    if array.dtype.kind == "S":
        return array.tobytes().split(b"\0")[0].decode("latin-1").strip()
    return " ".join(f"{v:g}" if array.dtype.kind == "f" else str(v) for v in array.ravel().tolist())
