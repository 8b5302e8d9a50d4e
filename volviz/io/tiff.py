"""TIFF, BigTIFF, ImageJ hyperstacks, OME-TIFF, LSM; tags by tifffile.

Planes are slices. Voxel sizes come from OME, ImageJ or LSM; a plain TIFF's resolution is that of
paper and says nothing of a volume. World coordinates are the microscope's: no patient space.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from volviz.errors import InputError, UnsupportedError, VolvizError, safe_text
from volviz.io.choice import choice_note, chosen_index
from volviz.io.geometry import with_spacing
from volviz.io.guard import library_errors
from volviz.io.options import ReadOptions
from volviz.io.tiff_layout import layout_of
from volviz.io.tiff_pixels import final_dtype, read_planes
from volviz.io.tiff_plane import Layout
from volviz.model.volume import Volume, VolumeInfo

_MAX_FIELDS = 200
_MAX_TEXT = 20_000


def probe(path: Path, options: ReadOptions) -> VolumeInfo:
    """What `read` gives, from the page headers alone.

    Raises InputError for a broken file, UnsupportedError for colours without grey values or complex
    numbers, UsageError for a time or channel that is not there, LimitError.
    """
    with _opened(path) as tif:
        return _info(layout_of(tif, path, options), tif, path, options)


def read(path: Path, options: ReadOptions) -> Volume:
    """The volume `[z, y, x]` of one time and channel; only its planes are read.

    Raises as `probe` does, and UnsupportedError where a codec is missing, InputError where planes
    are missing, Cancelled.
    """
    with _opened(path) as tif:
        layout = layout_of(tif, path, options)
        info = _info(layout, tif, path, options)
        data, notes = read_planes(tif, layout, info.time, info.channel, path=path, options=options)
    return Volume(data, info.warn(*notes))


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """The file in tifffile, its log kept silent and its exceptions turned into ours."""
    logging.getLogger("tifffile").addHandler(logging.NullHandler())
    import tifffile

    with library_errors(path, lambda error: _explained(path, error)):  # noqa: SIM117
        with tifffile.TiffFile(path, _multifile=False) as tif:
            yield tif


def _explained(path: Path, error: Exception) -> VolvizError:
    text = safe_text(error, 120)
    if "requires the 'imagecodecs' package" in text:
        return UnsupportedError(text, file=path, fix="pip install 'volviz[codecs]'")
    return InputError(
        f"not readable as TIFF ({text or type(error).__name__})",
        file=path,
        fix="the file is damaged: copy it again",
    )


def _info(layout: Layout, tif: Any, path: Path, options: ReadOptions) -> VolumeInfo:
    time = chosen_index(options.time, layout.times, what="time", file=path)
    channel = chosen_index(options.channel, layout.channels, what="channel", file=path)
    affine, notes = _affine(layout, options)
    if layout.depth == 1:
        notes.append("the file holds one plane and is shown one sample thick")
    key = layout.key
    return VolumeInfo(
        format="TIFF" if layout.kind in ("pages", "shaped") else f"TIFF ({layout.kind})",
        dims=(layout.width, layout.height, layout.depth),
        dtype=final_dtype(layout),
        affine=affine,
        length_unit=_unit(layout, options),
        times=layout.times,
        time=time,
        channels=layout.channels,
        channel=channel,
        channel_names=layout.channel_names if len(layout.channel_names) == layout.channels else (),
        window=layout.window,
        fields=_fields(layout, tif),
        warnings=(
            *choice_note(layout.times, time, what="time"),
            *choice_note(layout.channels, channel, what="channel"),
            *layout.warnings,
            *notes,
        ),
        encoding="raw" if int(key.compression) == 1 else key.compression.name.lower(),
        stored_bytes=path.stat().st_size,
        source=path,
        name=(safe_text(layout.name, 80) or path.name).split(".")[0] or path.name,
    )


def _affine(layout: Layout, options: ReadOptions) -> tuple[np.ndarray, list[str]]:
    given = [s for s in layout.steps if s is not None]
    steps = [s if s is not None else (given[0] if given else 1.0) for s in layout.steps]
    affine = with_spacing(np.diag([*steps, 1.0]), options.spacing)
    if options.spacing is not None:
        return affine, []
    if not given:
        return affine, ["spacing unknown: 1 is assumed along every axis"]
    missing = [a for a, s in zip("xyz", layout.steps, strict=True) if s is None]
    if missing == ["z"] and layout.depth == 1:
        return affine, []
    if missing:
        return affine, [f"spacing along {', '.join(missing)} unknown: {given[0]:.4g} is assumed"]
    if layout.unit is None:
        return affine, ["the unit of the spacing is unknown"]
    return affine, []


def _unit(layout: Layout, options: ReadOptions) -> str | None:
    if options.spacing is not None:
        return "mm"
    return layout.unit if any(s is not None for s in layout.steps) else None


def _fields(layout: Layout, tif: Any) -> dict[str, str]:
    """The first page's tags, and ImageJ's own, as text."""
    fields = dict(layout.fields or {})
    for tag in tif.pages.first.tags:
        if len(fields) >= _MAX_FIELDS:
            break
        value = tag.value
        if isinstance(value, bytes) and len(value) > 64:
            fields[tag.name] = f"{len(value)} bytes"
        elif isinstance(value, (tuple, list, np.ndarray)) and len(value) > 16:
            fields[tag.name] = f"{len(value)} values"
        else:
            fields[tag.name] = safe_text(getattr(value, "name", value), _MAX_TEXT)
    return fields
