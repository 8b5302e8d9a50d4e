"""NumPy's .npy and .npz (NEP 1; headers by numpy.lib.format, voxels by the bounded loader).

Pickled objects are refused before anything is unpickled. The last three axes are z, y, x; what
four or five axes or a short last one mean is an assumption, and said.
"""

from __future__ import annotations

import gzip
import warnings
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from volviz.errors import InputError, UnsupportedError, UsageError, VolvizError, safe_text
from volviz.io.choice import choice_note, chosen_index
from volviz.io.dtypes import delivered
from volviz.io.geometry import with_spacing
from volviz.io.options import ReadOptions
from volviz.io.payload import Part, check_size, open_regular, read_parts, read_stream
from volviz.model.volume import Volume, VolumeInfo

_MAX_HEADER = 1 << 16
_FEW = 4
_MAX_MEMBERS = 10_000


@dataclass(frozen=True)
class _Array:
    """An array in a file. start: bytes before its samples; key: its name in an .npz."""

    dtype: np.dtype[Any]
    shape: tuple[int, ...]
    fortran: bool
    start: int
    key: str = ""
    encoding: str = "raw"


@dataclass(frozen=True)
class _Axes:
    """What the axes of a shape mean: one letter each out of t, c, z, y, x."""

    letters: str
    notes: tuple[str, ...] = ()

    def count(self, shape: tuple[int, ...], letter: str) -> int:
        return shape[self.letters.index(letter)] if letter in self.letters else 1


def probe(path: Path, options: ReadOptions) -> VolumeInfo:
    """What `read` gives, from the header alone.

    Raises InputError for pickles and broken headers, UnsupportedError for arrays that are no scalar
    field, UsageError that lists the arrays of an .npz where it is not clear which one is meant.
    """
    return _open(path, options)[1]


def read(path: Path, options: ReadOptions) -> Volume:
    """The volume `[z, y, x]`. Raises as `probe` does; LimitError, Cancelled."""
    array, info, axes = _open(path, options)
    if array.key:
        return Volume(_picked(_from_zip(path, array, options), axes, info), info)
    array, axes, block = _leading(array, axes, info)
    data, notes = _from_file(path, array, options, block)
    return Volume(_picked(data, axes, info), info.warn(*notes))


def _open(path: Path, options: ReadOptions) -> tuple[_Array, VolumeInfo, _Axes]:
    array = _choose(path, options) if _is_zip(path) else _single(path)
    axes = _axes(array, path)
    times, channels = axes.count(array.shape, "t"), axes.count(array.shape, "c")
    time = chosen_index(options.time, times, what="time", file=path)
    channel = chosen_index(options.channel, channels, what="channel", file=path)
    dims = tuple(axes.count(array.shape, a) for a in "xyz")
    affine = with_spacing(np.eye(4), options.spacing)
    notes = [] if options.spacing else ["spacing unknown: 1 is assumed along every axis"]
    info = VolumeInfo(
        format="NumPy",
        dims=(dims[0], dims[1], dims[2]),
        dtype=delivered(array.dtype),
        affine=affine,
        length_unit="mm" if options.spacing else None,
        times=times,
        time=time,
        channels=channels,
        channel=channel,
        fields={
            "shape": str(array.shape),
            "dtype": str(array.dtype),
            "fortran_order": str(array.fortran),
            **({"key": safe_text(array.key)} if array.key else {}),
        },
        warnings=(
            *choice_note(times, time, what="time"),
            *choice_note(channels, channel, what="channel"),
            *axes.notes,
            *notes,
        ),
        encoding=array.encoding,
        stored_bytes=path.stat().st_size,
        source=path,
        name=path.name.split(".")[0],
    )
    return array, info, axes


# ------------------------------------------------------------------ headers


def _is_zip(path: Path) -> bool:
    with open_regular(path) as file:
        return file.read(4) == b"PK\x03\x04"


def _single(path: Path) -> _Array:
    with open_regular(path) as file:
        packed = file.read(2) == b"\x1f\x8b"
        file.seek(0)
        with _mapped(path, "header"):
            source = gzip.GzipFile(fileobj=file) if packed else file
            return _header(source, path, encoding="gzip" if packed else "raw")


def _header(file: Any, path: Path, *, key: str = "", encoding: str = "raw") -> _Array:
    """The header at the start of a stream; the stream is left at the first sample."""
    field = key or "header"
    counted = _Counted(file)
    with _mapped(path, field), warnings.catch_warnings():
        warnings.simplefilter("ignore")
        version = npy.read_magic(counted)
        reader = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}.get(version)
        # Version 3 is version 2 with UTF-8 field names, which only structured types have.
        reader = reader or npy.read_array_header_2_0
        shape, fortran, dtype = reader(counted, max_header_size=_MAX_HEADER)
    dtype = np.dtype(dtype)
    if dtype.hasobject:
        raise InputError(
            "the array holds Python objects; loading a pickle could run code",
            file=path,
            field=field,
            fix="save it as an array of numbers",
        )
    return _Array(dtype, tuple(int(n) for n in shape), bool(fortran), counted.at, key, encoding)


class _Counted:
    """A reader that counts, for streams that cannot tell where they are."""

    def __init__(self, file: Any) -> None:
        self._file = file
        self.at = 0

    def read(self, size: int = -1, /) -> bytes:
        data: bytes = self._file.read(min(size, _MAX_HEADER + 64) if size >= 0 else _MAX_HEADER)
        self.at += len(data)
        return data


@contextmanager
def _mapped(path: Path, field: str) -> Iterator[None]:
    """Turn what numpy, zipfile and zlib raise for broken files into InputError."""
    try:
        yield
    except VolvizError:
        raise
    except (zipfile.BadZipFile, zlib.error) as error:
        raise InputError(
            f"the archive is damaged ({safe_text(error, 120)})",
            file=path,
            field=field,
            fix="copy it again",
        ) from error
    except Exception as error:  # a hostile header makes the parser raise nearly any type
        text = safe_text(str(error).partition("\n")[0], 160)
        encrypted = type(error) in (NotImplementedError, RuntimeError)
        kind = UnsupportedError if encrypted else InputError
        raise kind(
            f"not readable as NumPy ({text or type(error).__name__})",
            file=path,
            field=field,
            fix="save it again with numpy" if encrypted else "the file is damaged: copy it again",
        ) from error


def _members(path: Path, options: ReadOptions) -> tuple[list[_Array], list[str]]:
    """The arrays of an .npz, and those whose header was refused, with the reason."""
    arrays: list[_Array] = []
    refused: list[str] = []
    with _mapped(path, "archive"), zipfile.ZipFile(path) as archive:
        names = [i for i in archive.infolist() if i.filename.endswith(".npy")][:_MAX_MEMBERS]
        for item in names:
            key = item.filename.removesuffix(".npy")
            try:
                with archive.open(item) as member:
                    encoding = "deflate" if item.compress_type else "raw"
                    arrays.append(_header(member, path, key=key, encoding=encoding))
            except InputError as error:
                if options.series == key or len(names) == 1:
                    raise
                refused.append(f"{safe_text(key, 40)} ({error.what})")
    return arrays, refused


def _choose(path: Path, options: ReadOptions) -> _Array:
    """The array of an .npz that is meant."""
    arrays, refused = _members(path, options)
    if options.series is not None:
        for array in arrays:
            if array.key == options.series:
                return array
        raise UsageError(
            f"there is no array '{safe_text(options.series, 60)}'; there are {_listed(arrays)}",
            file=path,
            field="series",
            fix="give one of these names",
        )
    grids = [a for a in arrays if len(a.shape) >= 3 and a.dtype.kind in "biuf"]
    if len(grids) == 1 or len(arrays) == 1:
        return (grids or arrays)[0]
    if not arrays:
        raise InputError(
            "no array of numbers in the archive"
            + (f": {'; '.join(refused[:3])}" if refused else ""),
            file=path,
            fix="save it again with numpy",
        )
    raise UsageError(
        f"several arrays: {_listed(grids or arrays)}",
        file=path,
        field="series",
        fix="choose one with --series NAME",
    )


def grids(path: Path, options: ReadOptions) -> tuple[str, ...]:
    """Names of the arrays of an .npz that may be volumes; of an .npy none."""
    if not _is_zip(path):
        return ()
    arrays, _ = _members(path, options)
    return tuple(a.key for a in arrays if len(a.shape) >= 3 and a.dtype.kind in "biuf")


def _listed(arrays: list[_Array]) -> str:
    shown = [f"{safe_text(a.key, 40)} {a.shape} {a.dtype}" for a in arrays[:8]]
    return ", ".join(shown) + (f" and {len(arrays) - 8} more" if len(arrays) > 8 else "")


# ------------------------------------------------------------------ what the axes mean


def _axes(array: _Array, path: Path) -> _Axes:
    """Letters for the axes of a shape. Raises UnsupportedError for what is no scalar field."""
    shape, dtype = array.shape, array.dtype
    field = array.key or "shape"
    if dtype.kind not in "biuf":
        kind = "fields (a structured type)" if dtype.names else f"samples of type {dtype}"
        raise UnsupportedError(
            f"an array of {kind}", file=path, field="dtype", fix="save one array of plain numbers"
        )
    if any(n < 1 for n in shape):
        raise InputError(
            f"the array of shape {shape} is empty",
            file=path,
            field=field,
            fix="save it again with numpy",
        )
    if len(shape) == 2 and shape[1] <= _FEW and shape[0] > shape[1]:
        raise UnsupportedError(
            f"an array of shape {shape} looks like {shape[0]} points, not like a volume",
            file=path,
            field=field,
            fix="points are not read yet; a volume has three axes z, y, x",
        )
    if not 2 <= len(shape) <= 5:
        raise UnsupportedError(
            f"an array with {len(shape)} axes",
            file=path,
            field=field,
            fix="a volume has three axes z, y, x, besides time and channels",
        )
    return _named_axes(shape)


def _named_axes(shape: tuple[int, ...]) -> _Axes:
    count = len(shape)
    last = shape[-1] <= _FEW and min(shape[-3:-1]) > _FEW
    if count == 2:
        return _Axes("yx", ("the array has two axes and is shown one sample thick",))
    if count == 3:
        if last and shape[-1] in (3, 4) and min(shape[:2]) >= 16:
            return _Axes("yxc", ("axes are taken as y, x, channel",))
        return _Axes("zyx")
    letters = {4: ("tzyx", "zyxc"), 5: ("tczyx", "tzyxc")}[count][last]
    names = {"t": "time", "c": "channel", "z": "z", "y": "y", "x": "x"}
    return _Axes(letters, ("axes are taken as " + ", ".join(names[a] for a in letters),))


# ------------------------------------------------------------------ voxels


def _leading(array: _Array, axes: _Axes, info: VolumeInfo) -> tuple[_Array, _Axes, int]:
    """Leave out leading axes t and c of a C-order array: only the chosen block is read."""
    lead = len(axes.letters) - len(axes.letters.lstrip("tc"))
    if array.fortran or not lead:
        return array, axes, 0
    at = 0
    for letter, size in zip(axes.letters[:lead], array.shape, strict=False):
        at = at * size + (info.time if letter == "t" else info.channel)
    rest = _Array(array.dtype, array.shape[lead:], False, array.start, array.key, array.encoding)
    return rest, _Axes(axes.letters[lead:]), at


def _from_file(
    path: Path, array: _Array, options: ReadOptions, block: int
) -> tuple[NDArray[Any], tuple[str, ...]]:
    order = array.shape[::-1] if array.fortran else array.shape
    size = check_size(order, array.dtype, options, file=path, field="shape")
    before = array.start + block * size
    packed = array.encoding == "gzip"
    part = Part(path, 0 if packed else before, size, skip=before if packed else 0)
    data, notes = read_parts(
        [part],
        array.dtype,
        order,
        encoding=array.encoding,
        options=options,
        file=path,
        field="data",
        trailing=False,
    )
    return (data.T if array.fortran else data), notes


def _from_zip(path: Path, array: _Array, options: ReadOptions) -> NDArray[Any]:
    order = array.shape[::-1] if array.fortran else array.shape
    check_size(order, array.dtype, options, file=path, field=array.key)
    with (
        _mapped(path, array.key),
        zipfile.ZipFile(path) as archive,
        archive.open(f"{array.key}.npy") as member,
    ):
        member.read(array.start)
        source: Any = member
        data = read_stream(source, array.dtype, order, options=options, file=path, field=array.key)
    return data.T if array.fortran else data


def _picked(whole: NDArray[Any], axes: _Axes, info: VolumeInfo) -> NDArray[Any]:
    """[z, y, x] out of the axes that are left."""
    index = tuple({"t": info.time, "c": info.channel}.get(a, slice(None)) for a in axes.letters)
    data = whole[index]
    return data[None] if data.ndim == 2 else data
