"""OME-TIFF: which page of which file holds which plane, and the voxel size (OME schema 2016-06).

The XML is read here and not by tifffile, which opens whatever file it names. Files that it names
are opened only beside this one, and only those that the chosen time and channel need.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

from volviz.errors import InputError, UnsupportedError, safe_text
from volviz.io.geometry import length_unit, mm_per
from volviz.io.options import Limits

_MAX_PLANES = 1_000_000
_SIZES = "XYZCT"


@dataclass(frozen=True)
class OmePixels:
    """One image of the XML.

    sizes: of X, Y, Z, C, T. planes: (t, c, z) to (file name, page); "" is this file.

    steps: x, y, z in mm, None where not given; unit: of x. order: DimensionOrder. channels: names.
    """

    name: str
    sizes: Mapping[str, int]
    order: str
    samples: int
    steps: tuple[float | None, float | None, float | None]
    unit: str | None
    planes: Mapping[tuple[int, int, int], tuple[str, int]] = field(default_factory=dict)
    channels: tuple[str, ...] = ()


def parse_ome(xml: str, path: Path, pages: int, limits: Limits) -> tuple[OmePixels, int]:
    """The largest image of an OME-XML and how many images there are. `pages`: in this file.

    Raises InputError for broken XML or numbers, UnsupportedError if the description is elsewhere.
    """
    root = _root(xml, path, limits)
    images = [
        (math.prod(_count(pixels, f"Size{axis}", path) for axis in _SIZES), k, image, pixels)
        for k, image in enumerate(root)
        if _tag(image) == "Image"
        for pixels in image
        if _tag(pixels) == "Pixels"
    ]
    if not images:
        raise _wrong("the OME-XML holds no image", path, "Pixels")
    _, _, image, pixels = max(images, key=lambda entry: (entry[0], -entry[1]))
    return _pixels(pixels, image.get("Name", ""), root.get("UUID"), path, pages), len(images)


def _root(xml: str, path: Path, limits: Limits) -> ElementTree.Element:
    if len(xml) > limits.max_header or "<!DOCTYPE" in xml or "<!ENTITY" in xml:
        raise _wrong("the OME-XML has a document type or is too long", path, "ImageDescription")
    try:
        root = ElementTree.fromstring(xml)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise _wrong("the OME-XML cannot be parsed", path, "ImageDescription") from error
    for element in root:
        if _tag(element) == "BinaryOnly":
            other = safe_text(element.get("MetadataFile", "another file"), 80)
            raise UnsupportedError(
                f"the description of this OME-TIFF is in {other}",
                file=path,
                field="BinaryOnly",
                fix="open the file that holds the OME-XML, or save it as one OME-TIFF",
            )
    return root


def _wrong(what: str, path: Path, field: str) -> InputError:
    return InputError(what, file=path, field=field, fix="the OME-XML is wrong: save the file again")


def _pixels(
    element: ElementTree.Element, name: str, uuid: str | None, path: Path, pages: int
) -> OmePixels:
    sizes = {axis: _count(element, f"Size{axis}", path) for axis in _SIZES}
    order = element.get("DimensionOrder", "XYZCT").upper()
    if sorted(order) != sorted(_SIZES) or order[:2] != "XY":
        raise _wrong(f"'{safe_text(order, 20)}' is no order of axes", path, "DimensionOrder")
    channels = [c for c in element if _tag(c) == "Channel"]
    samples = max([_whole(c.get("SamplesPerPixel"), 1) for c in channels], default=1)
    if samples > 1 and sizes["C"] % samples == 0:
        sizes["C"] //= samples
    if math.prod(sizes[a] for a in "ZCT") > _MAX_PLANES:
        text = f"{sizes['Z']} × {sizes['C']} × {sizes['T']} planes are declared"
        raise _wrong(text, path, "SizeZ, SizeC, SizeT")
    unit = _unit(element, "X")
    steps = tuple(_step(element, axis) for axis in "XYZ")
    planes = _planes(element, sizes, order, uuid, path=path, pages=pages)
    names = tuple(safe_text(c.get("Name", ""), 60) for c in channels)
    place = (steps[0], steps[1], steps[2])
    return OmePixels(name, sizes, order, samples, place, unit, planes, names)


def _planes(
    element: ElementTree.Element,
    sizes: Mapping[str, int],
    order: str,
    uuid: str | None,
    *,
    path: Path,
    pages: int,
) -> dict[tuple[int, int, int], tuple[str, int]]:
    """Each TiffData names its first plane, first page, how many follow, and in which file."""
    blocks = [child for child in element if _tag(child) == "TiffData"]
    names = {_file_of(block, uuid, path)[0] for block in blocks}
    alone = len(names) == 1 and not (path.parent / next(iter(names))).is_file()
    total = sizes["Z"] * sizes["C"] * sizes["T"]
    found: dict[tuple[int, int, int], tuple[str, int]] = {}
    named = 0
    for block in blocks:
        name, own = _file_of(block, uuid, path)
        name = "" if own or alone else name
        page = _whole(block.get("IFD"), 0)
        start = _flat({a: _whole(block.get(f"First{a}"), 0) for a in "ZCT"}, sizes, order)
        count = _whole(block.get("PlaneCount"), 1 if block.get("IFD") is not None else total)
        count = max(0, min(count, total - start, total if name else pages - page))
        named += count
        if named > 4 * total + _MAX_PLANES:
            raise _wrong("planes are named many times over", path, "TiffData")
        for k in range(count):
            found[_place(start + k, sizes, order)] = (name, page + k)
    return found


def _file_of(block: ElementTree.Element, uuid: str | None, path: Path) -> tuple[str, bool]:
    """The name in a TiffData's UUID element, and whether that is this file."""
    for child in block:
        if _tag(child) == "UUID":
            name = child.get("FileName", "")
            same = uuid is not None and (child.text or "").strip() == uuid.strip()
            return name, same or not name or name == path.name
    return "", True


def _flat(first: Mapping[str, int], sizes: Mapping[str, int], order: str) -> int:
    index, step = 0, 1
    for axis in order[2:]:
        index += first[axis] * step
        step *= sizes[axis]
    return index


def _place(index: int, sizes: Mapping[str, int], order: str) -> tuple[int, int, int]:
    at = {}
    for axis in order[2:]:
        index, at[axis] = divmod(index, sizes[axis])
    return at["T"], at["C"], at["Z"]


def _step(element: ElementTree.Element, axis: str) -> float | None:
    """PhysicalSize in mm, None where it is missing, not positive or in no unit of length."""
    unit = _unit(element, axis)
    try:
        size = float(element.get(f"PhysicalSize{axis}", "nan"))
    except ValueError:
        return None
    usable = math.isfinite(size) and size > 0 and unit is not None
    return size * mm_per(unit) if usable and unit is not None else None


def _unit(element: ElementTree.Element, axis: str) -> str | None:
    if element.get(f"PhysicalSize{axis}") is None:
        return None
    return length_unit(element.get(f"PhysicalSize{axis}Unit", "µm"))


def _count(element: ElementTree.Element, name: str, path: Path) -> int:
    text = element.get(name, "")
    value = _whole(text, 0)
    if not 1 <= value < 2**31:
        raise _wrong(f"'{safe_text(text, 30)}' is no size", path, name)
    return value


def _whole(text: str | None, default: int) -> int:
    try:
        value = int((text or "")[:20])
    except ValueError:
        return default
    return value if value >= 0 else default


def _tag(element: ElementTree.Element) -> str:
    return str(element.tag).rpartition("}")[2]
