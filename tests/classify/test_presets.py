"""Preset files: complete, valid, right on materials of known density; broken ones are told."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from volviz.classify.hounsfield import HOUNSFIELD
from volviz.classify.presets import apply, fit_warning, load_preset, preset, presets
from volviz.errors import InputError, UsageError
from volviz.fields.statistics import statistics
from volviz.model.scene import Light, Raycast
from volviz.model.transfer import TransferFunction
from volviz.model.volume import Volume

# the names people know from 3D Slicer, and those that the issue adds
KNOWN = [
    "CT-AAA", "CT-AAA2", "CT-Bone", "CT-Bones", "CT-Cardiac", "CT-Cardiac2", "CT-Cardiac3",
    "CT-Chest-Contrast-Enhanced", "CT-Chest-Vessels", "CT-Coronary-Arteries",
    "CT-Coronary-Arteries-2", "CT-Coronary-Arteries-3", "CT-Cropped-Volume-Bone", "CT-Fat",
    "CT-Liver-Vasculature", "CT-Lung", "CT-MIP", "CT-Muscle", "CT-Pulmonary-Arteries",
    "CT-Soft-Tissue", "CT-Air", "CT-X-ray", "MR-Angio", "MR-Default", "MR-MIP", "MR-T2-Brain",
    "DTI-FA-Brain", "US-Fetal", "uCT-Bone-8bit", "uCT-Bone-16bit", "uCT-Skull", "ct-skin",
    "ct-head", "ct-kidneys", "ct-brain", "mr-t1-brain", "hounsfield", "gray", "smoke", "fire",
    "viridis",
]  # fmt: skip

TISSUES = {"air": -1000, "fat": -90, "water": 0, "brain": 35, "muscle": 55, "spongy": 250,
           "compact": 1200, "enamel": 2600}  # fmt: skip


def phantom() -> Volume:
    """A block of each material in air."""
    array = np.full((10, 20, 40), -1000, np.int16)
    for i, value in enumerate(TISSUES.values()):
        array[2:8, 4:16, 5 * i : 5 * i + 4] = value
    return Volume.from_array(array, modality="CT", value_unit="HU")


def fitted(name: str) -> TransferFunction:
    volume = phantom()
    return apply(preset(name), volume, statistics(volume))[0]


@pytest.mark.parametrize("name", KNOWN)
def test_names_that_people_know(name: str) -> None:
    assert preset(name).name == name.lower()
    assert preset(name.replace("-", "_").upper()) is preset(name)


@pytest.mark.parametrize("name", list(presets()))
def test_every_preset(name: str) -> None:
    found = presets()[name]
    transfer = found.transfer()
    assert found.name == name
    assert name == name.lower()
    assert found.title
    assert found.description.endswith(".")
    assert 0 < max(a for _, a in transfer.opacities) <= 1
    assert transfer.opacity_at(-3024 if found.axis == "hu" else -1) == 0
    assert transfer.table_size(integers=True) <= 65536
    if found.axis == "relative":
        assert -0.1 <= transfer.domain[0] < transfer.domain[1] <= 1.2
    knobs = found.knobs()
    ray = {k: v for k, v in knobs.items() if k in Raycast.__dataclass_fields__}
    Raycast(**ray)
    Light(**{k: v for k, v in knobs.items() if k not in ray})


def test_each_material_gets_its_color() -> None:
    transfer = fitted("hounsfield")
    for material in HOUNSFIELD:
        np.testing.assert_allclose(
            transfer.color_at(material.middle), material.rgb, atol=1e-9, err_msg=material.name
        )
    assert transfer.opacity_at(-1000) == 0
    rising = [transfer.opacity_at(v) for v in (-90, 55, 250, 1200, 2600)]
    assert rising == sorted(rising)


def test_bone_is_bone() -> None:
    transfer = fitted("ct-bone")
    for soft in ("air", "fat", "water", "brain", "muscle"):
        assert transfer.opacity_at(TISSUES[soft]) == 0
    assert transfer.opacity_at(250) > 0.1
    assert transfer.opacity_at(1200) > 0.85
    red, green, blue = transfer.color_at(1000)
    assert red > green > blue > 0.7  # ivory


def test_soft_things_are_seen_by_their_presets() -> None:
    assert fitted("ct-fat").opacity_at(TISSUES["fat"]) > 0.05
    assert fitted("ct-fat").opacity_at(TISSUES["muscle"]) == 0
    muscle = fitted("ct-muscle")
    assert muscle.opacity_at(TISSUES["muscle"]) > 20 * muscle.opacity_at(TISSUES["fat"])
    assert fitted("ct-lung").opacity_at(-450) > fitted("ct-lung").opacity_at(TISSUES["muscle"])
    assert fitted("ct-air").opacity_at(-780) > 0.1
    head = fitted("ct-head")
    assert 0 < head.opacity_at(-300) < 0.1
    assert head.opacity_at(800) > 0.5
    assert fitted("ct-skin").opacity_at(0) > 0.8


def test_hounsfield_presets_follow_raw_numbers(rng: np.random.Generator) -> None:
    array = np.concatenate([rng.normal(24, 8, 30000), rng.normal(1074, 15, 20000), [3000] * 14])
    array = np.clip(array, 0, 4095).astype(np.uint16)
    volume = Volume.from_array(array.reshape(2, 1, -1), modality="CT")
    facts = statistics(volume)
    transfer, _ = apply(preset("ct-bone"), volume, facts)
    assert transfer.opacity_at(1074) == 0
    assert transfer.opacity_at(1200 + 1024) > 0.85
    warning = fit_warning(preset("ct-bone"), volume, facts)
    assert warning is not None
    assert "1024" in warning


def test_hounsfield_presets_on_other_data(rng: np.random.Generator) -> None:
    array = np.concatenate([rng.integers(0, 4, 30000), rng.normal(90, 8, 20000), [220] * 200])
    volume = Volume.from_array(array.astype(np.uint8).reshape(2, 1, -1))
    facts = statistics(volume)
    transfer, _ = apply(preset("ct-bone"), volume, facts)
    assert transfer.opacity_at(90) < 0.05
    assert transfer.opacity_at(220) > 0.5
    assert "not in Hounsfield units" in (fit_warning(preset("ct-bone"), volume, facts) or "")
    assert fit_warning(preset("mr-default"), volume, facts) is None
    hu = phantom()
    assert fit_warning(preset("ct-bone"), hu, statistics(hu)) is None


def test_relative_presets_follow_the_volume(rng: np.random.Generator) -> None:
    array = np.concatenate([np.abs(rng.normal(0, 4, 30000)), rng.normal(400, 40, 20000)])
    facts = {}
    for factor in (1.0, 7.0):
        volume = Volume.from_array((factor * array).reshape(5, 100, 100))
        facts[factor] = apply(preset("mr-default"), volume, statistics(volume))[0]
    assert facts[1.0].opacity_at(2) == 0
    assert facts[1.0].opacity_at(400) > 0.3
    np.testing.assert_allclose(
        facts[7.0].opacity_at(7 * array[::999]), facts[1.0].opacity_at(array[::999]), atol=0.02
    )


def test_unit_distance_follows_the_size() -> None:
    array = np.arange(1000, dtype=np.float32).reshape(10, 10, 10)
    units = []
    for step in (1e-6, 1.0, 1e6):  # nanometres, millimetres, kilometres
        volume = Volume.from_array(array, spacing=(step,) * 3)
        units.append(apply(preset("gray"), volume, statistics(volume))[0].unit_distance / step)
    np.testing.assert_allclose(units, units[1])
    volume = Volume.from_array(array, spacing=(1e-3,) * 3)
    assert apply(preset("ct-bone"), volume, statistics(volume))[0].unit_distance == 1


def test_labels_keep_nearest(rng: np.random.Generator) -> None:
    volume = Volume.from_array(rng.integers(0, 4, (4, 4, 4)).astype(np.uint8), kind="labels")
    assert apply(preset("gray"), volume, statistics(volume))[1]["interpolation"] == "nearest"


def test_unknown_name() -> None:
    with pytest.raises(UsageError, match="did you mean 'ct-bone'"):
        preset("ct-bonne")


def good() -> dict[str, Any]:
    return {
        "name": "mine", "title": "Mine", "group": "Any", "description": "Mine.", "axis": "relative",
        "colors": [[0, "#000000"], [1, "#ffffff"]], "opacities": [[0, 0], [1, 0.5]],
    }  # fmt: skip


def test_own_file(tmp_path: Path) -> None:
    file = tmp_path / "mine.json"
    file.write_text(json.dumps(good()))
    assert preset(str(file)).name == "mine"
    assert load_preset(file).transfer().opacity_at(1) == 0.5


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ({"opacities": [[0, 0], [1, 1.5]]}, "opacities"),
        ({"opacities": [[1, 0], [0, 1]]}, "opacities"),
        ({"opacities": []}, "opacities"),
        ({"opacities": [[0]]}, "opacities"),
        ({"opacities": "all"}, "opacities"),
        ({"colors": [[0, "red"]]}, "colors"),
        ({"colors": [[0, 5]]}, "colors"),
        ({"axis": "kelvin"}, "axis"),
        ({"mode": "xray"}, "mode"),
        ({"unit_distance": 0}, "unit_distance"),
        ({"light": {"ambient": 99}}, "ambient"),
        ({"light": {"shine": 1}}, "light"),
        ({"colour": []}, "colour"),
        ({"name": None}, "name"),
    ],
)
def test_broken_files(tmp_path: Path, change: dict[str, Any], field: str) -> None:
    file = tmp_path / "mine.json"
    file.write_text(json.dumps({**good(), **change}))
    with pytest.raises(InputError) as told:
        load_preset(file)
    assert told.value.exit_code == 3
    assert "mine.json" in str(told.value)
    assert field in str(told.value)


@pytest.mark.parametrize("content", [b"", b"{", b"[]", b"\xff\xfe", b"[" * 5000, b'{"a": 1}'])
def test_no_json(tmp_path: Path, content: bytes) -> None:
    file = tmp_path / "mine.json"
    file.write_bytes(content)
    with pytest.raises(InputError):
        preset(file)


def test_missing_and_huge_files(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"nothing\.json"):
        preset(tmp_path / "nothing.json")
    file = tmp_path / "huge.json"
    file.write_bytes(b" " * (2 << 20))
    with pytest.raises(InputError, match="too large"):
        preset(file)
