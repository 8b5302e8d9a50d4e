from __future__ import annotations

import gzip
import itertools
from pathlib import Path

import numpy as np
import pytest

from tests.io.nrrd_maker import ARRAY, simple, write
from volviz.errors import UnsupportedError, UsageError
from volviz.io import load, probe


@pytest.mark.parametrize(
    ("space", "flips"),
    [
        ("left-posterior-superior", (1, 1, 1)),
        ("LPS", (1, 1, 1)),
        ("right-anterior-superior", (-1, -1, 1)),
        ("RAS", (-1, -1, 1)),
        ("left-anterior-superior", (1, -1, 1)),
        ("LAS", (1, -1, 1)),
    ],
)
def test_spaces_become_lps(tmp_path: Path, space: str, flips: tuple[int, ...]) -> None:
    geometry = f"""space: {space}
        space directions: (0.5,0.1,0) (-0.2,1.5,0.3) (0,0.4,2)
        space origin: (10,-20,30)"""
    path = write(tmp_path / "a.nrrd", simple(ARRAY, geometry), ARRAY.tobytes())
    volume = load(path)
    steps = np.array([[0.5, -0.2, 0], [0.1, 1.5, 0.4], [0, 0.3, 2]])
    np.testing.assert_allclose(volume.affine[:3, :3], np.diag(flips) @ steps)
    np.testing.assert_allclose(volume.info.origin, np.array(flips) * (10, -20, 30))
    assert (volume.info.space, volume.info.length_unit) == ("LPS", "mm")
    assert volume.info.oblique


@pytest.mark.parametrize(
    "space", ["space: scanner-xyz", "space: 3D-right-handed", "space dimension: 3", "content: x"]
)
def test_other_spaces_stay_unknown(tmp_path: Path, space: str) -> None:
    geometry = f"{space}\nspace directions: (2,0,0) (0,3,0) (0,0,4)\nspace origin: (1,2,3)"
    info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, geometry), ARRAY.tobytes()))
    assert (info.space, info.length_unit, info.orientation) == (None, None, None)
    assert (info.spacing, info.origin) == ((2, 3, 4), (1, 2, 3))


def test_left_handed_and_unheard_of_spaces_are_told(tmp_path: Path) -> None:
    for space, word in (("3D-left-handed", "mirrored"), ("banana", "banana")):
        info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, f"space: {space}"), ARRAY.tobytes()))
        assert any(word in w for w in info.warnings)
        assert info.space is None


@pytest.mark.parametrize(
    ("unit", "name", "factor"),
    [("um", "µm", 1e-3), ("µm", "µm", 1e-3), ("m", "m", 1e3), ("cm", "cm", 10), ("nm", "nm", 1e-6)],
)
def test_units(tmp_path: Path, unit: str, name: str, factor: float) -> None:
    more = f"""space dimension: 3
        space directions: (2,0,0) (0,3,0) (0,0,4)
        space origin: (1,2,3)
        space units: "{unit}" "{unit}" "{unit}" """
    info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, more), ARRAY.tobytes()))
    np.testing.assert_allclose(info.spacing, np.array([2, 3, 4]) * factor)
    np.testing.assert_allclose(info.origin, np.array([1, 2, 3]) * factor)
    assert info.length_unit == name
    more = f'spacings: 2 3 4\nunits: "{unit}" "{unit}" "{unit}"'
    info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, more), ARRAY.tobytes()))
    np.testing.assert_allclose(info.spacing, np.array([2, 3, 4]) * factor)


def test_spacings_that_say_nothing(tmp_path: Path) -> None:
    info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, "spacings: nan 0 -2"), ARRAY.tobytes()))
    np.testing.assert_allclose(np.diag(info.affine), [1, 1, -2, 1])
    assert len(info.warnings) == 2


def test_axis_mins_and_maxs(tmp_path: Path) -> None:
    more = "axis mins: 0 10 0\naxis maxs: 6 20 3\ncenterings: cell cell node"
    info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, more), ARRAY.tobytes()))
    np.testing.assert_allclose(info.spacing, (1, 2, 1))
    np.testing.assert_allclose(info.origin, (0.5, 11, 0))


@pytest.mark.parametrize(
    "directions",
    [
        "(1,0,0) (0,1,0) (0,0,nan)",
        "(1,0,0) (2,0,0) (0,0,1)",
        "(1,0,0) (0,1,0) (0,0,0)",
        "(1e300,0,0) (0,1,0) (0,0,1)",
        "(inf,0,0) (0,1,0) (0,0,1)",
    ],
)
def test_singular_directions_give_spacing_1_and_a_warning(tmp_path: Path, directions: str) -> None:
    more = f"space: LPS\nspace directions: {directions}\nspace origin: (nan,0,0)"
    volume = load(write(tmp_path / "a.nrrd", simple(ARRAY, more), ARRAY.tobytes()))
    np.testing.assert_array_equal(volume.affine, np.eye(4))
    assert any("space directions" in w for w in volume.info.warnings)
    assert any("origin" in w for w in volume.info.warnings)


def test_extreme_spacings_are_kept(tmp_path: Path) -> None:
    for step in (1e-30, 1e30):
        more = f"spacings: {step} {step} {step}"
        info = probe(write(tmp_path / "a.nrrd", simple(ARRAY, more), ARRAY.tobytes()))
        np.testing.assert_allclose(info.spacing, [step] * 3)
        assert info.warnings == ()


FOUR = np.random.default_rng(5).integers(0, 200, (3, 4, 5, 6)).astype("u1")
FIVE = np.random.default_rng(6).integers(0, 200, (2, 4, 5, 6, 3)).astype("u1")
VECTORS = "(2,0,0) (0,3,0) (0,0,4)"


@pytest.mark.parametrize("encoding", ["raw", "gzip", "hex"])
@pytest.mark.parametrize("kinds", ["domain domain domain time", "", "domain domain domain list"])
def test_last_axis_of_times_or_channels(tmp_path: Path, encoding: str, kinds: str) -> None:
    pack = {"raw": bytes, "gzip": gzip.compress, "hex": lambda b: b.hex().encode()}[encoding]
    more = f"space: LPS\nspace directions: {VECTORS} none" + (f"\nkinds: {kinds}" if kinds else "")
    path = write(tmp_path / "a.nrrd", simple(FOUR, more, encoding), pack(FOUR.tobytes()))
    what = "channel" if kinds.endswith("list") else "time"
    for k in range(3):
        volume = load(path, **{what: k})
        np.testing.assert_array_equal(volume.data, FOUR[k])
        assert volume.spacing == (2, 3, 4)
        assert getattr(volume.info, what + "s") == 3
        assert getattr(volume.info, what) == k
        assert any(f"--{what}" in w for w in volume.info.warnings)
    with pytest.raises(UsageError, match="choose 0 to 2"):
        load(path, **{what: 3})
    with pytest.raises(UsageError, match="choose 0 to 2"):
        load(path, **{what: -1})


@pytest.mark.parametrize("kind", ["vector", "RGB-color", "list", "???"])
def test_first_axis_of_channels(tmp_path: Path, kind: str) -> None:
    array = np.ascontiguousarray(np.moveaxis(FOUR, 0, -1))
    more = f"space: RAS\nspace directions: none {VECTORS}\nkinds: {kind} domain domain domain"
    path = write(tmp_path / "a.nrrd", simple(array, more), array.tobytes())
    for k in range(3):
        volume = load(path, channel=k)
        np.testing.assert_array_equal(volume.data, FOUR[k])
        np.testing.assert_allclose(np.diag(volume.affine), [-2, -3, 4, 1])
        assert (volume.info.channels, volume.info.times) == (3, 1)


def test_kinds_alone_and_nan_spacings_tell_channels(tmp_path: Path) -> None:
    array = np.ascontiguousarray(np.moveaxis(FOUR, 0, -1))
    for more in ("kinds: 3-color domain domain domain", "spacings: nan 2 3 4"):
        path = write(tmp_path / "a.nrrd", simple(array, more), array.tobytes())
        np.testing.assert_array_equal(load(path, channel=1).data, FOUR[1])
    path = write(tmp_path / "b.nrrd", simple(FOUR), FOUR.tobytes())
    np.testing.assert_array_equal(load(path, time=2).data, FOUR[2])


def test_five_axes_have_channels_and_times(tmp_path: Path) -> None:
    more = (
        f"space: LPS\nspace directions: none {VECTORS} none\nkinds: vector space space space time"
    )
    path = write(tmp_path / "a.nrrd", simple(FIVE, more), FIVE.tobytes())
    for time, channel in itertools.product(range(2), range(3)):
        volume = load(path, time=time, channel=channel)
        np.testing.assert_array_equal(volume.data, FIVE[time, ..., channel])


def test_two_lists_are_channels_then_times(tmp_path: Path) -> None:
    array = np.ascontiguousarray(np.moveaxis(FIVE, -1, 1))
    more = f"space: LPS\nspace directions: {VECTORS} none none\nkinds: space space space list list"
    path = write(tmp_path / "a.nrrd", simple(array, more), array.tobytes())
    np.testing.assert_array_equal(load(path, time=1, channel=2).data, FIVE[1, ..., 2])


def test_too_many_axes(tmp_path: Path) -> None:
    header = "type: uchar\ndimension: 6\nsizes: 2 2 2 2 2 2\nencoding: raw"
    with pytest.raises(UnsupportedError, match="6 axes"):
        load(write(tmp_path / "a.nrrd", header, bytes(64)))
    header = simple(np.zeros((2, 2, 2, 2, 2), "u1"), "kinds: list time time space space")
    with pytest.raises(UnsupportedError, match="more than one axis"):
        load(write(tmp_path / "a.nrrd", header, bytes(32)))


@pytest.mark.parametrize(
    ("shape", "more", "dims"),
    [
        ((5, 6), "", (6, 5, 1)),
        ((6,), "spacings: 0.5", (6, 1, 1)),
        ((5, 6), "space dimension: 3\nspace directions: (0,2,0) (0,0,3)", (6, 5, 1)),
        (
            (5, 6),
            "space dimension: 2\nspace directions: (2,0) (0,3)\nspace origin: (4,5)",
            (6, 5, 1),
        ),
        ((6,), "space dimension: 3\nspace directions: (0,2,0)", (6, 1, 1)),
        ((5, 6, 1), "kinds: scalar domain domain", (6, 5, 1)),
    ],
)
def test_fewer_dimensions_are_one_sample_thick(
    tmp_path: Path, shape: tuple[int, ...], more: str, dims: tuple[int, int, int]
) -> None:
    array = np.arange(np.prod(shape), dtype="u1").reshape(shape)
    volume = load(write(tmp_path / "a.nrrd", simple(array, more), array.tobytes()))
    assert volume.dims == dims
    np.testing.assert_array_equal(volume.data.ravel(), array.ravel())
    assert any("one sample thick" in w for w in volume.info.warnings)
    assert abs(np.linalg.det(volume.affine)) > 0
