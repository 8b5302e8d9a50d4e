"""A rendered picture: pixels, what made them, and how to write them without losing anything."""

from __future__ import annotations

import io
from dataclasses import dataclass, field
from pathlib import Path

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

    def __array__(self, dtype: object = None, copy: bool | None = None) -> NDArray[np.uint8]:
        return np.array(self.pixels, dtype=dtype, copy=copy)  # type: ignore[call-overload]

    def encoded(self, form: str = "PNG") -> bytes:
        """The bytes of an image file."""
        from PIL import Image as Pillow
        from PIL.PngImagePlugin import PngInfo

        picture = Pillow.fromarray(np.ascontiguousarray(self.pixels))
        options: dict[str, object] = {}
        if form in WITHOUT_ALPHA:
            picture, options = picture.convert("RGB"), {"quality": 95}
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


def image_format(path: str | Path) -> str:
    """Pillow's name for the format of a file name."""
    suffix = Path(path).suffix.lower()
    if suffix not in FORMATS:
        raise UsageError(
            f"no image format is called '{suffix}'" if suffix else "the name has no suffix",
            file=path,
            fix="use .png (or .jpg, .tif, .webp)",
        )
    return FORMATS[suffix]


def check_size(size: tuple[int, int]) -> None:
    """Raise UsageError for a picture without pixels or with more than 2²⁸."""
    if len(size) != 2 or min(size) < 1 or size[0] * size[1] > MAX_PIXELS:
        raise UsageError(
            f"a picture of {'×'.join(map(str, size))} cannot be drawn",
            field="--size",
            fix="give WIDTHxHEIGHT, at least 1x1 and at most 16384x16384",
        )
