"""Volumes to files: NRRD and NIfTI, written whole or not at all.

NRRD keeps everything (positions as float64, unit, modality, kind, padding, window). NIfTI-1 keeps
positions as float32 and has no place for modality and padding; grids longer than 32767 samples
along an axis are written as NIfTI-2.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from volviz.errors import OutputError, UsageError, safe_text
from volviz.files import path_of, write_atomically
from volviz.io.geometry import RAS_TO_LPS
from volviz.model.volume import Volume, VolumeInfo
from volviz.progress import Progress, silent

_CHUNK = 1 << 20
_LEVEL = 4
_MOST_NIFTI1 = 32767
_NRRD_TYPES = {
    "int8": "int8",
    "uint8": "uint8",
    "int16": "int16",
    "uint16": "uint16",
    "int32": "int32",
    "uint32": "uint32",
    "int64": "int64",
    "uint64": "uint64",
    "float32": "float",
    "float64": "double",
}


def save_volume(
    volume: Volume,
    path: str | Path,
    *,
    overwrite: bool = False,
    compress: bool = True,
    progress: Progress | None = None,
) -> None:
    """Write a volume as .nrrd, .nii or .nii.gz, by the name. Little endian.

    compress: gzip for .nrrd; .nii and .nii.gz say it themselves. Raises OutputError if the file
    cannot be written, is there and `overwrite` is false, or cannot hold the volume; UsageError
    for another suffix, or what is no volume or path; Cancelled. What was there before stays on any
    failure.
    """
    if not isinstance(volume, Volume):
        raise UsageError(f"this is no Volume but {type(volume).__name__}", field="volume")
    target = path_of(path)
    name = target.name.lower()
    if name.endswith(".nrrd"):
        head, packed = _nrrd_header(volume.info, compress), compress
    elif name.endswith((".nii", ".nii.gz")):
        head, packed = _nifti_header(volume.info, target), name.endswith(".gz")
    else:
        raise UsageError(
            "volumes are written as .nrrd, .nii or .nii.gz", file=target, fix="use such a suffix"
        )
    whole = packed and not name.endswith(".nrrd")
    writer = _writer(volume.data, head, packed=packed, whole=whole, progress=progress or silent())
    write_atomically(target, writer, overwrite=overwrite)


def _writer(
    data: NDArray[Any], head: bytes, *, packed: bool, whole: bool, progress: Progress
) -> Callable[[BinaryIO], None]:
    """Writes header and voxels. packed: voxels as gzip; whole: the header within it."""

    def write(file: BinaryIO) -> None:
        if not packed:
            file.write(head)
            for piece in _pieces(data, progress):
                file.write(piece)
            return
        squeeze = zlib.compressobj(_LEVEL, zlib.DEFLATED, 31)
        file.write(squeeze.compress(head) if whole else head)
        for piece in _pieces(data, progress):
            file.write(squeeze.compress(piece))
        file.write(squeeze.flush())

    return write


def _pieces(data: NDArray[Any], progress: Progress) -> Iterator[bytes]:
    """The voxels in little-endian bytes, x fastest."""
    flat = data.reshape(-1)
    for start in range(0, flat.size, _CHUNK):
        progress(start / flat.size, "writing the volume")
        yield flat[start : start + _CHUNK].astype(data.dtype.newbyteorder("<")).tobytes()
    progress(1.0, "writing the volume")


def _nrrd_header(info: VolumeInfo, compress: bool) -> bytes:
    """http://teem.sourceforge.net/nrrd/format.html; lengths in mm, LPS if the space is known."""
    steps, origin = info.affine[:3, :3].T, info.affine[:3, 3]
    vectors = " ".join(_vector(step) for step in steps)
    lines = [
        "NRRD0005",
        f"type: {_NRRD_TYPES[info.dtype.name]}",
        "dimension: 3",
        "space: left-posterior-superior" if info.space else "space dimension: 3",
        f"sizes: {' '.join(map(str, info.dims))}",
        f"space directions: {vectors}",
        "kinds: domain domain domain",
        f"endian: little\nencoding: {'gzip' if compress else 'raw'}",
        f"space origin: {_vector(origin)}",
    ]
    if info.length_unit:
        lines.append('space units: "mm" "mm" "mm"')
    if info.value_unit:
        lines.append(f"sample units: {safe_text(info.value_unit, 60)}")
    keys: dict[str, Any] = {"modality": info.modality, "volviz padding": info.padding}
    if info.kind == "labels":
        keys["kind"] = "labels"
    if info.window is not None:
        keys["volviz window"] = " ".join(repr(float(w)) for w in info.window)
    lines += [f"{key}:={safe_text(value)}" for key, value in keys.items() if value is not None]
    return ("\n".join(lines) + "\n\n").encode("utf-8")


def _vector(values: NDArray[np.float64]) -> str:
    return "(" + ",".join(repr(float(v)) for v in values) + ")"


def _nifti_header(info: VolumeInfo, target: Path) -> bytes:
    """Header, and the four bytes that say that no extension follows."""
    import nibabel as nib

    long = max(info.dims) > _MOST_NIFTI1
    header = (nib.Nifti2Header if long else nib.Nifti1Header)(endianness="<")
    header.set_data_dtype(info.dtype)
    header.set_data_shape(info.dims)
    header["scl_slope"], header["scl_inter"] = 1, 0
    header["vox_offset"] = header.single_vox_offset
    if info.space is None:
        _plain(info, target)
        header["pixdim"][1:4] = info.spacing
    else:
        affine = RAS_TO_LPS @ info.affine
        header.set_sform(affine, code="scanner")
        header["pixdim"][1:4] = info.spacing
        unit = affine[:3, :3] / np.linalg.norm(affine[:3, :3], axis=0)
        if np.allclose(unit.T @ unit, np.eye(3), atol=1e-6):
            header.set_qform(affine, code="scanner")
    if info.space is not None or info.length_unit:
        header.set_xyzt_units("mm", "unknown")
    if info.kind == "labels":
        header["intent_code"] = 1002
    if info.window is not None:
        centre, width = info.window
        header["cal_min"], header["cal_max"] = centre - width / 2, centre + width / 2
    return bytes(header.binaryblock) + b"\0\0\0\0"


def _plain(info: VolumeInfo, target: Path) -> None:
    """Raise OutputError for a geometry that NIfTI can only store with an orientation."""
    if not np.array_equal(info.affine, np.diag([*info.spacing, 1.0])):
        raise OutputError(
            "NIfTI cannot hold an origin or directions in a space that is not a patient's",
            file=target,
            fix="save it as .nrrd",
        )
