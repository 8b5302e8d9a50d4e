"""OME-TIFF: axes, sizes and planes as written, and files that are missing, elsewhere or outside."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
import tifffile

from volviz.errors import InputError, UnsupportedError
from volviz.io import load, probe


def stack(*shape: int, dtype: str = "u2") -> np.ndarray:
    return np.arange(np.prod(shape), dtype=np.int64).reshape(shape).astype(dtype)


def write(path: Path, values: np.ndarray, **choices) -> None:
    tifffile.imwrite(path, values, **{"photometric": "minisblack", **choices})


@pytest.mark.parametrize("axes", ["ZYX", "CZYX", "TZCYX", "TCZYX", "ZCYX"])
def test_ome_axes_and_sizes(tmp_path: Path, axes: str) -> None:
    lengths = {"T": 2, "Z": 4, "C": 3, "Y": 5, "X": 6}
    values = stack(*(lengths[a] for a in axes))
    path = tmp_path / "a.ome.tif"
    metadata = {
        "axes": axes,
        "PhysicalSizeX": 0.5,
        "PhysicalSizeY": 0.25,
        "PhysicalSizeZ": 2000.0,
        "PhysicalSizeZUnit": "nm",
    }
    write(path, values, ome=True, metadata=metadata, photometric="minisblack")
    info = probe(path)
    np.testing.assert_allclose(info.spacing, (0.5e-3, 0.25e-3, 2e-3))
    assert info.length_unit == "µm"
    assert (info.times, info.channels, info.dims) == (
        2 if "T" in axes else 1,
        3 if "C" in axes else 1,
        (6, 5, 4),
    )
    for t in range(info.times):
        for c in range(info.channels):
            index = tuple({"T": t, "C": c}.get(a, slice(None)) for a in axes)
            np.testing.assert_array_equal(load(path, time=t, channel=c).data, values[index])


def ome_xml(blocks: str, *, z: int = 4, c: int = 1, t: int = 1, extra: str = "") -> str:
    return (
        '<?xml version="1.0"?><OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06" '
        f'UUID="urn:uuid:1">{extra}<Image ID="Image:0"><Pixels ID="Pixels:0" '
        f'DimensionOrder="XYZCT" SizeX="6" SizeY="5" SizeZ="{z}" SizeC="{c}" SizeT="{t}" '
        f'Type="uint16">{blocks}</Pixels></Image></OME>'
    )


def write_ome(path: Path, values: np.ndarray, xml: str) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path, values, description=xml, metadata=None, photometric="minisblack")
    return path


def elsewhere(first: int, name: str, count: int = 2) -> str:
    return (
        f'<TiffData FirstZ="{first}" IFD="0" PlaneCount="{count}">'
        f'<UUID FileName="{name}">urn:uuid:2</UUID></TiffData>'
    )


OWN = '<TiffData FirstZ="0" IFD="0" PlaneCount="2"/>'


def test_ome_of_two_files(tmp_path: Path) -> None:
    values = stack(4, 5, 6)
    path = write_ome(tmp_path / "a.ome.tif", values[:2], ome_xml(OWN + elsewhere(2, "b.ome.tif")))
    write(tmp_path / "b.ome.tif", values[2:], metadata=None)
    np.testing.assert_array_equal(load(path).data, values)


def test_ome_companion_missing(tmp_path: Path) -> None:
    xml = ome_xml(OWN + elsewhere(2, "b.ome.tif"))
    path = write_ome(tmp_path / "a.ome.tif", stack(2, 5, 6), xml)
    with pytest.raises(InputError, match=r"b\.ome\.tif"):
        load(path)


def test_ome_planes_missing_are_never_zero(tmp_path: Path) -> None:
    path = write_ome(tmp_path / "a.ome.tif", stack(2, 5, 6), ome_xml(OWN))
    with pytest.raises(InputError, match=r"2 of 4 planes are not in the file \(plane 3, 4\)"):
        load(path)


@pytest.mark.parametrize("name", ["../x.ome.tif", "/etc/passwd", "a/../../x.ome.tif", "..\\x.tif"])
def test_ome_never_opens_a_file_outside(tmp_path: Path, name: str) -> None:
    values = stack(4, 5, 6)
    write(tmp_path / "x.ome.tif", values[2:], metadata=None)
    path = write_ome(tmp_path / "in" / "a.ome.tif", values[:2], ome_xml(OWN + elsewhere(2, name)))
    opened: list[str] = []
    watching = [True]

    def hook(event: str, args: tuple) -> None:
        if watching[0] and event == "open" and isinstance(args[0], (str, bytes)):
            opened.append(str(args[0]))

    sys.addaudithook(hook)
    try:
        with pytest.raises(InputError) as caught:
            load(path)
    finally:
        watching[0] = False
    assert caught.value.field == "UUID FileName"
    inside = str(tmp_path / "in")
    outside = [p for p in opened if not p.startswith(inside) and "python" not in p]
    assert [p for p in outside if p.endswith((".tif", "passwd"))] == []


def test_ome_renamed_file_still_finds_itself(tmp_path: Path) -> None:
    values = stack(4, 5, 6)
    block = (
        '<TiffData FirstZ="0" IFD="0" PlaneCount="4">'
        '<UUID FileName="before.ome.tif">urn:uuid:9</UUID></TiffData>'
    )
    path = write_ome(tmp_path / "after.ome.tif", values, ome_xml(block))
    np.testing.assert_array_equal(load(path).data, values)


def test_ome_binary_only(tmp_path: Path) -> None:
    xml = ome_xml(OWN, extra='<BinaryOnly MetadataFile="meta.companion.ome" UUID="u"/>')
    path = write_ome(tmp_path / "a.ome.tif", stack(2, 5, 6), xml)
    with pytest.raises(UnsupportedError, match=r"meta\.companion\.ome"):
        load(path)
