"""A rendered picture: pixels, what made them, and how to write them without losing anything."""

from __future__ import annotations

import io
import operator
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import SupportsIndex

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UsageError
from volviz.files import write_atomically

FORMATS = {
    ".png": "PNG",
    ".jpg": "JPEG",
    ".jpeg": "JPEG",
    ".tif": "TIFF",
    ".tiff": "TIFF",
    ".webp": "WEBP",
}
MAX_PIXELS = 1 << 28
LONGEST = {"JPEG": 65500, "WEBP": 16383}
WITHOUT_ALPHA = {"JPEG"}


@dataclass(frozen=True, eq=False)
class Image:
    """pixels: uint8[height, width, 4], sRGB, straight alpha, row 0 on top.

    renderer: the OpenGL that drew it. notes: what a person should be told about it. numpy takes
    it as an array; notebooks show it.
    """

    pixels: NDArray[np.uint8]
    renderer: str = ""
    notes: tuple[str, ...] = ()
    facts: dict[str, str] = field(default_factory=dict)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height."""
        return self.pixels.shape[1], self.pixels.shape[0]

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of `pixels`."""
        return self.pixels.shape

    def __repr__(self) -> str:
        width, height = self.size
        return f"<Image {width}×{height} {self.renderer}>"

    def __array__(self, dtype: object = None, copy: bool | None = None) -> NDArray[np.uint8]:
        return np.array(self.pixels, dtype=dtype, copy=copy)  # type: ignore[call-overload]

    def encoded(self, form: str = "PNG") -> bytes:
        """The bytes of an image file. JPEG has no opacity: there, black shows through."""
        _check_length(form, self.size, None)
        from PIL import Image as Pillow
        from PIL.PngImagePlugin import PngInfo

        picture = Pillow.fromarray(np.ascontiguousarray(self.pixels))
        options: dict[str, object] = {}
        if form in WITHOUT_ALPHA:
            black = Pillow.new("RGBA", picture.size, (0, 0, 0, 255))
            picture = Pillow.alpha_composite(black, picture).convert("RGB")
            options = {"quality": 95}
        elif form == "WEBP":
            options = {"lossless": True, "exact": True}
        elif form == "PNG":
            text = PngInfo()
            for key, value in self.facts.items():
                text.add_text(key, value)
            options = {"pnginfo": text, "compress_level": 6}
        buffer = io.BytesIO()
        picture.save(buffer, form, **options)
        return buffer.getvalue()

    def save(self, path: str | Path, *, overwrite: bool = True) -> None:
        """Write PNG, JPEG, TIFF or WebP by the suffix, atomically.

        Raises UsageError for another suffix and OutputError if the file cannot be written or is
        there and `overwrite` is false.
        """
        write_atomically(path, self.encoded(image_format(path)), overwrite=overwrite)

    def _repr_png_(self) -> bytes:
        return self.encoded()


def image_format(path: str | Path, size: tuple[int, int] | None = None) -> str:
    """Pillow's name for the format of a file name; UsageError for others, and for a size that
    the format cannot hold."""
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise UsageError(
            f"no image format is called '{suffix}'" if suffix else "the name has no suffix",
            file=path,
            fix="use .png (or .jpg, .tif, .webp)",
        )
    if size is not None:
        _check_length(FORMATS[suffix], size, path)
    return FORMATS[suffix]


def _check_length(form: str, size: tuple[int, int], path: str | Path | None) -> None:
    longest = LONGEST.get(form)
    if longest is not None and max(size) > longest:
        raise UsageError(
            f"{form} holds at most {longest} pixels along a side, not {max(size)}",
            file=path,
            fix="use .png",
        )


def check_size(size: Sequence[SupportsIndex], field: str = "--size") -> tuple[int, int]:
    """Width and height as ints; UsageError for a picture without pixels or with more than 2²⁸."""
    try:
        width, height = (operator.index(n) for n in size)
    except (TypeError, ValueError) as error:
        raise UsageError(
            f"{size!r} is no size", field="size", fix="give (width, height) in pixels"
        ) from error
    if min(width, height) < 1 or width * height > MAX_PIXELS:
        raise UsageError(
            f"a picture of {width}×{height} cannot be drawn",
            field=field,
            fix="give WIDTHxHEIGHT, at least 1x1 and at most 16384x16384",
        )
    return width, height
