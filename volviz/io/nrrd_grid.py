"""NRRD's axes and space: which axes are space, where the samples lie, in LPS millimetres.

http://teem.sourceforge.net/nrrd/format.html, sections 5 (per axis) and 6 (space); a sample's
position along an axis without directions follows from `spacings`, or `axis mins` and `axis maxs`.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from volviz.errors import UnsupportedError, safe_text
from volviz.io.geometry import length_unit, matrix, mm_per, third_axis, usable
from volviz.io.nrrd_header import NrrdHeader
from volviz.model.volume import Space

Role = Literal["space", "time", "channel"]

_TO_LPS = {
    "left-posterior-superior": (1.0, 1.0, 1.0),
    "right-anterior-superior": (-1.0, -1.0, 1.0),
    "left-anterior-superior": (1.0, -1.0, 1.0),
}
_SHORT = {
    "lps": "left-posterior-superior",
    "ras": "right-anterior-superior",
    "las": "left-anterior-superior",
    "lpst": "left-posterior-superior",
    "rast": "right-anterior-superior",
    "last": "left-anterior-superior",
}
_UNNAMED = ("scanner-xyz", "3d-right-handed", "3d-left-handed", "")
_PLAIN_KINDS = ("domain", "space", "none", "???", "")


@dataclass(frozen=True)
class Grid:
    """roles: of every axis, fastest first. affine: float64[4, 4] of the axes that are space."""

    roles: tuple[Role, ...]
    affine: NDArray[np.float64]
    space: Space | None
    length_unit: str | None
    warnings: tuple[str, ...]


def grid_of(header: NrrdHeader, sizes: tuple[int, ...]) -> Grid:
    """Roles and geometry of all axes. Raises InputError or UnsupportedError."""
    vectors = _directions(header, len(sizes))
    roles = _roles(header, sizes, vectors)
    spatial = [i for i, role in enumerate(roles) if role == "space"]
    notes: list[str] = []
    steps, origin = (
        _from_vectors(header, vectors, spatial)
        if vectors is not None and any(vectors[i] is not None for i in spatial)
        else _from_spacings(header, sizes, spatial, notes)
    )
    unit, rows, columns = _units(header, spatial, vectors is not None, notes)
    steps = steps * rows[:, None] * columns
    origin = origin * rows * (1.0 if vectors is not None else columns)
    name = _space_name(header, notes)
    flips = _TO_LPS.get(name)
    if flips is not None:
        steps, origin = steps * np.array(flips)[:, None], origin * np.array(flips)
        unit = unit or "mm"
    field = "space directions" if vectors is not None else "spacings"
    affine, more = usable(matrix(steps, origin), field)
    space: Space | None = "LPS" if flips is not None else None
    return Grid(roles, affine, space, unit, (*notes, *more))


def _directions(header: NrrdHeader, dimension: int) -> list[NDArray[np.float64] | None] | None:
    """A vector or None per axis, None without the field."""
    text = header.fields.get("space directions")
    if text is None:
        return None
    tokens = re.findall(r"none|\([^()]*\)", text)
    if len(tokens) != dimension:
        raise header.error(
            "space directions", f"{len(tokens)} vectors for {dimension} axes", "give one per axis"
        )
    if all(token == "none" for token in tokens):
        return None
    rows = np.asarray(header.value("space directions"), dtype=np.float64)
    length = rows.shape[1]
    declared = header.value("space dimension")
    if not 1 <= length <= 4 or (declared is not None and declared != length):
        raise header.error("space directions", f"vectors of {length} components", "give 3 each")
    return [None if t == "none" else rows[i] for i, t in enumerate(tokens)]


def _roles(
    header: NrrdHeader, sizes: tuple[int, ...], vectors: list[NDArray[np.float64] | None] | None
) -> tuple[Role, ...]:
    """What each axis is: by direction if there are any, else by kind and spacing."""
    kinds = _kinds(header, len(sizes))
    if vectors is not None:
        plain = [v is not None and not _is_time(v) for v in vectors]
    else:
        gaps = _numbers(header, "spacings", len(sizes))
        plain = [k in _PLAIN_KINDS for k in kinds]
        if sum(plain) > 3 and gaps is not None:
            plain = [p and bool(np.isfinite(g)) for p, g in zip(plain, gaps, strict=True)]
    if not any(plain):
        plain = [True] * len(sizes)
    for axis in [i for i, p in enumerate(plain) if p][3:]:
        plain[axis] = False
    last = max(i for i, p in enumerate(plain) if p)
    roles: list[Role] = []
    for axis, kind in enumerate(kinds):
        if plain[axis]:
            roles.append("space")
        elif kind == "time" or (kind in _PLAIN_KINDS and axis > last):
            roles.append("time")
        else:
            roles.append("channel")
    return _one_each(header, sizes, roles)


def _one_each(header: NrrdHeader, sizes: tuple[int, ...], roles: list[Role]) -> tuple[Role, ...]:
    """At most one axis of times and one of channels with more than one sample."""
    times = [i for i, r in enumerate(roles) if r == "time" and sizes[i] > 1]
    channels = [i for i, r in enumerate(roles) if r == "channel" and sizes[i] > 1]
    if len(channels) == 2 and not times:
        roles[channels.pop()] = "time"
    elif len(times) == 2 and not channels:
        roles[times.pop(0)] = "channel"
    elif len(times) > 1 or len(channels) > 1:
        raise UnsupportedError(
            f"more than one axis of times and one of channels (sizes {' '.join(map(str, sizes))})",
            file=header.path,
            field="kinds",
            fix="save three axes of space, one of time and one of channels",
        )
    return tuple(roles)


def _is_time(vector: NDArray[np.float64]) -> bool:
    return len(vector) == 4 and not np.any(vector[:3]) and bool(vector[3])


def _kinds(header: NrrdHeader, dimension: int) -> list[str]:
    kinds = header.value("kinds")
    if kinds is None:
        return [""] * dimension
    if len(kinds) != dimension:
        raise header.error("kinds", f"{len(kinds)} kinds for {dimension} axes", "give one per axis")
    return [str(k).lower() for k in kinds]


def _numbers(header: NrrdHeader, field: str, dimension: int) -> NDArray[np.float64] | None:
    values = header.value(field)
    if values is None:
        return None
    if len(values) != dimension:
        raise header.error(
            field, f"{len(values)} numbers for {dimension} axes", "give one per axis"
        )
    return np.asarray(values, dtype=np.float64)


def _from_vectors(
    header: NrrdHeader, vectors: list[NDArray[np.float64] | None], spatial: list[int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Steps float64[3, 3] (columns) and origin float64[3], in the file's space and unit."""
    columns = [_three(v) for i in spatial if (v := vectors[i]) is not None]
    if len(columns) == 1:
        least = np.eye(3)[int(np.argmin(np.abs(columns[0])))]
        columns.append(third_axis(columns[0], least))
    if len(columns) == 2:
        columns.append(third_axis(columns[0], columns[1]))
    origin = header.value("space origin")
    return np.stack(columns, axis=1), np.zeros(3) if origin is None else _three(origin)


def _three(vector: NDArray[np.float64]) -> NDArray[np.float64]:
    """The first three components, zeros where there are fewer."""
    out = np.zeros(3)
    count = min(len(vector), 3)
    out[:count] = np.asarray(vector, dtype=np.float64)[:count]
    return out


def _from_spacings(
    header: NrrdHeader, sizes: tuple[int, ...], spatial: list[int], notes: list[str]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """As `_from_vectors`, along the world axes."""
    dimension = len(sizes)
    gaps = _numbers(header, "spacings", dimension)
    lows = _numbers(header, "axis mins", dimension)
    highs = _numbers(header, "axis maxs", dimension)
    nodes = (header.fields.get("centerings") or "").lower().split()
    steps, origin = np.ones(3), np.zeros(3)
    for at, axis in enumerate(spatial):
        node = axis < len(nodes) and nodes[axis] == "node"
        intervals = max(sizes[axis] - 1, 1) if node else sizes[axis]
        if gaps is not None and np.isfinite(gaps[axis]) and gaps[axis] != 0:
            steps[at] = gaps[axis]
        elif gaps is None and lows is not None and highs is not None:
            step = (highs[axis] - lows[axis]) / intervals
            steps[at] = step if np.isfinite(step) and step else 1.0
        elif gaps is not None:
            notes.append(f"spacings: axis {axis + 1} has spacing {gaps[axis]:g}; 1 is used")
        if lows is not None and np.isfinite(lows[axis]):
            origin[at] = lows[axis] + (0 if node else steps[at] / 2)
    given = header.value("space origin")
    return np.diag(steps), origin if given is None else _three(given)


def _units(
    header: NrrdHeader, spatial: list[int], vectors: bool, notes: list[str]
) -> tuple[str | None, NDArray[np.float64], NDArray[np.float64]]:
    """The unit's name, and millimetres per unit for each world row and each index column."""
    rows, columns = np.ones(3), np.ones(3)
    field = "space units" if "space units" in header.fields else "units"
    words = header.value(field)
    if words is None or (vectors and field == "units"):
        return None, rows, columns
    factors = rows if field == "space units" else columns
    places = range(min(len(words), 3)) if field == "space units" else spatial
    found: list[str] = []
    for at, place in enumerate(places):
        word = str(words[place]) if place < len(words) else ""
        unit = length_unit(word)
        if unit is not None:
            factors[at] = mm_per(unit)
            found.append(unit)
        elif word.strip("? "):
            notes.append(f"{field}: '{safe_text(word, 30)}' is no known unit of length")
    return (found[0] if found else None), rows, columns


def _space_name(header: NrrdHeader, notes: list[str]) -> str:
    """The space by its long name without "-time", "" if it has none."""
    text = "-".join(header.fields.get("space", "").lower().replace("_", " ").split())
    name = _SHORT.get(text, text).removesuffix("-time")
    if name == "3d-left-handed":
        notes.append("space: it is left-handed and shown as it is, so the picture is mirrored")
    elif name not in _TO_LPS and name not in _UNNAMED:
        notes.append(f"space: '{safe_text(text, 40)}' is not known; coordinates are taken as given")
    return name
