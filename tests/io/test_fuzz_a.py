"""Cut, flipped and mutated NRRD, MetaImage and NIfTI files: a volume or a VolvizError."""

from __future__ import annotations

import bz2
import gzip
import zlib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.io.hostile_maker import ARRAY, META, NRRD, RAW, meta, nifti, nrrd
from volviz.errors import VolvizError
from volviz.io import load
from volviz.io.options import Limits, ReadOptions
from volviz.model.volume import Volume


def corpus() -> dict[str, bytes]:
    """Small whole files of every kind."""
    return {
        "raw.nrrd": nrrd(space="LPS", space_directions="(1,0,0) (0,2,0) (0,0,3)"),
        "gz.nrrd": nrrd(gzip.compress(RAW), encoding="gzip"),
        "bz.nrrd": nrrd(bz2.compress(RAW), encoding="bzip2"),
        "txt.nrrd": nrrd(" ".join(map(str, ARRAY.ravel())).encode(), encoding="ascii"),
        "hex.nrrd": nrrd(RAW.hex().encode(), encoding="hex"),
        "raw.mha": meta(TransformMatrix="1 0 0 0 1 0 0 0 1", Offset="1 2 3"),
        "z.mha": meta(zlib.compress(RAW), CompressedData="True"),
        "one.nii": nifti(scl_slope=2.0),
        "two.nii": nifti(two=True),
        "one.nii.gz": gzip.compress(nifti()),
    }


def only_volume_or_error(path: Path) -> Volume | None:
    """The volume, None for a VolvizError; anything else fails the test."""
    options = ReadOptions(limits=Limits(max_bytes=1 << 24))
    try:
        return load(path, options)
    except VolvizError:
        return None


@pytest.mark.parametrize("name", corpus())
def test_truncation_sweep(tmp_path: Path, name: str) -> None:
    content = corpus()[name]
    path = tmp_path / name
    path.write_bytes(content)
    whole = load(path).data
    for cut in np.unique(np.linspace(0, len(content) - 1, 60).astype(int)):
        path.write_bytes(content[:cut])
        volume = only_volume_or_error(path)
        if volume is not None and volume.data.shape == whole.shape:
            same = np.count_nonzero(volume.data == whole)
            assert same >= whole.size - 1, f"{cut} of {len(content)} bytes gave other voxels"


@pytest.mark.parametrize("name", corpus())
@settings(
    max_examples=60,
    deadline=None,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)
@given(data=st.data())
def test_flipped_bytes(tmp_path: Path, name: str, data: st.DataObject) -> None:
    content = bytearray(corpus()[name])
    head = min(len(content), 420)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.one_of(st.integers(0, head - 1), st.integers(0, len(content) - 1)))
        content[place] = data.draw(st.integers(0, 255))
    path = tmp_path / name
    path.write_bytes(content)
    only_volume_or_error(path)


TOKENS = [
    "0",
    "-1",
    "nan",
    "1e400",
    "9" * 40,
    "none",
    "(1,0",
    "%s%n",
    "LIST",
    "../x",
    "",
    "\0",
    "é" * 9,
]


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    make=st.sampled_from([(nrrd, "a.nrrd"), (meta, "a.mha")]),
    number=st.integers(0, 9),
    value=st.lists(st.sampled_from([*TOKENS, "6", "5", "4", "(1,0,0)"]), max_size=6).map(" ".join),
)
def test_mutated_fields(
    tmp_path: Path, make: tuple[Callable[..., bytes], str], number: int, value: str
) -> None:
    maker, name = make
    ours = [*NRRD, "space directions", "space origin", "spacings", "byte skip", "data file"]
    theirs = [*META, "ElementSpacing", "Offset", "TransformMatrix", "HeaderSize", "CompressedData"]
    key = (ours if maker is nrrd else theirs)[number]
    path = tmp_path / name
    path.write_bytes(maker(**{key.replace(" ", "_"): value}))
    only_volume_or_error(path)
