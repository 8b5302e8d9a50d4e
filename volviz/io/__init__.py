"""Files to volumes. One format per module; the content of a file decides, not its name alone.

Each module offers `probe(path, options) -> VolumeInfo` (header only, no voxels read where the
format allows) and `read(path, options) -> Volume`. Modules are imported on first use, so that
opening a NIfTI never waits for pydicom.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

from volviz.errors import InputError, UnsupportedError, safe_text
from volviz.files import path_of
from volviz.io import sniff
from volviz.io.options import Limits, ReadOptions
from volviz.model.volume import Volume, VolumeInfo

__all__ = ["FORMATS", "Format", "Limits", "ReadOptions", "identify", "load", "probe"]


@dataclass(frozen=True)
class Format:
    """One row of the registry. suffixes: lower case, compound ones first; magic: content test."""

    module: str
    title: str
    suffixes: tuple[str, ...]
    magic: Callable[[bytes], bool]


FORMATS: dict[str, Format] = {
    "nrrd": Format("volviz.io.nrrd", "NRRD", (".seg.nrrd", ".nrrd", ".nhdr"), sniff.is_nrrd),
    "nifti": Format(
        "volviz.io.nifti",
        "NIfTI",
        (".nii.gz", ".nii", ".hdr.gz", ".img.gz", ".hdr", ".img"),
        sniff.is_nifti,
    ),
    "metaimage": Format("volviz.io.metaimage", "MetaImage", (".mha", ".mhd"), sniff.is_metaimage),
    "dicom": Format("volviz.io.dicom", "DICOM", (".dcm", ".dicom", ".ima"), sniff.is_dicom),
    "tiff": Format(
        "volviz.io.tiff",
        "TIFF",
        (".ome.tif", ".ome.tiff", ".tif", ".tiff", ".btf", ".lsm"),
        sniff.is_tiff,
    ),
    "mrc": Format(
        "volviz.io.mrc", "MRC/CCP4", (".mrc", ".map", ".ccp4", ".st", ".rec", ".ali"), sniff.is_mrc
    ),
    "numpy": Format("volviz.io.numpy_file", "NumPy", (".npy", ".npz"), sniff.is_numpy),
    "images": Format(
        "volviz.io.images", "image slices", (".png", ".jpg", ".jpeg", ".bmp"), sniff.is_image
    ),
    "raw": Format("volviz.io.raw", "RAW", (".raw", ".bin", ".dat", ".raw.gz"), sniff.is_raw_header),
}


def load(path: str | Path, options: ReadOptions | None = None, **choices: Any) -> Volume:
    """Read any supported file or folder.

    Keywords are the fields of `ReadOptions` (series, time, channel, shape, dtype, …). Raises
    InputError, UnsupportedError, LimitError, UsageError for what is no path, or Cancelled; nothing
    half-read is ever returned.
    """
    options = options or ReadOptions(**choices)
    where = path_of(path)
    volume: Volume = _module(identify(where, options)).read(where, options)
    told = replace(volume.info, source=where, choices=options.chosen())
    return replace(volume, info=told)


def probe(path: str | Path, options: ReadOptions | None = None, **choices: Any) -> VolumeInfo:
    """What `load` would give, without loading it."""
    options = options or ReadOptions(**choices)
    where = path_of(path)
    return _module(identify(where, options)).probe(where, options)


def identify(path: Path, options: ReadOptions | None = None) -> str:
    """The key in FORMATS that reads this file or folder."""
    check_readable(path)
    if path.is_dir():
        return _identify_folder(path)
    if options is not None and options.shape is not None:
        return "raw"
    head = sniff.head(path)
    for name, form in FORMATS.items():
        if form.magic(head):
            _refuse_packed(path, name)
            return name
    lower = path.name.lower()
    for name, form in FORMATS.items():
        if lower.endswith(form.suffixes):
            return name
    _refuse_store(path)
    reason = sniff.known_but_unread(lower, head)
    if reason:
        raise UnsupportedError(reason[0], file=path, fix=reason[1])
    titles = ", ".join(f.title for f in FORMATS.values())
    raise UnsupportedError(
        "the content is of no known format",
        file=path,
        fix=f"volviz reads {titles}; for RAW voxels give --shape and --dtype",
    )


def check_readable(path: Path) -> None:
    """Raise InputError for a path that is missing, empty, unreadable or no regular file."""
    try:
        exists = path.exists()
    except OSError as error:
        raise InputError(error.strerror or str(error), file=path, fix="check the path") from error
    except ValueError as error:
        raise InputError("not a valid path", file=path, fix="check the path") from error
    if not exists:
        raise InputError("no such file or folder", file=path, fix=_nearest_name(path))
    if path.is_dir():
        return
    if not path.is_file():
        raise InputError("not a regular file", file=path, fix="give a file or a folder")
    try:
        with path.open("rb") as file:
            if not file.read(1):
                raise InputError("the file is empty (0 bytes)", file=path, fix="copy it again")
    except PermissionError as error:
        raise InputError("permission denied", file=path, fix="check who may read it") from error
    except OSError as error:
        raise InputError(error.strerror or "cannot be read", file=path) from error


def _refuse_packed(path: Path, name: str) -> None:
    if name in ("dicom", "tiff", "images") and sniff.is_gzip(path):
        raise UnsupportedError(
            f"{FORMATS[name].title} inside gzip is not read", file=path, fix="unpack it first"
        )


def _refuse_store(path: Path, *, within: bool = True) -> None:
    store = sniff.store_of(path, within=within)
    if store is not None:
        name = safe_text(store.name, 80)
        raise UnsupportedError(
            "Zarr and N5 stores are not read yet"
            if store == path
            else f"a piece of the Zarr or N5 store {name}, which is not read yet",
            file=path,
            fix="save the array as .npy, TIFF or NRRD",
        )


def _identify_folder(path: Path) -> str:
    _refuse_store(path, within=False)
    found = sniff.folder_format(path)
    if found is None:
        _refuse_store(path)
        below = sniff.folders_of_slices(path)
        if below:
            raise InputError(
                f"no slices in this folder itself, but in {', '.join(map(safe_text, below[:6]))}",
                file=path,
                fix=f"open {safe_text(path / below[0])}",
            )
        kinds = sniff.folder_summary(path)
        raise InputError(
            f"no DICOM files and no image slices in this folder ({kinds})",
            file=path,
            fix="give a file, or a folder of DICOM, PNG, JPEG or TIFF slices",
        )
    return found


def _nearest_name(path: Path) -> str:
    if path.name.startswith("sample:"):
        return f"samples are made by volviz.sample('{safe_text(path.name[7:])}')"
    try:
        names = [p.name for p in path.parent.iterdir()]
    except OSError:
        return "check the path"
    near = difflib.get_close_matches(path.name, names, n=1, cutoff=0.6)
    return f"did you mean '{safe_text(near[0])}'?" if near else "check the path"


def _module(name: str) -> Any:
    return import_module(FORMATS[name].module)
