"""The frames of DICOM files: what places each image in space and turns it into values.

A plain image is one frame; a multi-frame object gives as many as it holds, placed by its functional
groups (PS3.3 C.7.6.16), by the offset vector of an RT Dose (C.8.8.3), by the detector of a
reconstructed NM image (C.8.4.11), or else one slice spacing after the other.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from volviz.errors import InputError
from volviz.io.dicom_files import (
    PixelElement,
    items_of,
    number_of,
    numbers_of,
    open_dicom,
    pixel_element,
    text_of,
    whole_of,
)
from volviz.io.options import Limits

Vector = tuple[float, ...]
MAX_FRAMES = 1_000_000

_TAG_WORDS = """
SpecificCharacterSet ImageType SOPClassUID SOPInstanceUID Modality SeriesDescription
SeriesInstanceUID SeriesNumber AcquisitionNumber AcquisitionTime ContentTime InstanceNumber
ImagePositionPatient ImageOrientationPatient SliceLocation TemporalPositionIdentifier
TemporalPositionIndex EchoTime EchoNumbers TriggerTime NominalPercentageOfCardiacPhase
DiffusionBValue FrameReferenceTime SliceThickness SpacingBetweenSlices GantryDetectorTilt
PixelSpacing ImagerPixelSpacing Rows Columns SamplesPerPixel PhotometricInterpretation
PlanarConfiguration NumberOfFrames BitsAllocated BitsStored HighBit PixelRepresentation
PixelPaddingValue PixelPaddingRangeLimit RescaleSlope RescaleIntercept RescaleType Units
WindowCenter WindowWidth ModalityLUTSequence RedPaletteColorLookupTableDescriptor
FrameIncrementPointer GridFrameOffsetVector DoseGridScaling DoseUnits
DetectorInformationSequence SharedFunctionalGroupsSequence PerFrameFunctionalGroupsSequence
"""
SCAN_TAGS = tuple(_TAG_WORDS.split())

_NO_VOLUME = {
    "1.2.840.10008.5.1.4.1.1.66.4": "a segmentation object",
    "1.2.840.10008.5.1.4.1.1.77.1.6": "tiles of a whole-slide image",
}
_TIME_POINTERS = (0x00181063, 0x00181065)
_LABELS = (
    "TemporalPositionIdentifier",
    "TemporalPositionIndex",
    "EchoNumbers",
    "EchoTime",
    "EffectiveEchoTime",
    "DiffusionBValue",
    "NominalPercentageOfCardiacPhase",
    "TriggerTime",
    "FrameReferenceTime",
    "AcquisitionNumber",
    "AcquisitionTime",
    "ContentTime",
)
_LABEL_GROUPS = (
    "FrameContentSequence",
    "MREchoSequence",
    "MRDiffusionSequence",
    "CardiacSynchronizationSequence",
)


@dataclass(frozen=True, slots=True)
class Stored:
    """How samples are stored.

    syntax: transfer syntax UID; real: bits of a float sample, 0 for integers; lut_bits: bits of an
    entry of the palette; high: index of the highest bit used.
    """

    syntax: str
    photometric: str
    samples: int
    planar: int
    allocated: int
    bits: int
    high: int
    signed: bool
    real: int
    lut_bits: int


@dataclass(frozen=True, slots=True)
class Head:
    """What all frames of a file share. size: bytes of the file."""

    path: Path
    size: int
    sop_class: str
    uid: str
    number: int | None
    description: str
    modality: str
    image_type: str
    rescale_type: str
    units: str
    tilt: float | None
    window: tuple[float, float] | None
    modality_lut: bool
    frames: int
    moments: bool


@dataclass(frozen=True, slots=True)
class Frame:
    """One image. index: in its file. position, orientation: LPS mm as in the header, None where it
    has none; spacing: mm between rows, between columns; labels: what can tell images at one
    place apart.
    """

    head: Head
    index: int
    rows: int
    columns: int
    stored: Stored
    position: Vector | None
    orientation: Vector | None
    spacing: Vector | None
    thickness: float | None
    slope: float
    intercept: float
    padding: Vector | None
    sop: str
    instance: int | None
    location: float | None
    patient_space: bool = True
    labels: dict[str, str] = field(default_factory=dict)

    @property
    def path(self) -> Path:
        """The file that holds it."""
        return self.head.path


@dataclass(frozen=True, slots=True)
class Skipped:
    """A DICOM object without an image, and what it is instead."""

    reason: str
    cut_off: bool = False


def scan_file(path: Path, limits: Limits) -> tuple[Frame, ...] | Skipped:
    """The frames of one file. Raises InputError for a broken one."""
    with open_dicom(path, limits, SCAN_TAGS) as (dataset, stream):
        pixels = pixel_element(dataset, stream)
        sop_class = text_of(dataset, "SOPClassUID")
        rows, columns = whole_of(dataset, "Rows"), whole_of(dataset, "Columns")
        if sop_class in _NO_VOLUME:
            return Skipped(_NO_VOLUME[sop_class])
        if pixels is None or rows is None or columns is None:
            return _without_pixels(dataset, sop_class)
        if rows < 1 or columns < 1:
            raise InputError(
                f"the image has {rows} rows and {columns} columns",
                file=path,
                field="Rows",
                fix="the file is damaged: copy it again",
            )
        head = _head(dataset, path)
        first = _first_frame(dataset, head, rows, columns, _stored(dataset, pixels, path))
        return _all_frames(dataset, first)


def _without_pixels(dataset: Any, sop_class: str) -> Skipped:
    from pydicom.uid import UID

    name = UID(sop_class).name if sop_class else ""
    meta = getattr(dataset, "file_meta", None)
    if not name and meta is not None:
        name = UID(text_of(meta, "MediaStorageSOPClassUID")).name
    image = "Image Storage" in name or name == "RT Dose Storage" or not name
    return Skipped(f"{name or 'DICOM object'} without pixels", cut_off=image)


def _stored(dataset: Any, pixels: PixelElement, path: Path) -> Stored:
    meta = getattr(dataset, "file_meta", None)
    syntax = text_of(meta, "TransferSyntaxUID") if meta is not None else ""
    if not syntax:
        implicit, little = dataset.original_encoding
        syntax = "1.2.840.10008.1.2" + ("" if implicit else ".1" if little else ".2")
    real = {"FloatPixelData": 32, "DoubleFloatPixelData": 64}.get(pixels.keyword, 0)
    allocated = real or whole_of(dataset, "BitsAllocated") or 0
    if allocated not in (8, 16, 32, 64):
        raise InputError(
            f"{allocated} bits are allocated per sample",
            file=path,
            field="BitsAllocated",
            fix="8, 16 and 32 bits are read",
        )
    bits = whole_of(dataset, "BitsStored") or allocated
    bits = bits if 1 <= bits <= allocated else allocated
    high = whole_of(dataset, "HighBit")
    high = bits - 1 if high is None or not bits - 1 <= high < allocated else high
    palette = numbers_of(dataset, "RedPaletteColorLookupTableDescriptor", 3)
    return Stored(
        syntax,
        text_of(dataset, "PhotometricInterpretation").upper() or "MONOCHROME2",
        whole_of(dataset, "SamplesPerPixel") or 1,
        whole_of(dataset, "PlanarConfiguration") or 0,
        allocated,
        bits,
        high,
        bool(whole_of(dataset, "PixelRepresentation")) and not real,
        real,
        int(palette[2]) if palette else 0,
    )


def _head(dataset: Any, path: Path) -> Head:
    frames = whole_of(dataset, "NumberOfFrames") or 1
    if not 1 <= frames <= MAX_FRAMES:
        raise InputError(
            f"the file says it has {frames} frames",
            file=path,
            field="NumberOfFrames",
            fix="the file is damaged: copy it again",
        )
    pointer = text_of(dataset, "FrameIncrementPointer")
    try:
        moments = int(dataset.get("FrameIncrementPointer") or 0) in _TIME_POINTERS
    except (TypeError, ValueError):
        moments = any(name in pointer for name in ("0018,1063", "0018,1065"))
    return Head(
        path,
        path.stat().st_size,
        text_of(dataset, "SOPClassUID"),
        text_of(dataset, "SeriesInstanceUID"),
        whole_of(dataset, "SeriesNumber"),
        text_of(dataset, "SeriesDescription"),
        text_of(dataset, "Modality").upper(),
        text_of(dataset, "ImageType").upper(),
        text_of(dataset, "RescaleType").upper(),
        text_of(dataset, "Units") or text_of(dataset, "DoseUnits"),
        number_of(dataset, "GantryDetectorTilt"),
        _window(dataset),
        bool(items_of(dataset, "ModalityLUTSequence")),
        frames,
        moments and frames > 1,
    )


def _window(dataset: Any) -> tuple[float, float] | None:
    centre, width = numbers_of(dataset, "WindowCenter"), numbers_of(dataset, "WindowWidth")
    return (centre[0], width[0]) if centre and width and width[0] > 0 else None


def _first_frame(dataset: Any, head: Head, rows: int, columns: int, stored: Stored) -> Frame:
    detector = items_of(dataset, "DetectorInformationSequence")
    place = detector[0] if detector and not dataset.get("ImagePositionPatient") else dataset
    slope, intercept = number_of(dataset, "RescaleSlope"), number_of(dataset, "RescaleIntercept")
    dose = number_of(dataset, "DoseGridScaling")
    padding = numbers_of(dataset, "PixelPaddingValue", 1)
    limit = numbers_of(dataset, "PixelPaddingRangeLimit", 1)
    return Frame(
        head=head,
        index=0,
        rows=rows,
        columns=columns,
        stored=stored,
        position=numbers_of(place, "ImagePositionPatient", 3),
        orientation=numbers_of(place, "ImageOrientationPatient", 6),
        spacing=_pair(dataset, "PixelSpacing") or _pair(dataset, "ImagerPixelSpacing"),
        thickness=number_of(dataset, "SpacingBetweenSlices")
        or number_of(dataset, "SliceThickness"),
        slope=dose or (1.0 if slope is None else slope),
        intercept=intercept or 0.0,
        padding=padding and (*padding, *(limit or ())),
        sop=text_of(dataset, "SOPInstanceUID"),
        instance=whole_of(dataset, "InstanceNumber"),
        location=number_of(dataset, "SliceLocation"),
        labels=_labels(dataset),
    )


def _pair(dataset: Any, keyword: str) -> Vector | None:
    found = numbers_of(dataset, keyword, 2)
    return found if found and min(found) > 0 else None


def _labels(*items: Any) -> dict[str, str]:
    found: dict[str, str] = {}
    for item in items:
        for keyword in _LABELS:
            if keyword in item and (value := text_of(item, keyword)):
                found[keyword] = value
    kind = [text_of(item, k) for item in items for k in ("ImageType", "FrameType") if k in item]
    if kind:
        found["ImageType"] = kind[-1]
    return found


def _all_frames(dataset: Any, first: Frame) -> tuple[Frame, ...]:
    count = first.head.frames
    per_frame = items_of(dataset, "PerFrameFunctionalGroupsSequence")
    if per_frame and len(per_frame) != count:
        raise InputError(
            f"{count} frames, but functional groups for {len(per_frame)}",
            file=first.path,
            field="PerFrameFunctionalGroupsSequence",
            fix="the file is damaged: copy it again",
        )
    shared = items_of(dataset, "SharedFunctionalGroupsSequence")
    if per_frame or shared:
        common = _grouped(first, shared[:1])
        groups = per_frame or [None] * count
        return tuple(
            _grouped(replace(common, index=k), [] if item is None else [item])
            for k, item in enumerate(groups)
        )
    if count == 1:
        return (first,)
    return _spread(dataset, first, count)


def _grouped(frame: Frame, groups: Sequence[Any]) -> Frame:
    """The frame with what functional groups (shared ones or its own) say of it."""
    changes: dict[str, Any] = {}
    for group in groups:
        for item in items_of(group, "PlanePositionSequence"):
            changes["position"] = numbers_of(item, "ImagePositionPatient", 3)
        for item in items_of(group, "PlaneOrientationSequence"):
            changes["orientation"] = numbers_of(item, "ImageOrientationPatient", 6)
        for item in items_of(group, "PlanePositionVolumeSequence"):
            changes |= {
                "position": numbers_of(item, "ImagePositionVolume", 3),
                "patient_space": False,
            }
        for item in items_of(group, "PlaneOrientationVolumeSequence"):
            changes["orientation"] = numbers_of(item, "ImageOrientationVolume", 6)
        for item in items_of(group, "PixelMeasuresSequence"):
            changes["spacing"] = _pair(item, "PixelSpacing")
            thickness = number_of(item, "SpacingBetweenSlices") or number_of(item, "SliceThickness")
            changes["thickness"] = thickness
        for item in items_of(group, "PixelValueTransformationSequence"):
            slope = number_of(item, "RescaleSlope")
            changes |= {
                "slope": 1.0 if slope is None else slope,
                "intercept": number_of(item, "RescaleIntercept") or 0.0,
            }
            kind = text_of(item, "RescaleType").upper()
            changes["head"] = replace(frame.head, rescale_type=kind or frame.head.rescale_type)
        for item in items_of(group, "FrameVOILUTSequence"):
            head = changes.get("head", frame.head)
            changes["head"] = replace(head, window=head.window or _window(item))
        inner = [i for name in _LABEL_GROUPS for i in items_of(group, name)]
        inner += list(items_of(group, "MRImageFrameTypeSequence"))
        changes["labels"] = frame.labels | _labels(*inner)
    return replace(frame, **changes)


def _spread(dataset: Any, first: Frame, count: int) -> tuple[Frame, ...]:
    """Frames without functional groups: moments of a film, or one behind the other."""
    frames = [replace(first, index=k) for k in range(count)]
    if first.head.moments:
        return tuple(replace(f, labels=f.labels | {"Frame": f"{f.index:09d}"}) for f in frames)
    if first.position is None or first.orientation is None:
        return tuple(frames)
    offsets = numbers_of(dataset, "GridFrameOffsetVector", count)
    if offsets is None:
        offsets = tuple(k * (first.thickness or 1.0) for k in range(count))
    elif offsets[0] != 0:
        # PS3.3 C.8.8.3.2: offsets that do not begin with 0 are positions along the patient's axis.
        offsets = tuple(o - offsets[0] for o in offsets)
    normal = np.cross(first.orientation[:3], first.orientation[3:])
    places = (np.asarray(first.position) + o * normal for o in offsets)
    return tuple(
        replace(f, position=tuple(map(float, p))) for f, p in zip(frames, places, strict=True)
    )
