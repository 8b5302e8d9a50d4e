"""Broken DICOM, TIFF, MRC, NumPy, picture and RAW files: a clear error or a right volume."""

from __future__ import annotations

import io
import os
import struct
import subprocess
import sys
import textwrap
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import tifffile

import tests.io.dicom_maker as maker
from tests.io.hostile_b_maker import (
    GREY,
    Make,
    cut,
    descriptor,
    dicom,
    encoded_dicom,
    escaping_link,
    fifo,
    giant_j2k,
    giant_jpeg,
    holding,
    looped_tiff,
    mixed_pngs,
    mrc,
    nested_dicom,
    npy,
    npz,
    ome_of,
    ome_with_dtd,
    patched_tiff,
    pickled,
    png,
    structured,
    tiff,
    two_keys,
    two_series,
)
from volviz.errors import VolvizError
from volviz.io import load
from volviz.io.options import Limits, ReadOptions

SMALL = ReadOptions(limits=Limits(max_bytes=1 << 30))


J2K, JPEG = "1.2.840.10008.1.2.4.90", "1.2.840.10008.1.2.4.70"
BIG = 1 << 31
CASES: list[tuple[str, Make, int, str, str]] = [
    ("2 folder without images", lambda f: f, 3, "", "it is empty"),
    ("4 empty file", holding("a.dcm", b""), 3, "", "empty (0 bytes)"),
    ("35 two series", two_series, 2, "series", "--series"),
    ("43 nested", nested_dicom, 3, "", "nested too deeply"),
    (
        "43 mark and noise",
        holding("a.dcm", bytes(128) + b"DICM" + bytes(range(256))),
        3,
        "PixelData",
        "",
    ),
    ("43 mark only", holding("a.dcm", bytes(128) + b"DICM"), 3, "PixelData", "cut off"),
    ("43 no pixels", lambda f: dicom(f, PixelData=None), 3, "PixelData", "without pixels"),
    ("43 no rows", lambda f: dicom(f, Rows=None), 3, "PixelData", "without pixels"),
    ("43 rows 0", lambda f: dicom(f, Rows=0), 3, "Rows", "0 rows"),
    ("43 pixels cut", lambda f: cut(dicom(f), 9), 3, "PixelData", "61 of 70 bytes"),
    ("43 rows too many", lambda f: dicom(f, Rows=60000), 3, "PixelData", "cut off"),
    ("43 frames", lambda f: dicom(f, NumberOfFrames=2_000_000), 3, "NumberOfFrames", "2000000"),
    ("43 frames cut", lambda f: dicom(f, NumberOfFrames=9), 3, "PixelData", "are declared"),
    ("43 bits", lambda f: dicom(f, BitsAllocated=12), 3, "BitsAllocated", "12 bits"),
    ("43 samples", lambda f: dicom(f, SamplesPerPixel=7), 3, "PixelData", ""),
    (
        "41 unknown syntax",
        lambda f: encoded_dicom(f, b"xx", "1.2.840.10008.1.2.4.100"),
        4,
        "TransferSyntaxUID",
        "1.2.840.10008.1.2.4.100",
    ),
    ("43 J2K bomb", lambda f: encoded_dicom(f, giant_j2k(), J2K), 3, "PixelData", "60000 × 60000"),
    ("43 JPEG bomb", lambda f: encoded_dicom(f, giant_jpeg(), JPEG), 3, "PixelData", "65000"),
    ("43 no J2K", lambda f: encoded_dicom(f, b"\0" * 64, J2K), 3, "PixelData", "no JPEG 2000"),
    (
        "43 RLE short",
        lambda f: encoded_dicom(
            f, struct.pack("<16L", 2, 64, 66, *[0] * 13) + b"\0a\0a", maker_rle()
        ),
        3,
        "PixelData",
        "ends before the image is full",
    ),
    ("45 loop", looped_tiff, 3, "IFD 2", "back to an earlier page"),
    (
        "45 pages cut",
        lambda f: cut(tiff(f, compression="zlib"), 400),
        3,
        "StripOffsets, StripByteCounts",
        "",
    ),
    (
        "45 4e9 x 4e9",
        lambda f: patched_tiff(f, ImageWidth=4_000_000_000, ImageLength=4_000_000_000),
        3,
        "ImageWidth, ImageLength, pages",
        "4000000000",
    ),
    (
        "45 2e9 x 2e4",
        lambda f: patched_tiff(f, ImageWidth=2_000_000_000, ImageLength=20_000),
        6,
        "ImageWidth, ImageLength, pages",
        "needs",
    ),
    (
        "45 longer than file",
        lambda f: patched_tiff(f, ImageLength=4000),
        3,
        "StripOffsets",
        "expected",
    ),
    ("45 compression", lambda f: patched_tiff(f, Compression=34713), 4, "Compression", "34713"),
    (
        "45 strip outside",
        lambda f: patched_tiff(f, StripOffsets=BIG),
        3,
        "StripOffsets",
        "expected",
    ),
    (
        "45 colours",
        lambda f: patched_tiff(f, PhotometricInterpretation=5),
        4,
        "PhotometricInterpretation",
        "CMYK",
    ),
    ("46 DTD", ome_with_dtd, 3, "ImageDescription", "document type"),
    ("46 no size", ome_of('SizeX="24" SizeY="20"'), 3, "SizeZ", "''"),
    (
        "46 plane bomb",
        ome_of(
            'SizeX="24" SizeY="20" SizeZ="2000000000" SizeC="1" SizeT="1"',
            '<TiffData PlaneCount="2000000000"/>',
        ),
        3,
        "SizeZ, SizeC, SizeT",
        "2000000000",
    ),
    (
        "46 planes missing",
        ome_of('SizeX="24" SizeY="20" SizeZ="5" SizeC="1" SizeT="1"', "<TiffData/>"),
        3,
        "pages",
        "2 of 5 planes",
    ),
    (
        "46 other size",
        ome_of('SizeX="9" SizeY="20" SizeZ="3" SizeC="1" SizeT="1"', "<TiffData/>"),
        3,
        "SizeX, SizeY",
        "24 × 20",
    ),
    ("47 mixed", mixed_pngs, 3, "", "2.png: this slice is 5 × 6 L"),
    ("47 cut picture", lambda f: cut(png(f), 40), 3, "", "damaged"),
    ("47 no picture", holding("a.png", b"\x89PNG\r\n\x1a\n" + bytes(50)), 3, "", ""),
    ("48 pickle", pickled, 3, "header", "could run code"),
    ("48 structured", structured, 4, "dtype", "structured"),
    ("48 many arrays", two_keys, 2, "series", "one (3, 20, 24) uint16, two"),
    ("48 cut npy", lambda f: cut(npy(f), 100), 3, "data", "expected 2880 bytes, found 2780"),
    ("48 cut npz", lambda f: cut(npz(f), 30), 3, "archive", "zip"),
    ("9 cut map", lambda f: cut(mrc(f), 1), 3, "map", "expected 2880 bytes, found 2879"),
    ("9 header only", holding("a.mrc", bytes(208) + b"MAP " + bytes(99)), 3, "", "1024 bytes"),
    ("13 outside", lambda f: descriptor(f, "../outside.raw"), 3, "RawFile", "outside"),
    ("13 absolute", lambda f: descriptor(f, "/etc/passwd"), 3, "RawFile", ""),
    ("13 backslash", lambda f: descriptor(f, "..\\v.raw"), 3, "RawFile", "outside"),
    ("14 pipe", fifo, 3, "RawFile", "not a regular file"),
    ("15 missing", lambda f: descriptor(f, "gone.raw"), 3, "RawFile", ""),
    ("16 link", escaping_link, 3, "RawFile", "outside"),
    ("51 name", holding("a_9x9x9_uint8.raw", bytes(8)), 3, "file name", "needs 729"),
    ("5 text", holding("a.xyz", b"hello"), 4, "", "text"),
    ("5 HDF5", holding("a.raw2", b"\x89HDF\r\n\x1a\n"), 4, "", "HDF5"),
]


def maker_rle() -> str:
    return "1.2.840.10008.1.2.5"


@pytest.mark.parametrize(
    ("make", "code", "field", "words"), [c[1:] for c in CASES], ids=[c[0] for c in CASES]
)
def test_hostile(tmp_path: Path, make: Make, code: int, field: str, words: str) -> None:
    folder = tmp_path / "in"
    folder.mkdir()
    path = make(folder)
    with pytest.raises(VolvizError) as caught:
        load(path, SMALL)
    error = caught.value
    assert error.exit_code == code
    assert (error.field or "") == field
    assert words in str(error)
    assert error.file is not None
    assert Path(error.file).name in str(error)
    assert error.fix
    assert "\n" not in str(error)
    assert "CANARY" not in str(error)


# ------------------------------------------------------------------ memory, files outside


def run_capped(code: str, *args: str, megabytes: int) -> str:
    """Python code in a process that may take this much address space beyond its imports."""
    script = f"""
        import resource, sys
        import numpy, pydicom, tifffile, PIL.Image, mrcfile, imagecodecs
        from volviz.errors import VolvizError
        from volviz.io import load, Limits, ReadOptions
        import volviz.io.dicom, volviz.io.tiff, volviz.io.numpy_file, volviz.io.images
        with open("/proc/self/statm") as file:
            taken = int(file.read().split()[0]) * resource.getpagesize()
        limit = taken + ({megabytes} << 20)
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        options = ReadOptions(limits=Limits(max_bytes=64 << 20))
        {code}
    """
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(script), *args],
        capture_output=True,
        text=True,
        timeout=120,
        check=False,
        cwd=Path(__file__).parents[2],
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


EXPECT = """
        try:
            load(sys.argv[1], options)
        except VolvizError as error:
            print(error.exit_code, error)
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="address space limit of Linux")
@pytest.mark.parametrize("kind", ["header", "pixels"])
def test_deflate_bomb_in_dicom(tmp_path: Path, kind: str) -> None:
    path = dicom(tmp_path, syntax="1.2.840.10008.1.2.1")
    body = path.read_bytes()
    start = body.index(b"\x08\0\x16\0UI")
    meta, dataset = body[:start], body[start:]
    meta = meta.replace(b"1.2.840.10008.1.2.1\0", b"1.2.840.10008.1.2.1.99")
    meta = meta.replace(b"\x02\0\x10\0UI\x14\0", b"\x02\0\x10\0UI\x16\0")
    (length,) = struct.unpack("<L", meta[140:144])
    meta = meta[:140] + struct.pack("<L", length + 2) + meta[144:]
    engine = zlib.compressobj(9, zlib.DEFLATED, -15)
    at = dataset.index(b"\xe0\x7f\x10\0OW")
    filler = bytes(300 << 20)
    if kind == "header":
        element = b"\x09\0\x10\0UN\0\0" + struct.pack("<L", len(filler))
        packed = engine.compress(dataset[:200]) + engine.compress(element + filler)
    else:
        head = dataset[:at] + b"\xe0\x7f\x10\0OW\0\0" + struct.pack("<L", len(filler))
        packed = engine.compress(head + filler)
    path.write_bytes(meta + packed + engine.flush())
    assert path.stat().st_size < 1 << 20
    said = run_capped(EXPECT, str(path), megabytes=150)
    # Pixels beyond those that the header declares are never inflated: that file is fine.
    assert said.startswith("6 ") if kind == "header" else said == ""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="address space limit of Linux")
def test_zip_and_tiff_bombs(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    np.save(buffer, GREY)
    path = tmp_path / "a.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("a.npy", buffer.getvalue() + bytes(300 << 20))
    assert run_capped(EXPECT, str(path), megabytes=150).startswith("3 ")
    path = tiff(tmp_path, compression="zlib", rowsperstrip=20)
    content = bytearray(path.read_bytes())
    bomb = zlib.compress(bytes(300 << 20), 9)
    with tifffile.TiffFile(path) as tif:
        tags = tif.pages[0].tags
        offset, count = tags["StripOffsets"].valueoffset, tags["StripByteCounts"].valueoffset
    struct.pack_into("<I", content, offset, len(content))
    struct.pack_into("<I", content, count, len(bomb))
    path.write_bytes(bytes(content) + bomb)
    assert run_capped(EXPECT, str(path), megabytes=250).startswith("3 ")


@contextmanager
def opened_files() -> Iterator[list[str]]:
    """Every path that is opened meanwhile."""
    seen: list[str] = []
    active = [True]

    def hook(event: str, args: tuple) -> None:
        if active[0] and event == "open" and isinstance(args[0], (str, bytes)):
            seen.append(os.path.realpath(os.fsdecode(args[0])))

    sys.addaudithook(hook)
    try:
        yield seen
    finally:
        active[0] = False


@pytest.mark.parametrize(
    "name", ["../secret.raw", "a/../../secret.raw", "link.raw", "%2e%2e/secret.raw"]
)
def test_nothing_outside_the_folder_is_opened(tmp_path: Path, name: str) -> None:
    (tmp_path / "secret.raw").write_bytes(GREY.tobytes())
    folder = tmp_path / "in"
    folder.mkdir()
    (folder / "link.raw").symlink_to(tmp_path / "secret.raw")
    dat = descriptor(folder, name)
    text = (
        '<?xml version="1.0"?><OME UUID="u"><Image><Pixels DimensionOrder="XYZCT" SizeX="24" '
        f'SizeY="20" SizeZ="6" SizeC="1" SizeT="1"><TiffData IFD="0" PlaneCount="3"/>'
        f'<TiffData FirstZ="3" IFD="0" PlaneCount="3"><UUID FileName="{name}">v</UUID></TiffData>'
        "</Pixels></Image></OME>"
    )
    ome = tiff(folder, "a.ome.tif", description=text)
    json = folder / "a.json"
    json.write_text(f'{{"file": "{name}", "dims": [24, 20, 3], "dtype": "uint16"}}')
    secret = str(tmp_path / "secret.raw")
    for path in (dat, ome, json):
        with opened_files() as seen, pytest.raises(VolvizError) as caught:
            load(path, SMALL)
        assert caught.value.exit_code == 3
        assert secret not in seen


def test_dicom_names_no_other_file(tmp_path: Path) -> None:
    """Whatever a header says, only files that lie in the folder are opened."""
    folder = tmp_path / "in"
    maker.series(folder, 4, change=lambda ds, k: setattr(ds, "SeriesDescription", "../../secret"))
    with opened_files() as seen:
        info = load(folder, SMALL).info
    ours = [p for p in seen if p.startswith(str(tmp_path.resolve()))]
    assert {Path(p).parent for p in ours} == {folder.resolve()}
    assert "secret" in info.name


def test_file_names_that_are_no_text(tmp_path: Path) -> None:
    for name in (b"caf\xe9.npy", "emoji \N{GRINNING FACE}.npy".encode(), b"a\nb#%.npy"):
        path = Path(os.fsdecode(os.path.join(os.fsencode(tmp_path), name)))
        path.write_bytes(npy(tmp_path, "plain.npy").read_bytes())
        np.testing.assert_array_equal(load(path).data, GREY)
        path.write_bytes(path.read_bytes()[:-5])
        with pytest.raises(VolvizError) as caught:
            load(path)
        assert "\n" not in str(caught.value)
        str(caught.value).encode("utf-8")
