"""NRRD, MetaImage and NIfTI files by hand, with any field changed."""

from __future__ import annotations

import nibabel as nib
import numpy as np

ARRAY = (np.arange(4 * 5 * 6) % 120).reshape(4, 5, 6).astype("<i2")
RAW = ARRAY.tobytes()
NRRD = {"type": "short", "dimension": "3", "sizes": "6 5 4", "endian": "little", "encoding": "raw"}
META = {
    "ObjectType": "Image",
    "NDims": "3",
    "DimSize": "6 5 4",
    "ElementType": "MET_SHORT",
    "ElementDataFile": "LOCAL",
}


def nrrd(payload: bytes = RAW, **changes: str | None) -> bytes:
    fields = {**NRRD, **{k.replace("_", " "): v for k, v in changes.items()}}
    lines = [f"{key}: {value}" for key, value in fields.items() if value is not None]
    return ("NRRD0004\n" + "\n".join(lines) + "\n\n").encode() + payload


def meta(payload: bytes = RAW, **changes: str | None) -> bytes:
    fields = {**META, **changes}
    fields["ElementDataFile"] = fields.pop("ElementDataFile")
    lines = [f"{key} = {value}" for key, value in fields.items() if value is not None]
    return ("\n".join(lines) + "\n").encode() + payload


def nifti(payload: bytes = RAW, two: bool = False, **changes: object) -> bytes:
    header = (nib.Nifti2Header if two else nib.Nifti1Header)(endianness="<")
    header.set_data_dtype("<i2")
    header.set_data_shape((6, 5, 4))
    header["vox_offset"] = header.single_vox_offset
    header.set_sform(np.eye(4), 1)
    with np.errstate(all="ignore"):
        for key, value in changes.items():
            header[key] = value
    return header.binaryblock + bytes(4) + payload
