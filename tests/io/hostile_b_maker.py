"""DICOM, TIFF, MRC, NumPy, picture and RAW files, whole and broken, made in a folder."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable
from pathlib import Path

import mrcfile
import numpy as np
import tifffile
from PIL import Image
from pydicom.uid import ImplicitVRLittleEndian, generate_uid

import tests.io.dicom_maker as maker

GREY = np.arange(3 * 20 * 24, dtype="u2").reshape(3, 20, 24)
Make = Callable[[Path], Path]


def dicom(folder: Path, name: str = "a.dcm", **changes: object) -> Path:
    """A DICOM image of 5 × 7 pixels with header values changed (None: removed)."""
    syntax = str(changes.pop("syntax", "1.2.840.10008.1.2.1"))
    ds = maker.image(maker.voxels(1)[0], uid=generate_uid(), syntax=syntax)
    for keyword, value in changes.items():
        if value is None:
            delattr(ds, keyword)
        else:
            setattr(ds, keyword, value)
    return maker.save(ds, folder / name)


def tiff(folder: Path, name: str = "a.tif", **choices: object) -> Path:
    path = folder / name
    choices = {"photometric": "minisblack", "metadata": None, **choices}
    tifffile.imwrite(path, GREY, **choices)
    return path


def patched_tiff(folder: Path, **tags: int) -> Path:
    """A one-page TIFF with tag values overwritten."""
    path = folder / "a.tif"
    tifffile.imwrite(path, GREY[0], photometric="minisblack", metadata=None, byteorder="<")
    content = bytearray(path.read_bytes())
    with tifffile.TiffFile(path) as tif:
        for name, value in tags.items():
            tag = tif.pages[0].tags[name]
            form = "<H" if tag.dtype == 3 and value < 65536 else "<I"
            if form == "<I":
                content[tag.offset + 2 : tag.offset + 4] = struct.pack("<H", 4)
            struct.pack_into(form, content, tag.valueoffset, value)
    path.write_bytes(content)
    return path


def looped_tiff(folder: Path) -> Path:
    """The second page says that the first comes next."""
    path = tiff(folder)
    content = bytearray(path.read_bytes())
    with tifffile.TiffFile(path) as tif:
        first, second = tif.pages[0].offset, tif.pages[1].offset
    (count,) = struct.unpack("<H", content[second : second + 2])
    struct.pack_into("<I", content, second + 2 + 12 * count, first)
    path.write_bytes(content)
    return path


def mrc(folder: Path, name: str = "a.mrc") -> Path:
    path = folder / name
    with mrcfile.new(path) as file:
        file.set_data(GREY.astype("i2"))
    return path


def npz(folder: Path, name: str = "a.npz") -> Path:
    np.savez_compressed(folder / name, volume=GREY)
    return folder / name


def npy(folder: Path, name: str = "a.npy") -> Path:
    np.save(folder / name, GREY)
    return folder / name


def png(folder: Path, name: str = "a.png") -> Path:
    Image.fromarray(GREY[0].astype("u1")).save(folder / name)
    return folder / name


def descriptor(folder: Path, file: str = "v.raw") -> Path:
    (folder / "v.raw").write_bytes(GREY.tobytes())
    path = folder / "a.dat"
    path.write_text(f"RawFile: {file}\nResolution: 24 20 3\nFormat: UINT16\n")
    return path


def cut(path: Path, by: int) -> Path:
    path.write_bytes(path.read_bytes()[:-by])
    return path


def holding(name: str, content: bytes) -> Make:
    def make(folder: Path) -> Path:
        (folder / name).write_bytes(content)
        return folder / name

    return make


def nested_dicom(folder: Path) -> Path:
    path = dicom(folder, syntax=ImplicitVRLittleEndian)
    body = path.read_bytes()
    item = b"\x08\x00\x40\x11" + b"\xff" * 4 + b"\xfe\xff\x00\xe0" + b"\xff" * 4
    path.write_bytes(body[: body.index(b"\x08\0\x16\0")] + item * 3000)
    return path


def encoded_dicom(folder: Path, stream: bytes, syntax: str) -> Path:
    from pydicom.encaps import encapsulate

    ds = maker.image(maker.voxels(1)[0], uid=generate_uid(), syntax=syntax)
    ds.PixelData = encapsulate([stream])
    ds["PixelData"].VR = "OB"
    ds["PixelData"].is_undefined_length = True
    return maker.save(ds, folder / "a.dcm")


def giant_j2k() -> bytes:
    """A codestream header of 60000 × 60000."""
    sizes = struct.pack(">HHLLLLLLLLH", 41, 0, 60000, 60000, 0, 0, 60000, 60000, 0, 0, 1)
    return b"\xff\x4f\xff\x51" + sizes + b"\x07\x01\x01" + bytes(40)


def giant_jpeg() -> bytes:
    return b"\xff\xd8\xff\xc0" + struct.pack(">HBHHB", 11, 8, 65000, 65000, 1) + bytes(40)


def ome_with_dtd(folder: Path) -> Path:
    laughs = '<!DOCTYPE x [<!ENTITY a "aaaaaaaaaa">]>'
    text = f'<?xml version="1.0"?>{laughs}<OME><Image><Pixels/></Image></OME>'
    return tiff(folder, "a.ome.tif", description=text)


def ome_of(sizes: str, blocks: str = "") -> Make:
    text = (
        f'<?xml version="1.0"?><OME><Image><Pixels DimensionOrder="XYZCT" {sizes}>{blocks}'
        "</Pixels></Image></OME>"
    )
    return lambda folder: tiff(folder, "a.ome.tif", description=text)


def two_keys(folder: Path) -> Path:
    np.savez(folder / "a.npz", one=GREY, two=GREY)
    return folder / "a.npz"


def structured(folder: Path) -> Path:
    np.save(folder / "a.npy", np.zeros((3, 4, 5), dtype=[("a", "f4")]))
    return folder / "a.npy"


def pickled(folder: Path) -> Path:
    np.save(folder / "a.npy", np.array([[[{}]]], dtype=object), allow_pickle=True)
    return folder / "a.npy"


def fifo(folder: Path) -> Path:
    os.mkfifo(folder / "v2.raw")
    return descriptor(folder, "v2.raw")


def escaping_link(folder: Path) -> Path:
    (folder.parent / "outside.raw").write_bytes(GREY.tobytes())
    (folder / "v3.raw").symlink_to(folder.parent / "outside.raw")
    return descriptor(folder, "v3.raw")


def mixed_pngs(folder: Path) -> Path:
    for k, size in enumerate([(5, 5), (5, 5), (5, 6)]):
        Image.new("L", size).save(folder / f"{k}.png")
    return folder


def two_series(folder: Path) -> Path:
    maker.series(folder, 3, uid=generate_uid(), names=["a", "b", "c"])
    maker.series(folder, 3, uid=generate_uid(), names=["d", "e", "f"])
    return folder
