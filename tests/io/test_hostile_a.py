"""Broken and hostile NRRD, MetaImage and NIfTI files: a clear error or a right volume, always."""

from __future__ import annotations

import bz2
import gzip
import os
import struct
import subprocess
import sys
import textwrap
import threading
import time
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from tests.io.hostile_maker import RAW, meta, nifti, nrrd
from volviz.errors import Cancelled, VolvizError
from volviz.io import load, probe
from volviz.io.options import Limits, ReadOptions
from volviz.progress import Progress

SMALL = ReadOptions(limits=Limits(max_bytes=1 << 30))
Case = tuple[str, str, bytes, int, str, str]
"""Case number of the notes with a word, file name, content, exit code, field, words of the text."""
DIM0 = [0, 6, 5, 4, 1, 1, 1, 1]
DIM9 = [9, 6, 5, 4, 1, 1, 1, 1]
CASES: list[Case] = [
    ("4 empty", "a.nrrd", b"", 3, "", "empty (0 bytes)"),
    ("5 no known content", "a.qqq", bytes(range(1, 200)), 4, "", "no known format"),
    ("5 no NRRD", "a.nrrd", b"hello world\n\n", 3, "magic", "does not begin with NRRD"),
    ("5 later version", "a.nrrd", nrrd().replace(b"0004", b"0009"), 4, "magic", "version 9"),
    ("6 huge NRRD", "a.nrrd", nrrd(sizes="100000 100000 100000"), 6, "sizes", "needs 1.8 PiB"),
    ("6 huge MHA", "a.mha", meta(DimSize="100000 100000 100000"), 6, "DimSize", "needs 1.8 PiB"),
    ("6 huge axis", "a.nrrd", nrrd(sizes="99999999999999999999 1 1"), 3, "sizes", "whole numbers"),
    ("6 beyond 2^63", "a.nrrd", nrrd(sizes="2147483647 2147483647 4"), 6, "sizes", "EiB"),
    ("6 many channels", "a.mha", meta(ElementNumberOfChannels="65000"), 3, "data", "expected"),
    ("7 negative", "a.nrrd", nrrd(sizes="6 5 -4"), 3, "sizes", "line 4: '-4'"),
    ("7 zero", "a.nrrd", nrrd(sizes="6 0 4"), 3, "sizes", "'0'"),
    ("7 not whole", "a.nrrd", nrrd(sizes="6 5.5 4"), 3, "sizes", "'5.5'"),
    ("7 words", "a.nrrd", nrrd(sizes="six 5 4"), 3, "sizes", "'six'"),
    ("7 negative MHA", "a.mha", meta(DimSize="6 5 -4"), 3, "DimSize", "line 3: '-4'"),
    ("8 mismatch", "a.nrrd", nrrd(dimension="4"), 3, "sizes", "3 sizes for dimension 4"),
    ("8 no dimension", "a.nrrd", nrrd(dimension="x"), 3, "dimension", "'x'"),
    ("8 six axes", "a.nrrd", nrrd(dimension="6", sizes="6 5 4 1 1 1"), 4, "dimension", "6 axes"),
    ("9 short raw", "a.nrrd", nrrd(RAW[:151]), 3, "data", "expected 240 bytes, found 151 (62.9 %)"),
    ("9 short MHA", "a.mha", meta(RAW[:-1]), 3, "data", "expected 240 bytes, found 239"),
    ("9 short NIfTI", "a.nii", nifti(RAW[:-1]), 3, "data", "expected 240 bytes, found 239"),
    ("9 short ascii", "a.nrrd", nrrd(b"1 2 3", encoding="ascii"), 3, "data", "found 6 (2.5 %)"),
    ("9 odd hex", "a.nrrd", nrrd(b"0g", encoding="hex"), 3, "data", "hexadecimal"),
    (
        "11 cut gzip",
        "a.nrrd",
        nrrd(gzip.compress(RAW)[:-9], encoding="gzip"),
        3,
        "data",
        "stream ends at byte",
    ),
    (
        "11 CRC",
        "a.nrrd",
        nrrd(gzip.compress(RAW)[:-8] + bytes(8), encoding="gzip"),
        3,
        "data",
        "damaged",
    ),
    (
        "11 cut bzip2",
        "a.nrrd",
        nrrd(bz2.compress(RAW)[:-3], encoding="bz2"),
        3,
        "data",
        "stream ends at byte",
    ),
    ("11 cut nii.gz", "a.nii.gz", gzip.compress(nifti())[:-4], 3, "data", "ends at byte"),
    ("11 no gzip", "a.nrrd", nrrd(encoding="gzip"), 3, "data", "gzip stream is damaged"),
    (
        "12 too much",
        "a.nrrd",
        nrrd(gzip.compress(RAW + b"x"), encoding="gzip"),
        3,
        "data",
        "more data than the header declares",
    ),
    (
        "12 too much nii.gz",
        "a.nii.gz",
        gzip.compress(nifti(RAW + b"x")),
        3,
        "data",
        "more data than the header declares",
    ),
    ("13 outside", "a.nhdr", nrrd(data_file="../../etc/passwd"), 3, "data file", "outside"),
    ("13 absolute", "a.nhdr", nrrd(data_file="/etc/passwd"), 3, "data file", "--allow-outside"),
    ("13 MHD", "a.mhd", meta(ElementDataFile="../x.raw"), 3, "ElementDataFile", "--allow-outside"),
    ("14 device", "a.mhd", meta(ElementDataFile="/dev/zero"), 3, "ElementDataFile", "outside"),
    ("15 missing", "a.nhdr", nrrd(data_file="gone.raw"), 3, "data file", "gone.raw — put it there"),
    ("15 missing MHD", "a.mhd", meta(ElementDataFile="gone.raw"), 3, "ElementDataFile", "missing"),
    ("15 no .img", "a.hdr", nifti(magic=b"ni1", vox_offset=0), 3, "voxels", "a.img — put both"),
    ("15 no .hdr", "a.img", RAW, 3, "header", "a.hdr — put both"),
    ("17 type", "a.nrrd", nrrd(type="shrot"), 3, "type", "did you mean 'short'"),
    ("17 block", "a.nrrd", nrrd(type="block", block_size="4"), 4, "type", "block"),
    ("17 encoding", "a.nrrd", nrrd(encoding="gzipped"), 3, "encoding", "did you mean 'gzip'"),
    ("17 zrl", "a.nrrd", nrrd(encoding="zrl"), 4, "encoding", "zrl"),
    ("17 MHA type", "a.mha", meta(ElementType="MET_SHRT"), 3, "ElementType", "'MET_SHORT'"),
    ("18 no endian", "a.nrrd", nrrd(endian=None), 3, "endian", "write 'endian: little'"),
    ("18 endian", "a.nrrd", nrrd(endian="middle"), 3, "endian", "'middle'"),
    (
        "20 twice",
        "a.nrrd",
        nrrd().replace(b"encoding", b"Sizes: 6 5 4\nencoding"),
        3,
        "sizes",
        "lines 4 and 6 both give 'sizes'",
    ),
    ("20 no colon", "a.nrrd", nrrd().replace(b"sizes:", b"sizes"), 3, "header", "line 4"),
    ("20 missing", "a.nrrd", nrrd(sizes=None), 3, "sizes", "no field 'sizes'"),
    ("20 no encoding", "a.nrrd", nrrd(encoding=None), 3, "encoding", "no field"),
    ("20 skip", "a.nrrd", nrrd(byte_skip="1e18"), 3, "byte skip", "cannot read '1e18'"),
    ("20 far skip", "a.nrrd", nrrd(byte_skip="9" * 30), 3, "byte skip", "cannot be skipped"),
    ("20 lines", "a.nrrd", nrrd(line_skip="300"), 3, "line skip", "300 lines"),
    ("20 directions", "a.nrrd", nrrd(space_directions="(1,0,0)"), 3, "space directions", "3 axes"),
    (
        "20 ragged",
        "a.nrrd",
        nrrd(space_directions="(1,0) (0,1,0) (0,0,1)"),
        3,
        "space directions",
        "cannot read",
    ),
    ("20 kinds", "a.nrrd", nrrd(kinds="domain"), 3, "kinds", "one per axis"),
    ("20 pattern", "a.nhdr", nrrd(data_file="a%03d.raw 1 9 1"), 3, "data file", "9 files"),
    ("20 endless", "a.nhdr", nrrd(data_file="a%03d.raw 1 4 0"), 3, "data file", "never arrives"),
    ("24 NDims", "a.mha", meta(NDims="11"), 3, "NDims", "11"),
    ("24 no type", "a.mha", meta(ElementType=None), 3, "ElementType", "no 'ElementType'"),
    (
        "25 short zlib",
        "a.mha",
        meta(zlib.compress(RAW[:64]), CompressedData="True"),
        3,
        "data",
        "zlib stream ends at byte 64 of 240",
    ),
    ("26 dim 0", "a.nii", nifti(dim=DIM0), 3, "dim", "dim[0] is 0"),
    ("26 dim 9", "a.nii", nifti(dim=DIM9), 3, "dim", "dim[0] is 9"),
    ("26 axis", "a.nii", nifti(dim=[3, 6, -5, 4, 1, 1, 1, 1]), 3, "dim", "dim[2] is -5"),
    (
        "26 sizeof_hdr",
        "a.nii",
        struct.pack("<i", 999) + nifti()[4:],
        3,
        "sizeof_hdr",
        "999, not 348",
    ),
    ("26 magic", "a.nii", nifti(magic=b"xyz"), 3, "magic", "is missing"),
    ("26 cut header", "a.nii", nifti()[:200], 3, "sizeof_hdr", "200 bytes are too few"),
    ("26 cut gz header", "a.nii.gz", gzip.compress(nifti())[:60], 3, "header", "ends at byte"),
    ("26 huge", "a.nii", nifti(dim=[3, 30000, 30000, 30000, 1, 1, 1, 1]), 6, "dim", "TiB"),
    ("26 huge 2", "a.nii", nifti(two=True, dim=[3, 2**40, 1, 1, 1, 1, 1, 1]), 3, "dim", "axis 1"),
    ("27 NaN", "a.nii", nifti(vox_offset=np.nan), 3, "vox_offset", "byte nan"),
    ("27 infinite", "a.nii", nifti(vox_offset=np.inf), 3, "vox_offset", "byte inf"),
    ("27 far", "a.nii", nifti(vox_offset=1e18), 3, "vox_offset", "beyond the file"),
    ("27 far gz", "a.nii.gz", gzip.compress(nifti(vox_offset=1e18)), 3, "vox_offset", "beyond"),
    ("27 inside", "a.nii", nifti(vox_offset=100), 3, "vox_offset", "the header ends at 352"),
    ("27 negative", "a.nii", nifti(vox_offset=-8), 3, "vox_offset", "byte -8"),
    ("28 float128", "a.nii", nifti(datatype=1536), 4, "datatype", "128-bit float"),
    ("28 no type", "a.nii", nifti(datatype=77), 3, "datatype", "77"),
]


@pytest.mark.parametrize("case", CASES, ids=[c[0] + " " + c[1] for c in CASES])
def test_bad_input_is_told(tmp_path: Path, case: Case) -> None:
    _, name, content, code, field, words = case
    path = tmp_path / name
    path.write_bytes(content)
    start = time.monotonic()
    with pytest.raises(VolvizError) as caught:
        load(path, SMALL)
    error = caught.value
    text = str(error)
    assert error.exit_code == code, text
    assert name in text
    assert "\n" not in text
    assert words in text
    if field:
        assert error.field == field, text
    if "empty" not in words:
        assert error.fix
        assert f" — {error.fix}" in text
    assert time.monotonic() - start < 5


def test_a_missing_file_suggests_the_nearest_name(tmp_path: Path) -> None:
    (tmp_path / "head.nrrd").write_bytes(nrrd())
    with pytest.raises(VolvizError, match=r"haed\.nrrd: no such file.*did you mean 'head\.nrrd'"):
        load(tmp_path / "haed.nrrd")


@pytest.mark.skipif(os.name != "posix" or os.geteuid() == 0, reason="root may read everything")
def test_a_file_that_may_not_be_read(tmp_path: Path) -> None:
    path = tmp_path / "a.nrrd"
    path.write_bytes(nrrd())
    path.chmod(0)
    with pytest.raises(VolvizError, match="permission denied"):
        load(path)


def test_pipes_are_refused_at_once(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    os.mkfifo(tmp_path / "p.img")
    (tmp_path / "a.nhdr").write_bytes(nrrd(data_file="pipe"))
    (tmp_path / "a.mhd").write_bytes(meta(ElementDataFile="pipe"))
    (tmp_path / "b.mhd").write_bytes(meta(b"", ElementDataFile="LIST\npipe\npipe\npipe\npipe"))
    (tmp_path / "p.hdr").write_bytes(nifti(magic=b"ni1", vox_offset=0)[:348])
    start = time.monotonic()
    for name in ("pipe", "a.nhdr", "a.mhd", "b.mhd", "p.hdr"):
        with pytest.raises(VolvizError, match="not a regular file"):
            load(tmp_path / name)
    assert time.monotonic() - start < 1


_OPENED: list[str] | None = None


def _hook(event: str, args: tuple[object, ...]) -> None:
    if _OPENED is not None and event == "open" and isinstance(args[0], (str, bytes, os.PathLike)):
        _OPENED.append(os.fsdecode(args[0]))


sys.addaudithook(_hook)


@contextmanager
def watched() -> Iterator[list[str]]:
    """The names of all files opened meanwhile."""
    global _OPENED  # noqa: PLW0603
    _OPENED = []
    try:
        yield _OPENED
    finally:
        _OPENED = None


def spellings(outside: Path) -> list[str]:
    return [
        "../outside/secret.raw",
        "..\\outside\\secret.raw",
        str(outside / "secret.raw"),
        "C:\\outside\\secret.raw",
        "\\\\server\\share\\secret.raw",
        "//server/share/secret.raw",
        (outside / "secret.raw").as_uri(),
        "%2e%2e/outside/secret.raw",
        "link.raw",
        "linked/secret.raw",
        "sub/../../outside/secret.raw",
        "x" * 5000,
        "nul\0.raw",
        "/dev/zero",
        "..",
        "http://localhost/secret.raw",
    ]


@pytest.mark.parametrize("number", range(16))
@pytest.mark.parametrize("kind", ["nrrd", "nrrd list", "mhd", "mhd list"])
def test_nothing_outside_the_folder_is_opened(tmp_path: Path, kind: str, number: int) -> None:
    outside, inside = tmp_path / "outside", tmp_path / "inside"
    outside.mkdir()
    (inside / "sub").mkdir(parents=True)
    (outside / "secret.raw").write_bytes(RAW)
    (inside / "link.raw").symlink_to(outside / "secret.raw")
    (inside / "linked").symlink_to(outside)
    name = spellings(outside)[number]
    if kind.startswith("nrrd"):
        path = inside / "a.nhdr"
        single = nrrd(b"", data_file=name)
        listed = nrrd(b"", dimension="4", sizes="6 5 4 1", data_file=f"LIST\n{name}")
        path.write_bytes(single if kind == "nrrd" else listed)
    else:
        path = inside / "a.mhd"
        listed = meta(b"", ElementDataFile=f"LIST 3\n{name}")
        path.write_bytes(meta(b"", ElementDataFile=name) if kind == "mhd" else listed)
    for open_it in (load, probe):
        with watched() as opened, pytest.raises(VolvizError) as caught:
            open_it(path)
        assert caught.value.exit_code == 3
        assert path.name in str(caught.value)
        real = [Path(n) for n in opened if not n.endswith((".py", ".pyc", ".so"))]
        assert all(p.resolve() == path.resolve() for p in real), opened
        assert real


def test_the_hook_sees_a_file_that_is_opened(tmp_path: Path) -> None:
    """So that the test above can fail: allowed detached data are seen."""
    (tmp_path / "in").mkdir()
    (tmp_path / "out.raw").write_bytes(RAW)
    (tmp_path / "in" / "a.nhdr").write_bytes(nrrd(b"", data_file="../out.raw"))
    with watched() as opened:
        load(tmp_path / "in" / "a.nhdr", allow_outside=tmp_path)
    assert any(name.endswith("out.raw") for name in opened)


def test_a_pair_does_not_leave_its_folder(tmp_path: Path) -> None:
    (tmp_path / "in").mkdir()
    (tmp_path / "out.img").write_bytes(RAW)
    (tmp_path / "in" / "a.hdr").write_bytes(nifti(magic=b"ni1", vox_offset=0)[:348])
    (tmp_path / "in" / "a.img").symlink_to(tmp_path / "out.img")
    with pytest.raises(VolvizError, match="outside"):
        load(tmp_path / "in" / "a.hdr")


def test_a_bomb_is_stopped_at_the_declared_size(tmp_path: Path) -> None:
    """512 MiB of zeros behind 240 declared bytes: little memory, no waiting."""
    bomb = zlib.compressobj(9, zlib.DEFLATED, 31)
    block = bytes(1 << 20)
    packed = b"".join(bomb.compress(block) for _ in range(512)) + bomb.flush()
    (tmp_path / "a.nrrd").write_bytes(nrrd(packed, encoding="gzip"))
    (tmp_path / "a.mha").write_bytes(meta(zlib.compress(bytes(64 << 20)), CompressedData="True"))
    code = f"""
    import resource
    from volviz.io import load
    from volviz.errors import InputError
    import nrrd
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    for name in ("a.nrrd", "a.mha"):
        try:
            load({str(tmp_path)!r} + "/" + name)
        except InputError as error:
            assert "more data" in str(error)
    print((resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) * 1024)
    """
    root = str(Path(__file__).resolve().parents[2])
    environment = {**os.environ, "PYTHONPATH": root}
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        check=True,
        env=environment,
    )
    assert int(done.stdout) < 16 << 20


@pytest.mark.parametrize("kind", ["mha", "nrrd"])
def test_no_voxel_comes_from_old_memory(tmp_path: Path, kind: str) -> None:
    """The known failure of other readers: 64 packed bytes for a large image, the rest garbage."""
    path = tmp_path / f"a.{kind}"
    short = {
        "mha": meta(zlib.compress(bytes(64)), CompressedData="True", DimSize="64 64 64"),
        "nrrd": nrrd(gzip.compress(bytes(64)), encoding="gzip", sizes="64 64 64"),
    }
    path.write_bytes(short[kind])
    for _ in range(10):
        canary = np.full(64**3, 0xA5A5, "u2")
        del canary
        with pytest.raises(VolvizError, match="ends at byte 64 of 524288"):
            load(path)


def test_cancel_during_a_large_inflate(tmp_path: Path) -> None:
    block = np.random.default_rng(1).integers(0, 30, 8 << 20).astype("u1").tobytes()
    path = tmp_path / "a.nrrd"
    sizes = "2048 4096 64"
    path.write_bytes(nrrd(gzip.compress(block, 1) * 64, type="uchar", sizes=sizes, encoding="gzip"))
    progress = Progress()
    stopped: list[float] = []

    def stop() -> None:
        stopped.append(time.monotonic())
        progress.cancel()

    threading.Timer(0.1, stop).start()
    with pytest.raises(Cancelled):
        load(path, ReadOptions(progress=progress, limits=Limits(max_bytes=1 << 30)))
    assert time.monotonic() - stopped[0] < 0.3


def test_headers_are_bounded(tmp_path: Path) -> None:
    limits = ReadOptions(limits=Limits(max_header=1 << 16))
    for name, start in (("a.nrrd", nrrd()[:-242]), ("a.mha", meta(b"").split(b"Element")[0])):
        for line in (
            b"# " + b"x" * (1 << 17) + b"\n",
            b"Comment: = x\n" * 9000,
            b"k:=v\n" * 130_000,
        ):
            (tmp_path / name).write_bytes(start + line)
            with pytest.raises(VolvizError) as caught:
                load(tmp_path / name, limits)
            assert caught.value.exit_code == 3
