"""Where the planes of a TIFF's volume lie: OME, ImageJ, LSM, STK, tifffile's own, plain pages."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import InputError, LimitError, UnsupportedError
from volviz.io.luminance import luminance
from volviz.io.options import ReadOptions
from volviz.io.tiff_imagej import imagej_layout, lsm_layout
from volviz.io.tiff_ome import parse_ome
from volviz.io.tiff_plane import Layout, Plane

MAX_PAGES = 1_000_000
_RGB, _YCBCR, _PALETTE, _MINISWHITE = 2, 6, 3, 0
_UNREADABLE = {5: "CMYK", 8: "CIELab", 9: "ICCLab", 10: "ITULab", 32844: "LogL", 32845: "LogLuv"}


def layout_of(tif: Any, path: Path, options: ReadOptions) -> Layout:
    """The layout of an open TiffFile. Raises InputError, UnsupportedError, LimitError."""
    count = len(tif.pages)
    if count == 0:
        raise InputError("the file has no page", file=path, fix="it is cut off: copy it again")
    if count > MAX_PAGES:
        raise LimitError(
            f"{count} pages; the limit is {MAX_PAGES}", file=path, fix="split the file"
        )
    _check_chain(tif, count, path)
    if tif.is_ome:
        return _checked(_ome(tif, path, count, options), path)
    own = tif.is_shaped or tif.is_lsm or tif.is_imagej or tif.is_stk or tif.is_fluoview
    if own and not (tif.is_mmstack or tif.is_ndtiff):
        series = tif.series[0]
        layout = _series(series, series.kind)
        if tif.is_imagej:
            layout = imagej_layout(layout, tif.imagej_metadata or {}, path)
        elif tif.is_lsm:
            layout = lsm_layout(layout, tif.lsm_metadata or {})
        more = len(tif.series) - 1
        if more:
            layout = replace(
                layout, warnings=(*layout.warnings, f"{more} further image series left out")
            )
        return _checked(layout, path)
    return _checked(_plain(tif, options), path)


def _check_chain(tif: Any, count: int, path: Path) -> None:
    """Raise InputError where the chain of pages does not end but is lost or runs in a circle."""
    form, file = tif.tiff, tif.filehandle
    start = int(tif.pages[count - 1].offset)
    file.seek(start)
    (tags,) = struct.unpack(form.tagnoformat, file.read(form.tagnosize))
    file.seek(start + form.tagnosize + tags * form.tagsize)
    (beyond,) = struct.unpack(form.offsetformat, file.read(form.offsetsize))
    if beyond:
        raise InputError(
            f"after page {count} the chain of pages leads "
            + ("out of the file" if beyond >= file.size else "nowhere or back to an earlier page"),
            file=path,
            field=f"IFD {count}",
            fix="the file is cut off or damaged: copy it again",
        )


def _refuse_unreadable(key: Any, path: Path) -> None:
    """Raise UnsupportedError for what has no values to show."""
    photometric = int(key.photometric or 0)
    if photometric in _UNREADABLE:
        raise UnsupportedError(
            f"{_UNREADABLE[photometric]} colours",
            file=path,
            field="PhotometricInterpretation",
            fix="save it as grey or RGB",
        )
    if key.dtype is None or key.dtype.kind not in "uifb":
        raise UnsupportedError(
            f"values of type {key.dtype} have no order to show",
            file=path,
            field="SampleFormat",
            fix="save real or integer values",
        )


def _checked(layout: Layout, path: Path) -> Layout:
    """The layout with what its samples mean: colours, channels, indices of a palette."""
    key = layout.key
    _refuse_unreadable(key, path)
    photometric = int(key.photometric or 0)
    notes = list(layout.warnings)
    samples = int(key.samplesperpixel)
    colour = photometric in (_RGB, _YCBCR) and samples >= 3 and key.dtype.kind == "u"
    channels = layout.channels
    if colour:
        notes.append("the colours are shown as luminance (Rec. 709)")
    elif samples > 1:
        channels *= samples
    palette = None
    if photometric == _PALETTE:
        palette = _palette(layout)
        notes.append(
            "the colour table is for display: the stored values are shown"
            if palette is None
            else "the colours of the palette are shown as luminance (Rec. 709)"
        )
    if photometric == _MINISWHITE and key.bitspersample > 1:
        notes.append(
            "MinIsWhite: low values are meant to be shown bright; values are kept as they are"
        )
    return replace(
        layout,
        colour=colour,
        sampled=samples > 1 and not colour,
        palette=palette,
        channels=channels,
        warnings=tuple(notes),
    )


def _palette(layout: Layout) -> NDArray[np.uint8] | None:
    """Luminance of each index, or None where a microscope's table only colours measured values."""
    table = layout.key.colormap
    if layout.kind not in ("pages", "shaped") or table is None or layout.key.dtype != np.uint8:
        return None
    entries = np.zeros((256, 3), dtype=np.uint16)
    found = np.asarray(table, dtype=np.uint16).reshape(3, -1).T[:256]
    entries[: len(found)] = found
    grey = luminance(entries)
    return (grey // 257 if grey.max() > 255 else grey).astype(np.uint8)


# ------------------------------------------------------------------ OME


def _ome(tif: Any, path: Path, count: int, options: ReadOptions) -> Layout:
    pixels, images = parse_ome(tif.ome_metadata, path, count, options.limits)
    tif.pages.useframes = True
    tif.pages.set_keyframe(0)
    key = tif.pages.first
    sizes = pixels.sizes
    if (key.imagewidth, key.imagelength) != (sizes["X"], sizes["Y"]):
        raise InputError(
            f"the pages are {key.imagewidth} × {key.imagelength}, the OME-XML says "
            f"{sizes['X']} × {sizes['Y']}",
            file=path,
            field="SizeX, SizeY",
            fix="the file is damaged: copy it again",
        )

    def plane(t: int, c: int, z: int) -> Plane | None:
        found = pixels.planes.get((t, c, z))
        if found is None:
            return None
        name, number = found
        return Plane(name=name, number=number) if name else Plane(page=tif.pages[number])

    notes = [f"{images - 1} further images left out"] if images > 1 else []
    if any(pixels.steps) and not all(pixels.steps):
        notes.append("PhysicalSize is not given for every axis")
    return Layout(
        "OME",
        key,
        sizes["T"],
        sizes["C"],
        sizes["Z"],
        plane,
        steps=pixels.steps,
        unit=pixels.unit,
        name=pixels.name,
        channel_names=pixels.channels,
        warnings=tuple(notes),
    )


# ------------------------------------------------------------------ series that tifffile lays out


def _series(series: Any, kind: str) -> Layout:
    """A layout from the axes of a TiffPageSeries: letters and lengths, slowest first."""
    key = series.keyframe
    axes, shape = series.get_axes(False), series.get_shape(False)
    if axes.endswith("S") and shape[-1] == 1 and not key.axes.endswith("S"):
        axes, shape = axes[:-1], shape[:-1]  # a sample axis that the page does not have
    inside = len(key.shape)
    lead, sizes = axes[: len(axes) - inside], shape[: len(axes) - inside]
    roles = _roles(lead, sizes, has_depth="Z" in key.axes)
    counts = {r: math.prod(s for s, x in zip(sizes, roles, strict=True) if x == r) for r in "TCZ"}
    offset = series.dataoffset
    nbytes = int(key.nbytes)
    depth = int(key.imagedepth) if "Z" in key.axes else 1

    def plane(t: int, c: int, z: int) -> Plane | None:
        k = _flat({"T": t, "C": c, "Z": z // depth}, roles, sizes)
        if offset is not None:
            return Plane(page=key, offset=offset + k * nbytes + (z % depth) * (nbytes // depth))
        try:
            page = series[k]
        except IndexError:
            return None
        return None if page is None else Plane(page=page)

    return Layout(kind, key, counts["T"], counts["C"], counts["Z"] * depth, plane)


def _roles(axes: str, sizes: Sequence[int], *, has_depth: bool) -> list[str]:
    """T, C or Z for each leading axis. An unnamed one next to y is z if none is, else time."""
    roles = [{"T": "T", "C": "C", "Z": "Z", "S": "C"}.get(a, "?") for a in axes]
    unnamed = [k for k, r in enumerate(roles) if r == "?"]
    if not has_depth and not any(r == "Z" and s > 1 for r, s in zip(roles, sizes, strict=True)):
        long = [k for k in unnamed if sizes[k] > 1]
        if long:
            roles[long[-1]] = "Z"
    return ["T" if r == "?" else r for r in roles]


def _flat(place: Mapping[str, int], roles: Sequence[str], sizes: Sequence[int]) -> int:
    """Index of a plane among all, where several axes may share a role."""
    left = dict(place)
    index, step = 0, 1
    for role, size in zip(reversed(roles), reversed(sizes), strict=True):
        left[role], at = divmod(left[role], size)
        index += at * step
        step *= size
    return index


# ------------------------------------------------------------------ plain pages


def _plain(tif: Any, options: ReadOptions) -> Layout:
    """The pages of the size and type that hold the most voxels, as slices; thumbnails left out."""
    count = len(tif.pages)
    groups: dict[tuple[Any, ...], list[Any]] = {}
    for k in range(count):
        if k % 64 == 0:
            options.progress(k / count, f"reading page header {k + 1} of {count}")
        page = tif.pages[k]
        key = (page.shape, str(page.dtype), int(page.photometric or 0), int(page.samplesperpixel))
        if not (page.is_reduced or page.is_mask) or count == 1:
            groups.setdefault(key, []).append(page)
    if not groups:
        groups = {(): [tif.pages[0]]}
    best = max(groups.values(), key=lambda pages: len(pages) * math.prod(pages[0].shape))
    depth = int(best[0].imagedepth) if "Z" in best[0].axes else 1
    nbytes = int(best[0].nbytes)

    def plane(t: int, c: int, z: int) -> Plane | None:
        page = best[z // depth]
        if depth == 1:
            return Plane(page=page)
        if not page.is_final:
            return None
        return Plane(page=page, offset=page.dataoffsets[0] + z % depth * (nbytes // depth))

    others = [pages for pages in groups.values() if pages is not best]
    notes = [_left_out(others)] if others else []
    return Layout("pages", best[0], 1, 1, len(best) * depth, plane, warnings=tuple(notes))


def _left_out(groups: Sequence[Sequence[Any]]) -> str:
    listed = [
        f"{len(pages)} × {pages[0].imagewidth} × {pages[0].imagelength} {pages[0].dtype}"
        for pages in groups[:4]
    ]
    total = sum(map(len, groups))
    return f"{total} pages of another size or type left out: {', '.join(listed)}"
