from __future__ import annotations

from pathlib import Path
from unittest.mock import patch

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.io.test_payload import PACK, load
from volviz.errors import InputError
from volviz.io import decode, payload


@pytest.mark.parametrize("encoding", ["gzip", "bzip2"])
@pytest.mark.parametrize("size", [100_000, 262_144, 700_001])
def test_members_longer_than_what_is_read_at_once(tmp_path: Path, encoding: str, size: int) -> None:
    array = np.random.default_rng(2).integers(0, 256, 3 * size).astype("u1")
    path = tmp_path / "data"
    path.write_bytes(b"".join(PACK[encoding](m.tobytes()) for m in np.split(array, 3)))
    np.testing.assert_array_equal(load(path, array, encoding)[0], array)


@pytest.mark.parametrize("encoding", ["gzip", "bzip2"])
def test_streams_of_many_members(tmp_path: Path, encoding: str) -> None:
    array = np.random.default_rng(2).integers(0, 9, 70_000).astype("u1")
    pieces = [array[i : i + 3001].tobytes() for i in range(0, array.size, 3001)]
    path = tmp_path / "data"
    path.write_bytes(b"".join(PACK[encoding](p) + PACK[encoding](b"") for p in pieces))
    np.testing.assert_array_equal(load(path, array, encoding)[0], array)
    path.write_bytes(b"".join(PACK[encoding](p) for p in [*pieces, b"x"]))
    with pytest.raises(InputError, match="more data than the header declares"):
        load(path, array, encoding)


@pytest.mark.parametrize("encoding", ["gzip", "zlib", "bzip2"])
@settings(max_examples=80, deadline=None)
@given(
    members=st.lists(st.binary(min_size=1, max_size=900), min_size=1, max_size=3),
    other=st.integers(-5, 5),
    cut=st.integers(1, 12),
    read=st.sampled_from([1, 2, 3, 17, 1 << 18]),
    step=st.sampled_from([1, 5, 64, 1 << 20]),
)
def test_only_a_whole_stream_of_the_right_length_is_read(
    *,
    tmp_path_factory: pytest.TempPathFactory,
    encoding: str,
    members: list[bytes],
    other: int,
    cut: int,
    read: int,
    step: int,
) -> None:
    """Also where a stream is read and decoded in the smallest pieces."""
    path = tmp_path_factory.getbasetemp() / f"stream.{encoding}"
    members = members[:1] if encoding == "zlib" else members
    data, packed = b"".join(members), b"".join(PACK[encoding](m) for m in members)
    declared = np.zeros(max(len(data) + other, 1), "u1")
    with patch.object(decode, "_INPUT", read), patch.object(payload, "STEP", step):
        path.write_bytes(packed)
        if declared.size == len(data):
            assert load(path, declared, encoding)[0].tobytes() == data
        else:
            with pytest.raises(InputError, match=r"more data than|ends at byte"):
                load(path, declared, encoding)
        path.write_bytes(packed[:-cut])
        with pytest.raises(InputError, match="ends at byte"):
            load(path, np.zeros(len(data), "u1"), encoding)


@pytest.mark.parametrize("encoding", ["hex", "ascii"])
@pytest.mark.parametrize("read", [1, 2, 7])
def test_text_in_the_smallest_pieces(tmp_path: Path, encoding: str, read: int) -> None:
    array = np.random.default_rng(4).integers(-900, 900, (3, 4, 5)).astype("<i2")
    text = array.tobytes().hex(" ", 3) if encoding == "hex" else ", ".join(map(str, array.ravel()))
    path = tmp_path / "data"
    path.write_text(text)
    with patch.object(decode, "_TEXT", read), patch.object(payload, "STEP", 6):
        np.testing.assert_array_equal(load(path, array, encoding)[0], array)


@pytest.mark.parametrize("encoding", ["gzip", "zlib", "bzip2"])
def test_a_wrong_check_sum_is_found(tmp_path: Path, encoding: str) -> None:
    array = np.arange(4096, dtype="<u2")
    packed = bytearray(PACK[encoding](array.tobytes()))
    packed[-7 if encoding == "gzip" else -2] ^= 0x10
    if encoding == "bzip2":
        packed[12] ^= 0x10
    path = tmp_path / "data"
    path.write_bytes(packed)
    with pytest.raises(InputError, match="damaged"):
        load(path, array, encoding)
