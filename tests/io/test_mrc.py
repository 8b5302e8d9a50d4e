"""MRC/CCP4 against mrcfile and against the cell written out by hand."""

from __future__ import annotations

import gzip
import shutil
from pathlib import Path

import mrcfile
import numpy as np
import pytest

from volviz.errors import InputError, UnsupportedError, UsageError
from volviz.io import load, probe

FILES = ["emd_3197.map", "emd_3001.map", "3pqr_mode0.ccp4"]
ANGSTROM = 1e-7


@pytest.fixture
def header(data: Path):
    def of(name: str):
        with mrcfile.open(data / "formats" / name, permissive=True) as mrc:
            return mrc.header.copy(), mrc.data.copy()

    return of


@pytest.mark.parametrize("name", FILES)
def test_values_equal_mrcfile(data: Path, header, name: str) -> None:
    head, values = header(name)
    order = [int(head[k]) for k in ("maps", "mapr", "mapc")]  # axes of values[0], [1], [2]
    expected = values.transpose([order.index(axis) for axis in (3, 2, 1)])
    volume = load(data / "formats" / name)
    np.testing.assert_array_equal(volume.data, expected)
    assert volume.data.dtype == expected.dtype.newbyteorder("=")
    assert probe(data / "formats" / name).dims == volume.dims


def test_known_axis_orders(data: Path) -> None:
    assert load(data / "formats" / "emd_3001.map").dims == (43, 25, 73)  # rows, sections, columns
    assert load(data / "formats" / "3pqr_mode0.ccp4").dims == (100, 69, 59)


def test_positions_of_emd_3197(data: Path) -> None:
    info = probe(data / "formats" / "emd_3197.map")
    np.testing.assert_allclose(info.spacing, [11.4 * ANGSTROM] * 3)
    np.testing.assert_allclose(info.origin, (-22.8 * ANGSTROM, 0, 0), atol=1e-15)
    assert (info.length_unit, info.space) == ("Å", None)


def test_oblique_cell_of_emd_3001(data: Path) -> None:
    """Columns along z, rows along x, sections along y; beta 94.326°, 40 × 12 × 72 intervals."""
    info = probe(data / "formats" / "emd_3001.map")
    beta = np.radians(94.326)
    a, b, c = 17.93, 4.71, 33.03
    x = np.array([a / 40, 0, 0])
    y = np.array([0, b / 12, 0])
    z = np.array([c * np.cos(beta), 0, c * np.sin(beta)]) / 72
    steps = np.column_stack([x, y, z]) * ANGSTROM
    np.testing.assert_allclose(info.affine[:3, :3], steps, rtol=1e-6, atol=1e-14)
    np.testing.assert_allclose(info.origin, steps @ [-21, -12, 0], rtol=1e-6, atol=1e-14)


def test_hexagonal_cell_of_3pqr(data: Path) -> None:
    info = probe(data / "formats" / "3pqr_mode0.ccp4")
    a, c = 241.55, 109.8625
    x = np.array([a, 0, 0]) / 252
    y = np.array([a * np.cos(np.radians(120)), a * np.sin(np.radians(120)), 0]) / 252
    z = np.array([0, 0, c]) / 120
    steps = np.column_stack([x, y, z]) * ANGSTROM
    np.testing.assert_allclose(info.affine[:3, :3], steps, rtol=1e-6, atol=1e-14)
    np.testing.assert_allclose(info.origin, steps @ [-98, -43, 13], rtol=1e-6)


@pytest.mark.parametrize("dtype", ["i1", "i2", "f4", "u2", "f2"])
@pytest.mark.parametrize("order", ["<", ">"])
def test_modes_and_byte_orders(tmp_path: Path, dtype: str, order: str) -> None:
    values = (np.arange(60).reshape(3, 4, 5) - (0 if dtype == "u2" else 30)).astype(order + dtype)
    path = tmp_path / "a.mrc"
    with mrcfile.new(path) as mrc:
        mrc.set_data(values)
        mrc.voxel_size = (1.5, 2.5, 3.5)
        mrc.header.origin = (10, 20, 30)
    volume = load(path)
    np.testing.assert_array_equal(volume.data, values.astype("f4") if dtype == "f2" else values)
    np.testing.assert_allclose(volume.spacing, np.array([1.5, 2.5, 3.5]) * ANGSTROM, rtol=1e-6)
    np.testing.assert_allclose(volume.info.origin, np.array([10, 20, 30]) * ANGSTROM, rtol=1e-6)


def make(path: Path, values: np.ndarray | None = None, **fields) -> Path:
    values = np.arange(60, dtype="f4").reshape(3, 4, 5) if values is None else values
    with mrcfile.new(path, overwrite=True) as mrc:
        mrc.set_data(values)
        mrc.voxel_size = 2.0
        for name, value in fields.items():
            setattr(mrc.header, name, value)
    return path


def test_extended_header_is_skipped(tmp_path: Path) -> None:
    path = tmp_path / "a.mrc"
    values = np.arange(60, dtype="f4").reshape(3, 4, 5)
    with mrcfile.new(path) as mrc:
        mrc.set_extended_header(np.frombuffer(b"\xa5" * 320, dtype="V320"))
        mrc.set_data(values)
    np.testing.assert_array_equal(load(path).data, values)


def test_gzip(tmp_path: Path) -> None:
    path = make(tmp_path / "a.mrc")
    packed = tmp_path / "a.map.gz"
    with gzip.open(packed, "wb") as file, path.open("rb") as plain:
        shutil.copyfileobj(plain, file)
    np.testing.assert_array_equal(load(packed).data, load(path).data)
    assert probe(packed).encoding == "gzip"


def test_stack_of_volumes(tmp_path: Path) -> None:
    values = np.arange(120, dtype="f4").reshape(2, 3, 4, 5)
    path = tmp_path / "a.mrc"
    with mrcfile.new(path) as mrc:
        mrc.set_data(values)
        mrc.set_volume_stack() if not mrc.is_volume_stack() else None
    for t in (0, 1):
        np.testing.assert_array_equal(load(path, time=t).data, values[t])
    with pytest.raises(UsageError, match="no time 2"):
        load(path, time=2)


def test_imod_unsigned_bytes(tmp_path: Path) -> None:
    path = make(tmp_path / "a.mrc", np.arange(60, dtype="i1").reshape(3, 4, 5))
    content = bytearray(path.read_bytes())
    content[152:160] = (1146047817).to_bytes(4, "little") + (0).to_bytes(4, "little")
    content[-1] = 200
    path.write_bytes(content)
    volume = load(path)
    assert (volume.data.dtype, volume.data[-1, -1, -1]) == (np.uint8, 200)
    assert any("unsigned" in w for w in volume.info.warnings)


def test_no_cell_is_said(tmp_path: Path) -> None:
    path = make(tmp_path / "a.mrc", cella=(0, 0, 0))
    info = probe(path)
    np.testing.assert_allclose(info.spacing, [ANGSTROM] * 3)
    assert info.length_unit is None
    assert any("cell is not given" in w for w in info.warnings)


def test_impossible_angles_are_said(tmp_path: Path) -> None:
    info = probe(make(tmp_path / "a.mrc", cellb=(10, 10, 170)))
    assert any("angles" in w for w in info.warnings)
    assert abs(np.linalg.det(info.affine / info.affine.max())) > 0


@pytest.mark.parametrize(
    ("fields", "error", "field"),
    [
        ({"mode": 4}, UnsupportedError, "MODE"),
        ({"mode": 101}, UnsupportedError, "MODE"),
        ({"mode": 77}, InputError, "MODE"),
        ({"nx": 0}, InputError, "NX"),
        ({"nz": -3}, InputError, "NZ"),
        ({"mapc": 2}, InputError, "MAPC, MAPR, MAPS"),
        ({"nsymbt": -8}, InputError, "NSYMBT"),
        ({"nx": 6}, InputError, "map"),
    ],
)
def test_wrong_headers(tmp_path: Path, fields: dict, error: type, field: str) -> None:
    path = make(tmp_path / "a.mrc")
    content = bytearray(path.read_bytes())
    offsets = {"nx": 0, "ny": 4, "nz": 8, "mode": 12, "mapc": 64, "nsymbt": 92}
    for name, value in fields.items():
        content[offsets[name] : offsets[name] + 4] = value.to_bytes(4, "little", signed=True)
    path.write_bytes(content)
    with pytest.raises(error) as caught:
        load(path)
    assert caught.value.field == field
    assert "a.mrc" in str(caught.value)


def test_header_fields_are_shown(data: Path) -> None:
    fields = probe(data / "formats" / "emd_3001.map").fields
    assert (fields["mapc"], fields["nsymbt"]) == ("3", "160")
    assert "17.9" in fields["cella"]
