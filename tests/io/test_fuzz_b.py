"""DICOM, TIFF, MRC, NumPy, pictures and RAW, cut and flipped: a clear error or a right volume."""

from __future__ import annotations

import os
import random
from pathlib import Path

import pytest

import tests.io.dicom_maker as maker
from tests.io.hostile_b_maker import Make, descriptor, dicom, mrc, npy, npz, png, tiff
from volviz.errors import InputError, LimitError, UnsupportedError, UsageError
from volviz.io import load, probe
from volviz.io.options import Limits, ReadOptions

SMALL = ReadOptions(limits=Limits(max_bytes=1 << 30))


WHOLE: list[tuple[str, Make]] = [
    ("dicom", dicom),
    ("dicom deflated", lambda f: dicom(f, syntax="1.2.840.10008.1.2.1.99")),
    ("dicom enhanced", lambda f: maker.save(maker.enhanced(3)[0], f / "e.dcm")),
    ("tiff", tiff),
    ("tiff lzw", lambda f: tiff(f, compression="lzw")),
    ("tiff zlib tiles", lambda f: tiff(f, compression="zlib", tile=(16, 16))),
    ("tiff imagej", lambda f: tiff(f, imagej=True, metadata={"axes": "ZYX"})),
    ("tiff ome", lambda f: tiff(f, "a.ome.tif", ome=True, metadata={"axes": "ZYX"})),
    ("mrc", mrc),
    ("npy", npy),
    ("npz", npz),
    ("png", png),
    ("descriptor", descriptor),
]


def outcome(path: Path) -> bytes | None:
    """The voxels, or None for a clear error; anything else fails the test."""
    try:
        probe(path, SMALL)
        return load(path, SMALL).data.tobytes()
    except (InputError, UnsupportedError, UsageError, LimitError):
        return None


@pytest.mark.parametrize("make", [w[1] for w in WHOLE], ids=[w[0] for w in WHOLE])
def test_truncation_sweep(tmp_path: Path, make: Make) -> None:
    path = make(tmp_path)
    whole = path.read_bytes()
    right = load(path, SMALL).data.tobytes()
    for k in range(64):
        size = len(whole) * k // 64
        path.write_bytes(whole[:size])
        found = outcome(path)
        assert found is None or found == right


@pytest.mark.parametrize("make", [w[1] for w in WHOLE], ids=[w[0] for w in WHOLE])
def test_flipped_bytes(tmp_path: Path, make: Make) -> None:
    path = make(tmp_path)
    whole = path.read_bytes()
    choose = random.Random(7)
    rounds = int(os.environ.get("VOLVIZ_FUZZ", "60"))
    for _ in range(rounds):
        content = bytearray(whole)
        for _ in range(choose.choice((1, 1, 2, 8))):
            content[choose.randrange(min(len(content), 2000))] = choose.randrange(256)
        path.write_bytes(content)
        outcome(path)


def test_random_bytes_behind_every_mark(tmp_path: Path) -> None:
    choose = random.Random(3)
    marks = [
        bytes(128) + b"DICM",
        b"II*\0\x08\0\0\0",
        b"MM\0+\0\x08\0\0",
        bytes(208) + b"MAP ",
        b"\x93NUMPY\x01\0",
        b"PK\x03\x04",
        b"\x89PNG\r\n\x1a\n",
        b"\xff\xd8\xff\xe0",
        b"\x08\0\x05\0CS\x0a\0ISO_IR 100",
        b"RawFile: a\n",
    ]
    for mark in marks:
        for k in range(6):
            path = tmp_path / f"a{k}"
            path.write_bytes(mark + choose.randbytes(2000))
            outcome(path)
