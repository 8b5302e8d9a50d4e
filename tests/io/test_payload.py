from __future__ import annotations

import bz2
import gzip
import os
import resource
import subprocess
import sys
import textwrap
import threading
import time
import zlib
from pathlib import Path

import numpy as np
import pytest

from volviz.errors import Cancelled, InputError, LimitError, VolvizError
from volviz.io.options import Limits, ReadOptions
from volviz.io.payload import (
    Part,
    binary_size,
    check_size,
    open_regular,
    part_range,
    read_parts,
    read_stream,
)
from volviz.progress import Progress

OPTIONS = ReadOptions()
PACK = {
    "raw": bytes,
    "gzip": gzip.compress,
    "zlib": zlib.compress,
    "bzip2": bz2.compress,
    "hex": lambda b: b.hex().encode(),
}


def load(path: Path, array: np.ndarray, encoding: str, **part: int):
    whole = Part(path, nbytes=array.nbytes, **part)
    return read_parts(
        [whole], array.dtype, array.shape, encoding=encoding, options=OPTIONS, file=path
    )


def test_check_size_counts_in_python_integers() -> None:
    assert check_size((3, np.int64(5), 7), "u2", OPTIONS, file="f", field="sizes") == 210
    big = Limits(max_bytes=2**200)
    assert check_size([2**31 - 1] * 4, "f8", big, file="f", field="s") == 8 * (2**31 - 1) ** 4


@pytest.mark.parametrize("bad", [0, -3, 2**31, 1.5, True, float("nan"), None, "7"])
def test_check_size_names_the_field_of_a_bad_axis(bad: object) -> None:
    with pytest.raises(InputError, match=r"x\.nrrd: sizes: axis 2 has .* whole numbers"):
        check_size((4, bad, 4), "u1", OPTIONS, file="x.nrrd", field="sizes")


def test_check_size_says_need_and_limit() -> None:
    limits = Limits(max_bytes=12 << 30)
    with pytest.raises(LimitError, match=r"needs 3\.6 PiB; the limit is 12 GiB — .*--max-memory"):
        check_size((100_000,) * 3, "f4", limits, file="x", field="sizes")


def test_binary_size() -> None:
    assert [binary_size(n) for n in (0, 512, 1536, 64 << 20, 4 * 10**15)] == [
        "0 B",
        "512 B",
        "1.5 KiB",
        "64 MiB",
        "3.6 PiB",
    ]
    assert binary_size(2**2000)


@pytest.mark.parametrize("encoding", PACK)
@pytest.mark.parametrize("dtype", ["u1", "<i2", ">i2", ">f8", "<c8", ">u4"])
def test_every_encoding_and_byte_order(tmp_path: Path, encoding: str, dtype: str) -> None:
    array = np.random.default_rng(1).integers(0, 200, (5, 6, 7)).astype(dtype)
    path = tmp_path / "data"
    path.write_bytes(b"12345" + PACK[encoding](array.tobytes()))
    read, notes = load(path, array, encoding, offset=5)
    np.testing.assert_array_equal(read, array)
    assert read.dtype.isnative
    assert read.flags.c_contiguous
    assert notes == ()


@pytest.mark.parametrize("dtype", ["i1", "u8", "f4", "f8"])
def test_ascii_numbers_in_small_and_large_files(tmp_path: Path, dtype: str) -> None:
    array = np.arange(90_000).reshape(30, 30, 100) % 120
    array = array.astype(dtype) / (7 if dtype[0] == "f" else 1)
    array = array.astype(dtype)
    path = tmp_path / "data"
    path.write_text(",\n ".join(repr(v.item()) for v in array.ravel()) + "\n")
    read, notes = load(path, array, "ascii")
    np.testing.assert_array_equal(read, array)
    assert notes == ()


@pytest.mark.parametrize(
    "text",
    ["1 2 x 4", "1 2 3.5 4", "1 2 300 4", "1 2 -1 4", "1 2 " + "9" * 6000 + " 4", "1_0 2 3 é"],
)
def test_ascii_rejects_what_is_no_value(tmp_path: Path, text: str) -> None:
    path = tmp_path / "data"
    path.write_text(text)
    with pytest.raises(InputError, match=r"is no uint8 value|expected 4 bytes"):
        load(path, np.zeros((1, 2, 2), "u1"), "ascii")


def test_text_after_the_last_value_is_told(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_text("1 2 3 4 5")
    assert load(path, np.zeros((1, 2, 2), "u1"), "ascii")[1] == (
        "text after the last value was ignored",
    )


def test_hex_rejects_other_letters(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_text("00 ff zz 01")
    with pytest.raises(InputError, match="no hexadecimal digits"):
        load(path, np.zeros((1, 2, 2), "u1"), "hex")


def test_parts_follow_each_other_and_are_cut(tmp_path: Path) -> None:
    array = np.arange(4 * 6, dtype="<u2").reshape(4, 6)
    parts = []
    for k, row in enumerate(array):
        path = tmp_path / f"{k}.gz"
        path.write_bytes(gzip.compress(b"ab" + row.tobytes()))
        parts.append(Part(path, nbytes=12, skip=2))
    read, _ = read_parts(parts, "<u2", (4, 6), encoding="gzip", options=OPTIONS, file="f")
    np.testing.assert_array_equal(read, array)
    for start in range(24):
        for count in range(1, 24 - start):
            some = part_range(parts, 2 * start, 2 * count)
            read, _ = read_parts(some, "<u2", (count,), encoding="gzip", options=OPTIONS, file="f")
            np.testing.assert_array_equal(read, array.ravel()[start : start + count])


def test_extra_raw_bytes_are_told(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(bytes(27) + b"abc")
    assert "3 extra bytes" in load(path, np.zeros((3, 3, 3), "u1"), "raw")[1][0]
    whole = [Part(path, nbytes=27)]
    quiet = read_parts(
        whole, "u1", (3, 3, 3), encoding="raw", options=OPTIONS, file=path, trailing=False
    )
    assert quiet[1] == ()


@pytest.mark.parametrize("encoding", ["gzip", "zlib", "bzip2"])
def test_what_follows_a_stream(tmp_path: Path, encoding: str) -> None:
    array = np.arange(1000, dtype="u1").reshape(10, 10, 10)
    path = tmp_path / "data"
    path.write_bytes(PACK[encoding](array.tobytes()) + b"\0" * 700)
    assert load(path, array, encoding)[1] == ()
    path.write_bytes(PACK[encoding](array.tobytes()) + b"signature")
    assert load(path, array, encoding)[1] == (f"bytes after the {encoding} stream were ignored",)


def test_the_end_of_a_far_longer_stream_is_not_waited_for(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(gzip.compress(b"abcd" + bytes(100), 1))
    part = Part(path, nbytes=4, rest=1 << 40)
    read, notes = read_parts([part], "u1", (4,), encoding="gzip", options=OPTIONS, file=path)
    assert read.tobytes() == b"abcd"
    assert "check sum" in notes[0]


def test_the_last_bytes_of_a_stream(tmp_path: Path) -> None:
    array = np.arange(3000, dtype="<u2")
    path = tmp_path / "data"
    path.write_bytes(gzip.compress(b"some header" + array.tobytes()))
    np.testing.assert_array_equal(load(path, array, "gzip", skip=-1)[0], array)
    path.write_bytes(gzip.compress(bytes(20 << 20) + array.tobytes()))
    with pytest.raises(InputError, match="more data"):
        load(path, array, "gzip", skip=-1)
    path.write_bytes(gzip.compress(array.tobytes()[:-1]))
    with pytest.raises(InputError, match="ends at byte 5999 of 6000"):
        load(path, array, "gzip", skip=-1)


def test_short_raw_data_say_how_much_is_there(tmp_path: Path) -> None:
    path = tmp_path / "data.raw"
    path.write_bytes(bytes(63))
    with pytest.raises(InputError, match=r"data\.raw: data: expected 100 bytes, found 63 \(63 %\)"):
        load(path, np.zeros((10, 10), "u1"), "raw")


def test_parts_that_do_not_give_the_shape_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(bytes(8))
    with pytest.raises(InputError, match="expected 9 bytes, found 8"):
        read_parts([Part(path, nbytes=8)], "u1", (9,), encoding="raw", options=OPTIONS, file=path)


def test_read_stream_is_exact(tmp_path: Path) -> None:
    path = tmp_path / "data"
    path.write_bytes(bytes(range(12)))
    for count, error in ((12, None), (13, "expected 13 bytes, found 12"), (11, "more data")):
        with path.open("rb") as file:
            if error is None:
                read = read_stream(file, ">u2", (2, 3), options=OPTIONS, file=path)
                np.testing.assert_array_equal(
                    read, np.arange(12, dtype="u1").view(">u2").reshape(2, 3)
                )
                continue
            with pytest.raises(InputError, match=error):
                read_stream(file, "u1", (count,), options=OPTIONS, file=path)


def test_a_bomb_of_the_declared_size_takes_no_more_memory_than_that(tmp_path: Path) -> None:
    size = 200 << 20
    path = tmp_path / "bomb.gz"
    with gzip.open(path, "wb", 9) as file:
        for _ in range(size >> 20):
            file.write(bytes(1 << 20))
    code = f"""
    import resource
    from pathlib import Path
    from volviz.io.payload import Part, read_parts
    from volviz.io.options import ReadOptions
    from volviz.errors import InputError
    path = Path({str(path)!r})
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    read_parts([Part(path, nbytes={size})], "u1", ({size},), encoding="gzip",
               options=ReadOptions(), file=path)
    full = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    try:
        read_parts([Part(path, nbytes=1000)], "u1", (1000,), encoding="gzip",
                   options=ReadOptions(), file=path)
    except InputError as error:
        assert "more data" in str(error)
    print((full - before) * 1024)
    """
    root = str(Path(__file__).resolve().parents[2])
    done = subprocess.run(
        [sys.executable, "-c", textwrap.dedent(code)],
        capture_output=True,
        text=True,
        check=True,
        env={**os.environ, "PYTHONPATH": root},
    )
    assert int(done.stdout) < size + (24 << 20)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss > 0


@pytest.mark.parametrize("encoding", ["raw", "gzip"])
def test_cancel_takes_effect_at_once(tmp_path: Path, encoding: str) -> None:
    size = 400 << 20
    path = tmp_path / "big"
    if encoding == "raw":
        with path.open("wb") as file:
            file.truncate(size)
    else:
        block = np.random.default_rng(3).integers(0, 40, 4 << 20).astype("u1").tobytes()
        path.write_bytes(gzip.compress(block, 1) * (size // len(block)))
    progress = Progress()
    stopped = []
    timer = threading.Timer(0.02, lambda: (stopped.append(time.monotonic()), progress.cancel()))
    timer.start()

    def read() -> None:
        options = ReadOptions(progress=progress)
        whole = [Part(path, nbytes=size)]
        while True:
            read_parts(whole, "u1", (size,), encoding=encoding, options=options, file=path)

    with pytest.raises(Cancelled):
        read()
    assert time.monotonic() - stopped[0] < 0.25


@pytest.mark.parametrize("encoding", ["raw", "gzip", "zlib"])
def test_progress_is_told_at_least_every_4_mib(tmp_path: Path, encoding: str) -> None:
    size = 33 << 20
    path = tmp_path / encoding
    path.write_bytes(PACK[encoding](bytes(size)))
    seen: list[float] = []
    options = ReadOptions(
        progress=Progress(lambda f, text: seen.append(f) if f is not None else None)
    )
    read_parts(
        [Part(path, nbytes=size)], "u1", (size,), encoding=encoding, options=options, file=path
    )
    assert seen == sorted(seen)
    assert max(np.diff(seen)) * size <= 4 << 20
    assert seen[0] == 0
    assert seen[-1] == 1


@pytest.mark.slow
def test_more_than_2_gib(tmp_path: Path) -> None:
    size = (2 << 30) + 12346
    path = tmp_path / "big"
    with path.open("wb") as file:
        file.truncate(size)
        file.seek(size - 3)
        file.write(b"end")
    options = ReadOptions(limits=Limits(max_bytes=1 << 33))
    read, _ = read_parts(
        [Part(path, nbytes=size)], "u1", (2, size // 2), encoding="raw", options=options, file=path
    )
    assert read[-1, -3:].tobytes() == b"end"


def test_no_voxel_that_no_file_filled(tmp_path: Path) -> None:
    """Whatever the memory held before, a short stream gives an error and nothing else."""
    path = tmp_path / "short"
    path.write_bytes(zlib.compress(bytes(64)))
    for _ in range(20):
        canary = np.full(64**3, 0xA5, "u1")
        del canary
        with pytest.raises(InputError, match="ends at byte 64 of 262144"):
            load(path, np.zeros((64, 64, 64), "u1"), "zlib")


def test_open_regular_never_waits(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "fifo")
    start = time.monotonic()
    for path in (tmp_path / "fifo", Path("/dev/zero"), tmp_path, tmp_path / "none"):
        with pytest.raises(VolvizError):
            open_regular(path)
    assert time.monotonic() - start < 1
