"""DICOM files made by pydicom for the tests: a plain CT series and variations of it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from pydicom.dataset import Dataset, FileDataset, FileMetaDataset
from pydicom.sequence import Sequence
from pydicom.uid import (
    UID,
    CTImageStorage,
    EnhancedCTImageStorage,
    ExplicitVRLittleEndian,
    generate_uid,
)

Change = Callable[[FileDataset, int], None]


def image(
    pixels: np.ndarray,
    *,
    uid: str,
    position: tuple[float, float, float] = (0.0, 0.0, 0.0),
    number: int = 1,
    syntax: str = ExplicitVRLittleEndian,
    sop: str = CTImageStorage,
) -> FileDataset:
    """One CT image of `pixels[rows, columns]` (uint16 or int16), 0.5 × 0.75 mm pixels."""
    meta = FileMetaDataset()
    meta.MediaStorageSOPClassUID = sop
    meta.MediaStorageSOPInstanceUID = generate_uid()
    meta.TransferSyntaxUID = syntax
    kind = UID(syntax)
    ds = FileDataset(
        None,
        {},
        file_meta=meta,
        preamble=b"\0" * 128,
        is_implicit_VR=kind.is_implicit_VR,
        is_little_endian=kind.is_little_endian,
    )
    ds.SOPClassUID = sop
    ds.SOPInstanceUID = meta.MediaStorageSOPInstanceUID
    ds.PatientName = "CANARY^NAME"
    ds.PatientID = "CANARY-ID"
    ds.Modality = "CT"
    ds.SeriesInstanceUID = uid
    ds.StudyInstanceUID = generate_uid(entropy_srcs=["study"])
    ds.SeriesNumber = 3
    ds.SeriesDescription = "made for a test"
    ds.InstanceNumber = number
    ds.ImagePositionPatient = list(position)
    ds.ImageOrientationPatient = [1, 0, 0, 0, 1, 0]
    ds.PixelSpacing = [0.5, 0.75]
    ds.SliceThickness = 9
    ds.RescaleSlope = 1
    ds.RescaleIntercept = -1024
    put_pixels(ds, pixels)
    return ds


def put_pixels(ds: Dataset, pixels: np.ndarray) -> None:
    """Rows, columns, bits and the pixels themselves."""
    ds.SamplesPerPixel = 1
    ds.PhotometricInterpretation = "MONOCHROME2"
    ds.Rows, ds.Columns = pixels.shape[-2:]
    ds.BitsAllocated = ds.BitsStored = 8 * pixels.itemsize
    ds.HighBit = ds.BitsStored - 1
    ds.PixelRepresentation = int(pixels.dtype.kind == "i")
    ds.PixelData = pixels.tobytes()
    ds["PixelData"].VR = "OW"


def save(ds: FileDataset, path: Path) -> Path:
    """Write it as a DICOM file."""
    path.parent.mkdir(parents=True, exist_ok=True)
    ds.save_as(path, enforce_file_format=True)
    return path


def voxels(count: int, rows: int = 5, columns: int = 7) -> np.ndarray:
    """uint16[count, rows, columns], each slice and pixel different."""
    z, y, x = np.mgrid[0:count, 0:rows, 0:columns]
    return (1000 + 100 * z + 10 * y + x).astype(np.uint16)


def series(
    folder: Path,
    count: int = 6,
    *,
    change: Change | None = None,
    names: list[str] | None = None,
    step: tuple[float, float, float] = (0.0, 0.0, 2.5),
    data: np.ndarray | None = None,
    uid: str | None = None,
) -> np.ndarray:
    """A series of `count` images in `folder`; returns the stored voxels in order of position."""
    data = voxels(count) if data is None else data
    uid = uid or generate_uid(entropy_srcs=["series", str(folder)])
    for k in range(count):
        place = tuple(10.0 * (1 + i) + k * s for i, s in enumerate(step))
        ds = image(data[k], uid=uid, position=place, number=count - k)
        if change is not None:
            change(ds, k)
        save(ds, folder / (names[k] if names else f"slice{k:03d}.dcm"))
    return data


def enhanced(count: int = 5, *, shuffle: bool = True) -> tuple[FileDataset, np.ndarray]:
    """A multi-frame CT, frames shuffled: geometry and rescale stand in functional groups only."""
    data = voxels(count)
    order = [(k * 3) % count for k in range(count)] if shuffle else list(range(count))
    ds = image(data[0], uid=generate_uid(), sop=EnhancedCTImageStorage)
    for keyword in (
        "ImagePositionPatient",
        "ImageOrientationPatient",
        "PixelSpacing",
        "SliceThickness",
        "RescaleSlope",
        "RescaleIntercept",
    ):
        del ds[keyword]
    shared, measures, plane, values = Dataset(), Dataset(), Dataset(), Dataset()
    measures.PixelSpacing, measures.SliceThickness = [0.4, 0.6], 9
    plane.ImageOrientationPatient = [0, 1, 0, 0, 0, -1]
    values.RescaleSlope, values.RescaleIntercept, values.RescaleType = 2, -1000, "HU"
    shared.PixelMeasuresSequence = Sequence([measures])
    shared.PlaneOrientationSequence = Sequence([plane])
    shared.PixelValueTransformationSequence = Sequence([values])
    ds.SharedFunctionalGroupsSequence = Sequence([shared])
    groups = []
    for k in order:
        group, position = Dataset(), Dataset()
        position.ImagePositionPatient = [-50.0 - 3.0 * k, 5.0, 70.0]
        group.PlanePositionSequence = Sequence([position])
        groups.append(group)
    ds.PerFrameFunctionalGroupsSequence = Sequence(groups)
    put_pixels(ds, data[order])
    ds.NumberOfFrames = count
    return ds, data
