"""NumPy files against numpy, and the refusal of what could run code."""

from __future__ import annotations

import gzip
import io
import zipfile
from pathlib import Path

import numpy as np
import pytest

from volviz.errors import Cancelled, InputError, LimitError, UnsupportedError, UsageError
from volviz.io import Limits, load, probe
from volviz.progress import Progress


def grid(*shape: int, dtype: str = "i2") -> np.ndarray:
    return np.arange(np.prod(shape), dtype=np.int64).reshape(shape).astype(dtype)


def test_stent(data: Path) -> None:
    path = data / "classics" / "stent.npz"
    volume = load(path)
    np.testing.assert_array_equal(volume.data, np.load(path)["arr_0"])
    info = probe(path)
    assert (info.dims, info.dtype, info.encoding) == ((128, 128, 256), np.int16, "deflate")


def test_points_are_no_volume(data: Path) -> None:
    with pytest.raises(UnsupportedError, match="looks like 32314 points") as caught:
        load(data / "points" / "halo_low_res.npy")
    assert caught.value.exit_code == 4


@pytest.mark.parametrize("dtype", ["u1", "i1", "<u2", ">u2", ">i4", "<f4", ">f8", "f2", "?", "u8"])
@pytest.mark.parametrize("fortran", [False, True])
def test_dtypes_and_orders(tmp_path: Path, dtype: str, fortran: bool) -> None:
    values = grid(3, 4, 5, dtype=dtype)
    stored = np.asfortranarray(values) if fortran else values
    path = tmp_path / "a.npy"
    np.save(path, stored)
    volume = load(path)
    np.testing.assert_array_equal(volume.data, values)
    assert volume.data.flags.c_contiguous
    assert probe(path).dtype == volume.data.dtype
    assert volume.spacing == (1, 1, 1)
    assert any("spacing unknown" in w for w in volume.info.warnings)


AXES = pytest.mark.parametrize(
    "case",
    [
        ((6, 7), 1, 1, lambda a, t, c: a[None]),
        ((6, 7, 8), 1, 1, lambda a, t, c: a),
        ((20, 24, 3), 1, 3, lambda a, t, c: a[None, ..., c]),
        ((5, 6, 7, 8), 5, 1, lambda a, t, c: a[t]),
        ((6, 7, 8, 2), 1, 2, lambda a, t, c: a[..., c]),
        ((3, 2, 6, 7, 8), 3, 2, lambda a, t, c: a[t, c]),
        ((3, 6, 7, 8, 2), 3, 2, lambda a, t, c: a[t, ..., c]),
    ],
)


@pytest.mark.parametrize("fortran", [False, True])
@pytest.mark.parametrize("kind", ["npy", "npz"])
@AXES
def test_axes(tmp_path: Path, case, fortran: bool, kind: str) -> None:
    shape, times, channels, pick = case
    values = grid(*shape)
    path = tmp_path / f"a.{kind}"
    stored = np.asfortranarray(values) if fortran else values
    if kind == "npy":
        np.save(path, stored)
    else:
        np.savez(path, stored)
    info = probe(path)
    assert (info.times, info.channels) == (times, channels)
    for t in range(times):
        for c in range(channels):
            np.testing.assert_array_equal(load(path, time=t, channel=c).data, pick(values, t, c))
    if len(shape) > 3:
        assert any("axes are taken as" in w for w in info.warnings)
    with pytest.raises(UsageError):
        load(path, time=times)
    with pytest.raises(UsageError):
        load(path, channel=channels)


def test_only_the_chosen_time_is_read(tmp_path: Path) -> None:
    values = grid(50, 6, 7, 8)
    np.save(tmp_path / "a.npy", values)
    limits = Limits(max_bytes=values[0].nbytes)
    np.testing.assert_array_equal(load(tmp_path / "a.npy", time=49, limits=limits).data, values[49])


@pytest.mark.parametrize("save", [np.savez, np.savez_compressed])
def test_npz_picks_the_grid(tmp_path: Path, save) -> None:
    path = tmp_path / "a.npz"
    values = grid(4, 5, 6)
    save(path, volume=values, spacing=np.ones(3), matrix=np.eye(4))
    np.testing.assert_array_equal(load(path).data, values)
    save(path, one=values, two=values + 1)
    with pytest.raises(UsageError, match=r"one \(4, 5, 6\) int16, two .*--series") as caught:
        load(path)
    assert caught.value.exit_code == 2
    np.testing.assert_array_equal(load(path, series="two").data, values + 1)
    with pytest.raises(UsageError, match="no array 'three'"):
        load(path, series="three")


def test_gzip(tmp_path: Path) -> None:
    buffer = io.BytesIO()
    values = grid(4, 5, 6)
    np.save(buffer, values)
    path = tmp_path / "a.npy.gz"
    path.write_bytes(gzip.compress(buffer.getvalue()))
    np.testing.assert_array_equal(load(path).data, values)


class Trap:
    """Unpickling it writes a file."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return Path.write_text, (self.mark, "executed")


@pytest.mark.parametrize("kind", ["npy", "npz", "raw pickle"])
def test_pickles_never_run(tmp_path: Path, kind: str) -> None:
    mark = tmp_path / "mark"
    trap = np.empty((2, 2, 2), dtype=object)
    trap[...] = Trap(mark)
    path = tmp_path / ("a.npz" if kind == "npz" else "a.npy")
    if kind == "raw pickle":
        import pickle

        path.write_bytes(pickle.dumps(Trap(mark)))
    else:
        (np.savez if kind == "npz" else np.save)(path, trap, allow_pickle=True)
    with pytest.raises(InputError) as caught:
        load(path)
    assert not mark.exists()
    if kind != "raw pickle":
        assert "could run code" in str(caught.value)


@pytest.mark.parametrize(
    "values",
    [
        np.zeros((3, 4, 5), dtype=[("a", "f4"), ("b", "i2")]),
        np.zeros((3, 4, 5), dtype="c8"),
        np.zeros((3, 4, 5), dtype="U4"),
        np.zeros((3, 4, 5), dtype="M8[s]"),
        np.zeros(7),
        np.zeros((2, 2, 2, 2, 2, 2)),
    ],
    ids=["structured", "complex", "text", "dates", "1-D", "6-D"],
)
def test_no_scalar_field(tmp_path: Path, values: np.ndarray) -> None:
    np.save(tmp_path / "a.npy", values)
    with pytest.raises(UnsupportedError):
        load(tmp_path / "a.npy")


def header(text: str) -> bytes:
    body = text.encode("latin-1").ljust(118 - 1) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(body).to_bytes(2, "little") + body


@pytest.mark.parametrize(
    ("text", "error"),
    [
        (
            "{'descr': '<f4', 'fortran_order': False, 'shape': (100000, 100000, 100000), }",
            LimitError,
        ),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (-1, 4, 5), }", InputError),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (0, 4, 5), }", InputError),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (4, 4, 1e9), }", InputError),
        ("{'descr': 'nonsense', 'fortran_order': False, 'shape': (4, 4, 5), }", InputError),
        ("__import__('os').system('true')", InputError),
        ("{" * 110, InputError),
        ("{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4, 5), }", InputError),
    ],
)
def test_hostile_headers(tmp_path: Path, text: str, error: type) -> None:
    path = tmp_path / "a.npy"
    path.write_bytes(header(text) + bytes(16))
    with pytest.raises(error) as caught:
        load(path)
    assert "a.npy" in str(caught.value)


def test_zip_directory_that_lies(tmp_path: Path) -> None:
    """The size comes from the array's header; a member that holds less or more is refused."""
    buffer = io.BytesIO()
    np.save(buffer, grid(4, 5, 6))
    whole = buffer.getvalue()
    for content in (whole[:-10], whole + bytes(10)):
        path = tmp_path / "a.npz"
        with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
            archive.writestr("arr_0.npy", content)
        with pytest.raises(InputError):
            load(path)


def test_zip_member_bomb(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    buffer = io.BytesIO()
    np.save(buffer, grid(4, 5, 6))
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("arr_0.npy", buffer.getvalue() + bytes(100 << 20))
    with pytest.raises(InputError, match="more data than the header declares"):
        load(path)


def test_encrypted_or_odd_zip(tmp_path: Path) -> None:
    path = tmp_path / "a.npz"
    np.savez(path, grid(3, 4, 5))
    content = bytearray(path.read_bytes())
    for at in (content.index(b"PK\x03\x04") + 6, content.index(b"PK\x01\x02") + 8):
        content[at] |= 1
    path.write_bytes(content)
    with pytest.raises(UnsupportedError):
        load(path)
    np.savez(path, grid(3, 4, 5))
    content = bytearray(path.read_bytes())
    content[-200] ^= 0xFF
    path.write_bytes(content)
    with pytest.raises(InputError):
        load(path)


def test_spacing_and_cancel(tmp_path: Path) -> None:
    path = tmp_path / "a.npy"
    np.save(path, grid(3, 4, 5))
    info = probe(path, spacing=(1, 2, 3))
    assert (info.spacing, info.length_unit) == ((1, 2, 3), "mm")
    progress = Progress()
    progress.cancel()
    with pytest.raises(Cancelled):
        load(path, progress=progress)
