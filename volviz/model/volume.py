"""The volume, and the axis convention of the whole project, said once.

Arrays are C-order `[z, y, x]`. `affine` maps the voxel-centre index (x, y, z, 1) to world
millimetres in LPS: x grows to the patient's Left, y to Posterior, z to Superior. Readers convert
RAS to LPS. Where a file does not say which space it is in, `space` is None: the coordinates
are then just coordinates and no letters are drawn. Where it does not say its unit of length,
`length_unit` is None and one unit counts as a millimetre. Texture coordinate of sample i is
(i + ½)/N; a volume fills the box of its voxels, half a voxel beyond the outer centres.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from volviz.errors import UsageError

Space = Literal["LPS"]
Kind = Literal["scalar", "labels"]
Dims = tuple[int, int, int]


@dataclass(frozen=True, eq=False)
class VolumeInfo:
    """All that is known of a volume but its voxels. `volviz info` shows it before loading them.

    dims: samples along x, y, z. dtype: as delivered in `Volume.data` (native byte order).
    affine: float64[4, 4], voxel-centre index (x, y, z) to world LPS mm. space: "LPS", or None
    where the file does not say. length_unit: the file's own unit of length ("mm", "µm", "m", …),
    already converted in `affine`, or None. value_unit: "HU" for CT. modality: DICOM's code
    ("CT", "MR", "PT", "US", …) or None. kind: "labels" where the file says that values are names.
    times, channels: how many the file has; time, channel: which one this is; channel_names: as the
    file calls them, one each or none at all. padding: a value
    that means "nothing was measured here"; such voxels are transparent and not counted. window:
    (centre, width) that the file suggests. fields: the file's own header, untouched, for display.
    warnings: what a person should know before trusting the picture. stored_bytes: size of the
    payload in the file(s), None if not known. source: the path that was asked for; choices: what
    the reader was told besides (series, time, …), so that the same volume can be read again.
    """

    format: str
    dims: Dims
    dtype: np.dtype[Any]
    affine: NDArray[np.float64] = field(default_factory=lambda: np.eye(4))
    space: Space | None = None
    length_unit: str | None = None
    value_unit: str | None = None
    modality: str | None = None
    kind: Kind = "scalar"
    times: int = 1
    time: int = 0
    channels: int = 1
    channel: int = 0
    channel_names: tuple[str, ...] = ()
    padding: float | None = None
    window: tuple[float, float] | None = None
    fields: Mapping[str, str] = field(default_factory=dict)
    warnings: tuple[str, ...] = ()
    encoding: str = "raw"
    stored_bytes: int | None = None
    source: Path | None = None
    choices: tuple[tuple[str, Any], ...] = ()
    name: str = ""

    def __post_init__(self) -> None:
        for name, known in (("space", ("LPS", None)), ("kind", ("scalar", "labels"))):
            if getattr(self, name) not in known:
                raise UsageError(
                    f"{getattr(self, name)!r} is no {name} of a volume",
                    field=name,
                    fix="give " + " or ".join(map(repr, known)),
                )
        affine = np.array(self.affine, dtype=np.float64)
        affine.setflags(write=False)
        object.__setattr__(self, "affine", affine)
        object.__setattr__(self, "dtype", np.dtype(self.dtype).newbyteorder("="))
        object.__setattr__(self, "fields", MappingProxyType(dict(self.fields)))

    def __reduce__(self) -> tuple[Any, ...]:
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return _again, (type(self), {**values, "fields": dict(self.fields)})

    @property
    def shape(self) -> tuple[int, int, int]:
        """Array shape: samples along z, y, x."""
        return self.dims[2], self.dims[1], self.dims[0]

    @property
    def nbytes(self) -> int:
        """Bytes of the voxels in memory."""
        return int(np.prod(self.dims, dtype=object)) * self.dtype.itemsize

    @property
    def spacing(self) -> tuple[float, float, float]:
        """Distance between neighbouring samples along x, y, z of the index, in mm."""
        x, y, z = (float(s) for s in np.linalg.norm(self.affine[:3, :3], axis=0))
        return x, y, z

    @property
    def origin(self) -> tuple[float, float, float]:
        """World position of the centre of sample (0, 0, 0), in mm."""
        x, y, z = (float(s) for s in self.affine[:3, 3])
        return x, y, z

    @property
    def orientation(self) -> str | None:
        """Letters of where x, y, z of the index grow to, e.g. "LPS"; None if unknown."""
        return None if self.space is None else orientation_letters(self.affine)

    @property
    def oblique(self) -> bool:
        """True if an index axis is more than 0.06° off every world axis."""
        directions = self.affine[:3, :3] / np.linalg.norm(self.affine[:3, :3], axis=0)
        return bool(np.any(np.abs(directions).max(axis=0) < 1 - 5e-7))

    def warn(self, *messages: str) -> VolumeInfo:
        """The same with further warnings."""
        return replace(self, warnings=(*self.warnings, *messages))


@dataclass(frozen=True, eq=False)
class Volume:
    """A scalar field on a uniform grid: `data[z, y, x]`, read-only, with its `info`.

    Volumes are compared and hashed by identity, so that everything derived from one can be
    remembered with it.
    """

    data: NDArray[Any]
    info: VolumeInfo

    def __post_init__(self) -> None:
        if self.data.ndim != 3:
            raise UsageError(
                f"a volume has 3 axes [z, y, x], this array has {self.data.ndim}",
                field="array",
                fix="pick one time and channel, or add an axis of length 1",
            )
        if self.data.dtype.kind not in "iufb" or min(self.data.shape) < 1:
            raise UsageError(
                f"cannot show an array of {self.data.dtype} and shape {self.data.shape}",
                field="array",
                fix="use integers or floats and at least one sample along each axis",
            )
        data = self.data.view(np.uint8) if self.data.dtype.kind == "b" else self.data
        if data.dtype.itemsize == 2 and data.dtype.kind == "f":
            data = data.astype(np.float32)
        elif data.dtype.itemsize > 8:
            data = data.astype(np.float64)
        data = np.ascontiguousarray(data, dtype=data.dtype.newbyteorder("=")).view()
        data.setflags(write=False)
        object.__setattr__(self, "data", data)
        info = replace(
            self.info, dims=(data.shape[2], data.shape[1], data.shape[0]), dtype=data.dtype
        )
        object.__setattr__(self, "info", info)

    def __reduce__(self) -> tuple[Any, ...]:
        return _again, (type(self), {"data": self.data, "info": self.info})

    @classmethod
    def from_array(
        cls,
        array: ArrayLike,
        spacing: Sequence[float] = (1.0, 1.0, 1.0),
        origin: Sequence[float] = (0.0, 0.0, 0.0),
        *,
        direction: ArrayLike | None = None,
        affine: ArrayLike | None = None,
        space: Space | None = None,
        **info: Any,
    ) -> Volume:
        """A volume from an array `[z, y, x]`.

        spacing, origin: mm, in x, y, z order. direction: float[3, 3], columns are the world
        directions of the index axes x, y, z (default: the world axes). affine: float[4, 4]
        instead of those three. space: "LPS" if world coordinates are a patient's. Further
        keywords are fields of `VolumeInfo` (name, modality, value_unit, kind, padding, …).
        What a masked array masks becomes NaN. Raises UsageError for arrays that are no scalar
        field and for a geometry that is not finite or has no extent.
        """
        data = _array(array)
        if affine is None:
            affine = affine_of(spacing, origin, direction)
        info.setdefault("length_unit", "mm")
        meta = VolumeInfo("array", (1, 1, 1), data.dtype, _checked(affine), space, **info)
        return cls(data, meta)

    @property
    def affine(self) -> NDArray[np.float64]:
        """float64[4, 4]: voxel-centre index (x, y, z) to world LPS mm."""
        return self.info.affine

    @property
    def spacing(self) -> tuple[float, float, float]:
        """mm between samples along x, y, z."""
        return self.info.spacing

    @property
    def dims(self) -> Dims:
        """Samples along x, y, z."""
        return self.info.dims

    @property
    def name(self) -> str:
        """A short name for titles."""
        return self.info.name

    def __repr__(self) -> str:
        x, y, z = self.dims
        step = " × ".join(f"{s:.4g}" for s in self.spacing)
        return f"<Volume {self.name or '-'} {x}×{y}×{z} {self.data.dtype} {step} mm>"


def affine_of(
    spacing: Sequence[float],
    origin: Sequence[float] = (0.0, 0.0, 0.0),
    direction: ArrayLike | None = None,
) -> NDArray[np.float64]:
    """float64[4, 4] from spacing and origin (x, y, z) and a direction matrix (columns = axes)."""
    steps = _floats(spacing, (3,))
    if not np.all(np.isfinite(steps)) or np.any(steps <= 0):
        raise UsageError(
            f"spacing must be three positive numbers x, y, z, not {spacing}", field="spacing"
        )
    axes = np.eye(3) if direction is None else _floats(direction, (3, 3))
    place = _floats(origin, (3,))
    for name, given in (("direction", axes), ("origin", place)):
        if not np.all(np.isfinite(given)):
            raise UsageError(
                f"{name} must be {3 if name == 'origin' else '3 × 3'} finite numbers", field=name
            )
    affine = np.eye(4)
    affine[:3, :3] = axes * steps
    affine[:3, 3] = place
    return affine


def _floats(given: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
    """float64 of this shape; NaN where numbers of that shape were not given."""
    try:
        found = np.asarray(given, dtype=np.float64)
    except (TypeError, ValueError):
        return np.full(shape, np.nan)
    return found if found.shape == shape else np.full(shape, np.nan)


def _checked(affine: ArrayLike) -> NDArray[np.float64]:
    """An affine that maps three independent axes to finite places, else UsageError."""
    found = _floats(affine, (4, 4))
    lengths = np.abs(found[:3, :3]).max(axis=0)
    in_reach = np.all((lengths > 1e-100) & (lengths < 1e100))
    if in_reach and np.all(np.isfinite(found)) and np.all(found[3] == (0, 0, 0, 1)):
        unit = found[:3, :3] / lengths
        if abs(np.linalg.det(unit / np.linalg.norm(unit, axis=0))) > 1e-6:
            return found
    raise UsageError(
        "the affine must be 4 × 4 finite numbers, its axes independent, its last row 0 0 0 1",
        field="affine",
    )


def _array(given: ArrayLike) -> NDArray[Any]:
    """The array of what was given; masked samples as NaN."""
    if isinstance(given, np.ma.MaskedArray) and given.mask.any():
        kind = np.float32 if given.dtype.itemsize <= 2 or given.dtype == np.float32 else np.float64
        return np.where(given.mask, np.nan, given.data).astype(kind)
    try:
        return np.asarray(given)
    except ValueError as error:
        raise UsageError("the rows of the array are not equally long", field="array") from error


def _again(cls: type, values: dict[str, Any]) -> Any:
    """Pickled and copied volumes are made anew, so that they are read-only again."""
    return cls(**values)


def orientation_letters(affine: NDArray[np.float64]) -> str:
    """Where index x, y, z grow to in an LPS world: the letter of the nearest axis, each once."""
    steps = affine[:3, :3] / np.maximum(np.linalg.norm(affine[:3, :3], axis=0), 1e-300)
    letters = ["?"] * 3
    left = np.abs(steps).copy()
    for _ in range(3):
        world, index = (int(i) for i in np.unravel_index(np.argmax(left), left.shape))
        letters[index] = ("LR", "PA", "SI")[world][0 if steps[world, index] >= 0 else 1]
        left[world, :] = -1
        left[:, index] = -1
    return "".join(letters)
