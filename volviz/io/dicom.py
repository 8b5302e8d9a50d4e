"""DICOM: one file, or a folder that holds a series (PS3.3, PS3.5; headers by pydicom).

A folder is read as one series, its slices in the order of their positions. One file is one image,
or a whole volume where it is a multi-frame object. Values are after slope and intercept of each
slice; the grid is in LPS mm, sheared where the gantry was tilted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from volviz.errors import InputError, safe_text
from volviz.io.choice import choice_note, chosen_index
from volviz.io.dicom_codecs import NATIVE, syntax_name
from volviz.io.dicom_files import open_dicom
from volviz.io.dicom_frames import Frame, Head
from volviz.io.dicom_geometry import Stack, stack_frames
from volviz.io.dicom_pixels import Plan, is_colour, plan_stack, read_stack
from volviz.io.dicom_series import (
    NEIGHBOURS,
    Series,
    SeriesInfo,
    choose,
    group,
    neighbours,
    no_images,
    scan,
)
from volviz.io.geometry import usable, with_spacing
from volviz.io.options import Limits, ReadOptions
from volviz.model.volume import Volume, VolumeInfo

__all__ = ["SeriesInfo", "list_series", "probe", "read"]

_MAX_FIELDS = 400
_BINARY = ("OB", "OW", "OF", "OD", "OL", "OV", "UN")
_UNITS = {"BQML": "Bq/ml", "GY": "Gy"}


@dataclass(frozen=True)
class _Opened:
    """What headers alone say: the grid, how its values come, and the info."""

    stack: Stack
    plan: Plan
    info: VolumeInfo


def list_series(path: Path, options: ReadOptions) -> tuple[SeriesInfo, ...]:
    """The series in a folder or file, as `options.series` numbers them; empty without an image."""
    return tuple(s.info for s in group(scan(Path(path), options), Path(path)))


def probe(path: Path, options: ReadOptions) -> VolumeInfo:
    """What `read` gives, from headers alone.

    Raises InputError for broken files, UnsupportedError for objects without an image, UsageError
    that lists the series where it is not clear which one is meant.
    """
    return _open(path, options).info


def read(path: Path, options: ReadOptions) -> Volume:
    """The volume: `[z, y, x]`, stored integers, rescaled integers or float32.

    Beyond what `probe` raises: UnsupportedError for a missing codec, LimitError, Cancelled.
    """
    headers, pixels = options.progress.part(0.0, 0.2), options.progress.part(0.2, 1.0)
    opened = _open(path, replace(options, progress=headers))
    data = read_stack(opened.stack, opened.plan, replace(options, progress=pixels))
    return Volume(data, opened.info)


def _open(path: Path, options: ReadOptions) -> _Opened:
    found = scan(path, options)
    series_list = group(found, path)
    if not series_list:
        raise no_images(found, path)
    series, notes = choose(series_list, path, options)
    time = chosen_index(options.time, len(series.times), what="time", file=path)
    chosen_index(options.channel, 1, what="channel", file=path)
    stack = stack_frames(series.times[time])
    plan = plan_stack(stack)
    notes += found.notes()
    notes += _beside(path, stack.first, options)
    info = _info(path, series, stack, plan, time=time, options=options)
    return _Opened(stack, plan, info.warn(*notes))


def _beside(path: Path, frame: Frame, options: ReadOptions) -> list[str]:
    """A note if one file of a series was opened."""
    if path.is_dir() or frame.head.frames > 1 or not frame.head.uid:
        return []
    count = neighbours(path, frame.head.uid, options)
    if count < 2:
        return []
    many = f"at least {count}" if count >= NEIGHBOURS else str(count)
    return [f"this is one of {many} images of a series: open the folder to see all of them"]


def _info(
    path: Path, series: Series, stack: Stack, plan: Plan, *, time: int, options: ReadOptions
) -> VolumeInfo:
    first = stack.first
    head = first.head
    affine, broken = usable(stack.affine, "ImagePositionPatient")
    syntax = first.stored.syntax
    files = {f.path: f.head.size for f in stack.slots if f is not None}
    spaced = first.spacing is not None or options.spacing is not None
    return VolumeInfo(
        format="DICOM",
        dims=(first.columns, first.rows, len(stack.slots)),
        dtype=plan.dtype,
        affine=with_spacing(affine, options.spacing),
        space="LPS" if stack.known else None,
        length_unit="mm" if spaced else None,
        value_unit=_unit(first),
        modality=head.modality or None,
        times=len(series.times),
        time=time,
        padding=plan.padding,
        window=head.window,
        fields=_fields(head.path, options.limits),
        warnings=(
            *choice_note(len(series.times), time, what="time"),
            *series.notes,
            *stack.warnings,
            *plan.warnings,
            *broken,
            *_looks(first),
        ),
        encoding="raw" if syntax in NATIVE else syntax_name(syntax),
        stored_bytes=sum(files.values()),
        source=path,
        name=_name(path, head),
    )


def _name(path: Path, head: Head) -> str:
    if head.description and head.description.lower() != "none":
        return safe_text(head.description, 80)
    resolved = path.resolve()
    return resolved.name if path.is_dir() else resolved.parent.name


def _unit(frame: Frame) -> str | None:
    """HU for CT images that are rescaled and do not say otherwise (PS3.3 C.8.2.1.1.7)."""
    head = frame.head
    rescaled = frame.slope != 1 or frame.intercept != 0
    if head.rescale_type == "HU":
        return "HU"
    if (
        head.modality == "CT"
        and not head.rescale_type
        and rescaled
        and "LOCALIZER" not in head.image_type
    ):
        return "HU"
    if head.modality in ("PT", "RTDOSE"):
        return _UNITS.get(head.units.upper(), head.units or None)
    return None


def _looks(frame: Frame) -> list[str]:
    """What the pixels mean beyond their values."""
    notes = []
    photometric = frame.stored.photometric
    if photometric == "MONOCHROME1":
        notes.append(
            "MONOCHROME1: low values are meant to be shown bright; values are kept as they are"
        )
    if is_colour(frame):
        notes.append(
            f"the colours ({safe_text(photometric, 20)}) are shown as luminance (Rec. 709)"
        )
    if "MOSAIC" in frame.head.image_type:
        notes.append("a mosaic of slices in one image: it is shown as it is stored")
    if frame.head.moments:
        notes.append("the frames of this file are moments of a film, each one slice thick")
    if not frame.patient_space:
        notes.append("positions are relative to the device, not to the patient")
    return notes


def _fields(path: Path, limits: Limits) -> dict[str, str]:
    """The header as text, for display. It may name a person: shown only on request."""
    fields: dict[str, str] = {}
    try:
        with open_dicom(path, limits) as (dataset, _):
            meta: Any = getattr(dataset, "file_meta", None) or ()
            for element in [*meta, *dataset]:
                if len(fields) >= _MAX_FIELDS:
                    break
                name = element.keyword or str(element.tag)
                fields[name] = _shown(element)
    except InputError:
        return fields  # the pixels are read by other means: a broken tag must not hide them
    return fields


def _shown(element: Any) -> str:
    if element.VR == "SQ":
        return f"{len(element.value)} items"
    if element.VR in _BINARY:
        return f"{len(element.value or b'')} bytes"
    return safe_text(element.value if element.value is not None else "", 400)
