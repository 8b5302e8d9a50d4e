"""What a file is: every real file gets a format or one clear line; content wins over the name."""

from __future__ import annotations

import gzip
import shutil
from pathlib import Path

import numpy as np
import pytest

from volviz.errors import InputError, UnsupportedError, VolvizError
from volviz.io import FORMATS, identify, load, probe, sniff


def refusal(path: Path, call) -> VolvizError | None:
    """The error with which a file is refused, None if it is not."""
    try:
        call(path)
    except VolvizError as error:
        return error
    return None


def test_every_real_file_is_known_or_refused_clearly(data: Path) -> None:
    seen: set[str] = set()
    for path in sorted(data.rglob("*")):
        error = refusal(path, lambda p: seen.add(identify(p)))
        if error is not None:
            assert error.exit_code in (3, 4)
            assert path.name in str(error)
            assert error.fix
    assert seen == set(FORMATS)


def test_every_real_file_is_probed_or_refused_clearly(data: Path) -> None:
    for path in sorted(data.rglob("*")):
        if path.parent.name.startswith("ct_head") or "CTHead" in path.name:
            continue  # one folder is one volume; its files are looked at in test_dicom
        found = []
        error = refusal(path, lambda p, found=found: found.append(probe(p)))
        if error is not None:
            assert error.exit_code in (2, 3, 4)
            assert "\n" not in str(error)
            continue
        (info,) = found
        assert min(info.dims) >= 1
        assert np.isfinite(info.affine).all()
        assert info.name


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("microscopy/mouse_brain.ome.zarr", "Zarr"),
        ("microscopy/mouse_brain.ome.zarr/0", "Zarr"),
        ("microscopy/mouse_brain.ome.zarr/0/.zarray", "Zarr"),
        ("microscopy/brain_cells_2ch_v05.ome.zarr", "Zarr"),
        ("microscopy/plant_ovule_raw_label.h5", "HDF5"),
        ("simulation/ironProt.vtk", "VTK"),
        ("structured/comb.vts", "VTK"),
        ("large/connectomics_512_label_ids.csv", "text"),
        ("make_large.py", "text"),
        ("formats/frogtissue.zraw", "header"),
    ],
)
def test_known_but_unread(data: Path, name: str, expected: str) -> None:
    with pytest.raises(UnsupportedError, match=expected) as caught:
        load(data / name)
    assert caught.value.exit_code == 4


def test_content_wins_over_the_name(tmp_path: Path) -> None:
    values = np.arange(24, dtype="u1").reshape(2, 3, 4)
    np.save(tmp_path / "a.npy", values)
    for name in ("a.nrrd", "a.dcm", "a.tif", "a", "a.raw"):
        shutil.copy(tmp_path / "a.npy", tmp_path / name)
        assert identify(tmp_path / name) == "numpy"
        np.testing.assert_array_equal(load(tmp_path / name).data, values)


def test_real_files_under_wrong_names(data: Path, tmp_path: Path) -> None:
    for source, wrong in (
        ("formats/emd_3197.map", "x.nii"),
        ("microscopy/snow.tif", "x.dcm"),
        ("dicom/tiny_rle/IM-0001-0001-0001.dcm", "x.png"),
        ("microscopy/em_isbi_png/image/00.png", "x.mrc"),
    ):
        shutil.copy(data / source, tmp_path / wrong)
        assert identify(tmp_path / wrong) == identify(data / source)
        load(tmp_path / wrong)


def test_gzip_is_looked_into(tmp_path: Path) -> None:
    np.save(tmp_path / "a.npy", np.zeros((2, 3, 4)))
    path = tmp_path / "a.gz"
    path.write_bytes(gzip.compress((tmp_path / "a.npy").read_bytes()))
    assert identify(path) == "numpy"


@pytest.mark.parametrize(
    ("content", "error"),
    [
        (b"", InputError),
        (b"\x00", UnsupportedError),
        (b"\x1f\x8b", UnsupportedError),
        (b"\x89HDF\r\n\x1a\n", UnsupportedError),
        (b"# vtk DataFile Version 3.0\n", UnsupportedError),
        (b'<?xml version="1.0"?>\n<VTKFile type="ImageData">', UnsupportedError),
        (b"PK\x03\x04" + bytes(40), UnsupportedError),
        (b"a;b;c\n1;2;3\n", UnsupportedError),
        (bytes(range(256)) * 8, UnsupportedError),
    ],
)
def test_strange_contents(tmp_path: Path, content: bytes, error: type) -> None:
    path = tmp_path / "thing"
    path.write_bytes(content)
    with pytest.raises(error) as caught:
        identify(path)
    assert "thing" in str(caught.value)


def test_folders(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="it is empty"):
        load(tmp_path)
    (tmp_path / "a.csv").write_text("1")
    (tmp_path / "b.nrrd").write_text("1")
    with pytest.raises(InputError, match=r"1 × \.csv, 1 × \.nrrd"):
        load(tmp_path)


def test_folder_beside_a_store_is_not_the_store(tmp_path: Path) -> None:
    from PIL import Image

    (tmp_path / "zarr.json").write_text("{}")
    below = tmp_path / "slices"
    below.mkdir()
    for k in range(3):
        Image.fromarray(np.zeros((4, 4), "u1")).save(below / f"{k}.png")
    assert identify(below) == "images"


def test_bmp_headers() -> None:
    for size in (12, 40, 108, 124):
        assert sniff.is_image(b"BM" + bytes(12) + size.to_bytes(4, "little") + bytes(8))
    assert not sniff.is_image(b"BM, a text that begins like this")


def test_formats_that_are_not_read_inside_gzip(data: Path, tmp_path: Path) -> None:
    for name in ("dicom/tiny_rle/IM-0001-0001-0001.dcm", "microscopy/snow.tif"):
        path = tmp_path / f"{Path(name).name}.gz"
        path.write_bytes(gzip.compress((data / name).read_bytes()))
        with pytest.raises(UnsupportedError, match="unpack it first"):
            load(path)
