"""Pictures: a folder of PNG, JPEG, BMP or TIFF slices in the order of their numbers, or one.

8- and 16-bit grey keeps its values; colour becomes luminance. Sizes are checked before anything is
decoded. Pillow reads the pictures, the TIFF reader those that are TIFF.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import InputError, LimitError, UnsupportedError, VolvizError, safe_text
from volviz.io import sniff, tiff
from volviz.io.choice import chosen_index
from volviz.io.geometry import with_spacing
from volviz.io.guard import library_errors
from volviz.io.luminance import luminance
from volviz.io.naming import natural_key, numbering_gaps
from volviz.io.options import ReadOptions
from volviz.io.payload import check_size
from volviz.model.volume import Volume, VolumeInfo

_GREY = {
    "1": "u1",
    "L": "u1",
    "LA": "u1",
    "I;16": "u2",
    "I;16B": "u2",
    "I;16L": "u2",
    "I": "i4",
    "F": "f4",
}
_COLOUR = ("RGB", "RGBA", "P", "PA", "RGBX", "YCbCr")
_FORMATS = ("PNG", "JPEG", "BMP", "DIB")


@dataclass(frozen=True)
class _Picture:
    """What a picture's header says. mode: Pillow's, or a type's name for TIFF."""

    path: Path
    width: int
    height: int
    mode: str
    dtype: np.dtype[Any]
    frames: int = 1
    info: VolumeInfo | None = None

    @property
    def colour(self) -> bool:
        return self.info is None and self.mode in _COLOUR

    def describe(self) -> str:
        return f"{self.width} × {self.height} {self.mode}"


def probe(path: Path, options: ReadOptions) -> VolumeInfo:
    """What `read` gives, from the headers of the first and (in `read`) every picture.

    Raises InputError for a folder without pictures or broken ones, UnsupportedError for CMYK and
    animations, LimitError.
    """
    files, notes = _slices(path, options)
    return _info(path, files, _header(files[0], options), notes, options)


def read(path: Path, options: ReadOptions) -> Volume:
    """The volume `[z, y, x]`, one slice per picture.

    Raises as `probe` does; InputError naming the first picture of another size or mode; Cancelled.
    """
    files, notes = _slices(path, options)
    first = _header(files[0], options)
    info = _info(path, files, first, notes, options)
    check_size(info.dims, first.dtype, options, file=path, field="width, height, slices")
    out = np.empty(info.shape, dtype=first.dtype)
    for z, file in enumerate(files):
        options.progress(z / len(files), f"reading slice {z + 1} of {len(files)}")
        picture = _header(file, options)
        _same(picture, first)
        out[z] = _pixels(picture, options)
    options.progress(1.0, "all slices read")
    return Volume(out, info)


def _slices(path: Path, options: ReadOptions) -> tuple[list[Path], list[str]]:
    """The slices in natural order, and notes on gaps and on what else lies there."""
    if not path.is_dir():
        return [path], ["one picture is shown one sample thick"]
    named = [p for p in sniff.files_in(path) if sniff.is_slice_name(p.name)]
    named = [p for p in named if not p.name.startswith(".")]
    if not named:
        raise InputError(
            f"no pictures in this folder ({sniff.folder_summary(path)})",
            file=path,
            fix="give a folder of PNG, JPEG, BMP or TIFF slices",
        )
    if len(named) > options.limits.max_files:
        raise LimitError(
            f"more than {options.limits.max_files} files",
            file=path,
            fix="give a folder with fewer pictures",
        )
    named.sort(key=lambda p: (natural_key(p.name), p.name))
    notes = []
    gaps = numbering_gaps([p.name for p in named])
    if gaps:
        listed = ", ".join(map(str, gaps[:8])) + (" …" if len(gaps) > 8 else "")
        notes.append(
            f"{len(gaps)} numbers are missing among the slices ({listed}); the gaps are closed"
        )
    suffixes = {p.suffix.lower().replace("jpeg", "jpg").replace("tiff", "tif") for p in named}
    if len(suffixes) > 1:
        notes.append(f"slices of several kinds: {', '.join(sorted(suffixes))}")
    return named, notes


def _same(picture: _Picture, first: _Picture) -> None:
    if (picture.width, picture.height, picture.mode) != (first.width, first.height, first.mode):
        raise InputError(
            f"this slice is {picture.describe()}, the first ({safe_text(first.path.name, 60)}) is "
            f"{first.describe()}",
            file=picture.path,
            fix="put only slices of one size and mode into the folder",
        )


def _info(
    path: Path, files: Sequence[Path], first: _Picture, notes: list[str], options: ReadOptions
) -> VolumeInfo:
    chosen_index(options.time, 1, what="time", file=path)
    chosen_index(
        options.channel, first.info.channels if first.info else 1, what="channel", file=path
    )
    affine, unit, more = np.eye(4), None, ["spacing unknown: 1 is assumed along every axis"]
    if first.info is not None and first.info.length_unit is not None:
        affine, unit = first.info.affine, first.info.length_unit
        more = ["spacing along z unknown: that of the pixels is assumed"] if len(files) > 1 else []
    if first.colour:
        notes = [*notes, "the colours are shown as luminance (Rec. 709)"]
    kind = "TIFF" if first.info is not None else first.path.suffix.lstrip(".").upper()
    return VolumeInfo(
        format=f"{kind or 'image'} slices" if path.is_dir() else kind or "image",
        dims=(first.width, first.height, len(files)),
        dtype=first.dtype,
        affine=with_spacing(affine, options.spacing),
        length_unit="mm" if options.spacing else unit,
        channels=first.info.channels if first.info else 1,
        channel=options.channel,
        fields={"mode": first.mode, "first": first.path.name, "last": files[-1].name},
        warnings=(*notes, *([] if options.spacing else more)),
        encoding=kind.lower() or "image",
        stored_bytes=sum(p.stat().st_size for p in files),
        source=path,
        name=path.resolve().name if path.is_dir() else path.stem,
    )


def _header(path: Path, options: ReadOptions) -> _Picture:
    if sniff.is_tiff(sniff.head(path)):
        info = tiff.probe(path, replace(options, spacing=None))
        if info.dims[2] > 1 or info.times > 1:
            raise InputError(
                f"{info.dims[2] * info.times} planes in a TIFF; in a folder each file is one slice",
                file=path,
                fix="open that file itself",
            )
        return _Picture(
            path, info.dims[0], info.dims[1], f"{info.dtype} TIFF", info.dtype, info=info
        )
    with _opened(path, options) as image:
        mode, frames = image.mode, int(getattr(image, "n_frames", 1))
        if frames > 1:
            raise UnsupportedError(
                f"an animation of {frames} frames", file=path, fix="save the frames as single files"
            )
        if mode not in _GREY and mode not in _COLOUR:
            raise UnsupportedError(
                f"pictures in {safe_text(mode, 20)} are not read",
                file=path,
                fix="save it as grey or RGB",
            )
        dtype = np.dtype(_GREY.get(mode, "u1"))
        check_size((*image.size, 4), dtype, options, file=path, field="width, height")
        width, height = image.size
        return _Picture(path, width, height, mode, dtype)


def _pixels(picture: _Picture, options: ReadOptions) -> NDArray[Any]:
    """[y, x] of a picture whose header was looked at."""
    if picture.info is not None:
        quiet = replace(options, spacing=None)
        return tiff.read(picture.path, quiet).data[0]
    with _opened(picture.path, options) as image:
        if picture.colour:
            return luminance(np.asarray(image.convert("RGB")))
        if picture.mode == "LA":
            return np.asarray(image.getchannel("L"))
        array = np.asarray(image)
        return array.astype(picture.dtype, copy=False)


@contextmanager
def _opened(path: Path, options: ReadOptions) -> Iterator[Any]:
    """The picture in Pillow, its exceptions turned into ours; the pixels are not decoded yet."""
    from PIL import Image

    # Pillow warns of large pictures; the limit of the options is checked here instead.
    with library_errors(path, lambda error: _explained(path, error)):  # noqa: SIM117
        with Image.open(path, formats=_FORMATS) as image:
            yield image


def _explained(path: Path, error: Exception) -> VolvizError:
    from PIL import Image, UnidentifiedImageError

    if isinstance(error, Image.DecompressionBombError):
        return LimitError(
            f"the picture has more than {2 * (Image.MAX_IMAGE_PIXELS or 0)} pixels",
            file=path,
            field="width, height",
            fix="cut it into smaller ones",
        )
    if isinstance(error, UnidentifiedImageError):
        return InputError(
            "not readable as a picture", file=path, fix="it is damaged or no PNG, JPEG or BMP"
        )
    return InputError(
        f"the picture is damaged ({safe_text(error, 100)})", file=path, fix="copy it again"
    )
