"""Where the planes of a TIFF's volume lie: OME, ImageJ, LSM, STK, tifffile's own, plain pages."""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from volviz.errors import InputError, LimitError, UnsupportedError, safe_text
from volviz.io.geometry import length_unit, mm_per
from volviz.io.luminance import luminance
from volviz.io.options import ReadOptions
from volviz.io.tiff_ome import parse_ome

MAX_PAGES = 1_000_000
_RGB, _YCBCR, _PALETTE, _MINISWHITE = 2, 6, 3, 0
_UNREADABLE = {5: "CMYK", 8: "CIELab", 9: "ICCLab", 10: "ITULab", 32844: "LogL", 32845: "LogLuv"}


@dataclass(frozen=True)
class Plane:
    """One plane.

    page: its IFD (None where it has none of its own); offset: of its raw bytes, if they lie one
    behind the other; name, number: file and page of a plane that lies in another file.
    """

    page: Any = None
    offset: int | None = None
    name: str = ""
    number: int = 0


@dataclass(frozen=True)
class Layout:
    """A volume in a TIFF.

    key: the page that stands for all; plane(t, c, z): where it is, None if nowhere.

    colour: samples are R, G, B. sampled: channels are samples of one page. steps: mm or units, None
    where not given. unit: None if not known.
    """

    kind: str
    key: Any
    times: int
    channels: int
    depth: int
    plane: Callable[[int, int, int], Plane | None]
    colour: bool = False
    sampled: bool = False
    steps: tuple[float | None, float | None, float | None] = (None, None, None)
    unit: str | None = None
    window: tuple[float, float] | None = None
    name: str = ""
    warnings: tuple[str, ...] = ()
    signed16: bool = False
    palette: NDArray[np.uint8] | None = None
    fields: Mapping[str, str] | None = None

    @property
    def width(self) -> int:
        """Samples along x."""
        return int(self.key.imagewidth)

    @property
    def height(self) -> int:
        """Samples along y."""
        return int(self.key.imagelength)


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
            layout = _imagej(layout, tif.imagej_metadata or {}, path)
        elif tif.is_lsm:
            layout = _lsm(layout, tif.lsm_metadata or {})
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


def _imagej(layout: Layout, meta: Mapping[str, Any], path: Path) -> Layout:
    """Voxel size, unit and display range as ImageJ writes them."""
    declared = math.prod(int(_number(meta.get(k)) or 1) for k in ("slices", "frames", "channels"))
    there = layout.times * layout.channels * layout.depth * int(layout.key.samplesperpixel)
    if declared > there:
        raise InputError(
            f"ImageJ describes {declared} planes, the file has {there}",
            file=path,
            field="ImageDescription",
            fix="the file is cut off: copy it again",
        )
    unit = length_unit(_unescaped(str(meta.get("unit", ""))))
    scale = mm_per(unit) if unit else 1.0
    x, y = (_per_pixel(layout.key, tag) for tag in ("XResolution", "YResolution"))
    z = _positive(meta.get("spacing"))
    scales, axes = str(meta.get("scales", "")).split(","), str(meta.get("axes", "")).split(",")
    named = dict(zip(axes, scales, strict=False))
    if {"X", "Y", "Z"} <= named.keys():
        x, y, z = (_positive(named[axis]) for axis in "XYZ")
    low, high = (_number(meta.get(k)) for k in ("min", "max"))
    window = None
    if low is not None and high is not None and high > low:
        window = ((low + high) / 2, high - low)
    c0, c1 = _number(meta.get("c0")), _number(meta.get("c1"))
    signed = _number(meta.get("cf")) == 0 and (c0, c1) == (-32768, 1) and layout.key.dtype == "u2"
    notes = list(layout.warnings)
    if _number(meta.get("cf")) is not None and not signed:
        notes.append("the calibration of values (ImageJ) is not applied: stored values are shown")
    steps = tuple(None if s is None else s * scale for s in (x, y, z))
    return replace(
        layout,
        kind="ImageJ",
        steps=(steps[0], steps[1], steps[2]),
        unit=unit,
        window=window,
        signed16=signed,
        warnings=tuple(notes),
        fields={str(k): safe_text(v) for k, v in meta.items() if k not in ("LUTs", "IJMetadata")},
    )


def _lsm(layout: Layout, meta: Mapping[str, Any]) -> Layout:
    """Voxel size of a Zeiss LSM file, stored in metres."""
    steps = tuple(_positive(meta.get(f"VoxelSize{axis}")) for axis in "XYZ")
    x, y, z = (None if s is None else s * 1000 for s in steps)
    return replace(layout, kind="LSM", steps=(x, y, z), unit="µm")


def _unescaped(text: str) -> str:
    return re.sub(r"\\u([0-9a-fA-F]{4})", lambda m: chr(int(m.group(1), 16)), text)


def _per_pixel(page: Any, tag: str) -> float | None:
    """Units per pixel from a resolution in pixels per unit."""
    value = page.tags.valueof(tag)
    try:
        above, below = float(value[0]), float(value[1])
    except (TypeError, ValueError, IndexError, OverflowError):
        return None
    return _positive(below / above) if above > 0 else None


def _number(value: object) -> float | None:
    try:
        number = float(str(value))
    except ValueError:
        return None
    return number if math.isfinite(number) else None


def _positive(value: object) -> float | None:
    """The absolute value (ImageJ writes negative spacing for reversed stacks), None for 0."""
    number = _number(value)
    return abs(number) or None if number is not None else None


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
