"""Which format a file is in, by its first bytes; a folder by what lies in it."""

from __future__ import annotations

import re
import struct
import zlib
from collections import Counter
from pathlib import Path

from volviz.errors import InputError, safe_text

HEAD = 1024
_IMAGE_MAGIC = (b"\x89PNG\r\n\x1a\n", b"\xff\xd8\xff", b"BM")
_LEVELS = 4
_STORE_MARKS = (".zgroup", ".zarray", ".zattrs", "zarr.json", ".n5group")
_SLICE_SUFFIXES = (".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff")


def head(path: Path) -> bytes:
    """The first bytes; of a gzip file the first bytes of what it holds (none if it is broken)."""
    try:
        with path.open("rb") as file:
            raw = file.read(4 * HEAD)
    except OSError as error:
        raise InputError(
            error.strerror or str(error), file=path, fix="check the file and its disk"
        ) from error
    if raw[:2] != b"\x1f\x8b":
        return raw[:HEAD]
    try:
        return zlib.decompressobj(wbits=31).decompress(raw, HEAD)
    except zlib.error:
        return b""


def is_gzip(path: Path) -> bool:
    """True for a gzip file, whatever it holds."""
    with path.open("rb") as file:
        return file.read(2) == b"\x1f\x8b"


def is_nrrd(head: bytes) -> bool:
    """NRRD0001 … NRRD0005."""
    return head.startswith(b"NRRD000")


def is_nifti(head: bytes) -> bool:
    """NIfTI-1 (single file or header) and NIfTI-2, either byte order."""
    if len(head) < 348:
        return False
    size = {struct.unpack("<i", head[:4])[0], struct.unpack(">i", head[:4])[0]}
    one = 348 in size and head[344:348] in (b"n+1\0", b"ni1\0")
    two = 540 in size and head[4:7] in (b"n+2", b"ni2")
    return one or two


def is_metaimage(head: bytes) -> bool:
    """Lines of `key = value` that begin with a MetaImage key."""
    return re.match(
        rb"\s*(ObjectType|NDims|Comment|ObjectSubType|Name|ID)\s*=", head
    ) is not None and (b"NDims" in head or b"DimSize" in head or b"ObjectType" in head)


def is_dicom(head: bytes) -> bool:
    """DICM after the preamble, or a data set that begins with group 0002 or 0008."""
    if head[128:132] == b"DICM":
        return True
    if len(head) < 16 or head[:4] not in (
        b"\x02\0\0\0",
        b"\x08\0\0\0",
        b"\x08\0\x05\0",
        b"\x08\0\x08\0",
        b"\x08\0\x01\0",
    ):
        return False
    explicit = head[4:6].isalpha() and head[4:6].isupper()
    implicit = 0 < struct.unpack("<I", head[4:8])[0] < 256
    return explicit or implicit


def is_tiff(head: bytes) -> bool:
    """Classic TIFF and BigTIFF, either byte order."""
    return head[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def is_mrc(head: bytes) -> bool:
    """`MAP ` at byte 208."""
    return head[208:212] in (b"MAP ", b"MAP\0")


def is_numpy(head: bytes) -> bool:
    """.npy, or a zip whose first member is one."""
    if head.startswith(b"\x93NUMPY"):
        return True
    if not head.startswith(b"PK\x03\x04") or len(head) < 30:
        return False
    length = struct.unpack("<H", head[26:28])[0]
    return head[30 : 30 + length].endswith(b".npy")


def is_image(head: bytes) -> bool:
    """PNG, JPEG, BMP."""
    if head.startswith(_IMAGE_MAGIC[:2]):
        return True
    sizes = (12, 40, 52, 56, 64, 108, 124)
    return head.startswith(b"BM") and struct.unpack("<I", head[14:18].ljust(4, b"\0"))[0] in sizes


def is_raw_header(head: bytes) -> bool:
    """A text that describes a RAW file: an Inviwo or Voreen .dat, or JSON with file and dtype."""
    text = head[:HEAD].lower()
    if text.lstrip().startswith(b"{"):
        return (
            b'"file"' in text and b'"dtype"' in text and (b'"dims"' in text or b'"shape"' in text)
        )
    return re.search(rb"^\s*(rawfile|objectfilename)\s*:", text, re.MULTILINE) is not None


def is_slice_name(name: str) -> bool:
    """A file name that a picture of a slice would have."""
    return name.lower().endswith(_SLICE_SUFFIXES)


def folder_format(path: Path) -> str | None:
    """ "dicom" or "images" for a folder of slices, None if it is neither."""
    files = sorted(p for p in files_in(path) if not p.name.startswith("."))
    if any(is_dicom(head(p)) for p in files[:64]):
        return "dicom"
    if _holds_pictures(files):
        return "images"
    level = [path]
    for _ in range(_LEVELS):
        level = [below for folder in level for below in sorted(folders_in(folder))][:64]
        if any(is_dicom(head(p)) for folder in level for p in sorted(files_in(folder))[:16]):
            return "dicom"
    return None


def _holds_pictures(files: list[Path]) -> bool:
    slices = [p for p in files if is_slice_name(p.name)]
    return any(is_image(h) or is_tiff(h) for h in map(head, slices[:8]))


def folders_of_slices(path: Path) -> list[str]:
    """Names of the folders right below that hold pictures."""
    return [d.name for d in sorted(folders_in(path))[:64] if _holds_pictures(sorted(files_in(d)))]


def store_of(path: Path, *, within: bool = True) -> Path | None:
    """The Zarr or N5 store that this folder is (or with `within` lies in), None if none."""
    for folder in (path, *path.absolute().parents[: 8 if within else 0]):
        if any((folder / mark).is_file() for mark in _STORE_MARKS):
            return folder
        if folder.name.lower().endswith((".zarr", ".n5")) and folder.is_dir():
            return folder
    return None


def folder_summary(path: Path) -> str:
    """What lies in a folder, counted by suffix, for a message."""
    counts = Counter(p.suffix.lower() or "no suffix" for p in files_in(path))
    if not counts:
        return "it is empty"
    return ", ".join(f"{n} × {safe_text(s)}" for s, n in counts.most_common(6))


def known_but_unread(name: str, head: bytes) -> tuple[str, str] | None:
    """What is wrong and what to do, for formats that are known but not read."""
    if name.endswith((".vti", ".vtr", ".vts", ".vtu", ".vtp", ".vtk", ".pvti", ".pvtu")) or (
        head.startswith(b"# vtk DataFile")
        or (head.lstrip().startswith(b"<") and b"<VTKFile" in head)
    ):
        return "VTK files are not read yet", "convert it to NRRD, MetaImage or NIfTI"
    if head.startswith(b"\x89HDF"):
        return "HDF5 files are not read yet", "save the data set as .npy, TIFF or NRRD"
    if name.endswith((".zarr", ".n5")):
        return "Zarr and N5 are not read yet", "save the array as .npy, TIFF or NRRD"
    if head.startswith(b"PK\x03\x04"):
        return "a zip archive without NumPy arrays", "unpack it and open what is in it"
    if name.endswith((".zraw", ".img")):
        return "voxels without their header", "open the header (.mhd, .hdr) that lies beside them"
    if head and _is_text(head):
        return (
            "the content is of no known format (it is text)",
            "give a file of voxels, or the header of one",
        )
    return None


def _is_text(head: bytes) -> bool:
    try:
        text = head.decode("utf-8")
    except UnicodeDecodeError as error:
        if error.start < len(head) - 3:
            return False
        text = head[: error.start].decode("utf-8")
    return all(c.isprintable() or c in "\t\r\n\f" for c in text)


def files_in(path: Path) -> list[Path]:
    """Regular files in a folder, links to such included."""
    return [p for p in _children(path) if p.is_file()]


def folders_in(path: Path) -> list[Path]:
    """Folders in a folder, links left out."""
    return [p for p in _children(path) if p.is_dir() and not p.is_symlink()]


def _children(path: Path) -> list[Path]:
    try:
        return list(path.iterdir())
    except OSError as error:
        raise InputError(
            error.strerror or str(error), file=path, fix="check the file and its disk"
        ) from error
