"""One list of facts: `volviz info` and the Data panel say the same words."""

from __future__ import annotations

import numpy as np
import pytest

from volviz.cli.info import _lines, facts_of
from volviz.fields.facts import header_facts, odd_counts, range_text
from volviz.fields.statistics import statistics
from volviz.io.options import ReadOptions
from volviz.model.volume import Volume
from volviz.sources import open_volume
from volviz.ui.facts import Facts
from volviz.ui.panels import data


@pytest.mark.parametrize("name", ["sample:marschner-lobb", "odd"])
def test_both_say_the_same(name, tmp_path):
    if name == "odd":
        values = np.array([[[np.nan, 1.0, np.inf, -5.0]] * 3] * 2, np.float32)
        np.save(tmp_path / "odd.npy", values)
        name = str(tmp_path / "odd.npy")
    facts, known, values = facts_of(name, ReadOptions(), scan=True)
    printed = dict(_lines(facts, known, values))
    volume = open_volume(name)
    shown = {n.lower(): t for n, t in data.rows(volume, Facts(statistics=values))}
    for fact, text in header_facts(volume.info).items():
        if text and fact != "size":
            assert printed[fact] == shown[fact] == text
    assert printed["values"].startswith(shown["values"])


def test_what_is_said_of_values():
    values = np.array([[[np.nan, 1.5, np.inf, -5.0, 4.0]]])
    volume = Volume.from_array(values, padding=-5.0, value_unit="HU", length_unit=None)
    found = statistics(volume)
    assert range_text(found, volume.info) == "1.5 … 4 HU"
    assert odd_counts(found) == {"NaN": 1, "infinite": 1, "padding": 1}
    text = header_facts(volume.info)
    assert text["spacing"] == "1 × 1 × 1 (unit unknown)"
    assert text["samples"] == "5 × 1 × 1"
    assert text["orientation"] == "unknown"
    small = Volume.from_array(values, spacing=(2.5e-4, 2.5e-4, 1e-3), length_unit="µm")
    text = header_facts(small.info)
    assert text["spacing"] == "0.25 × 0.25 × 1 µm"
    assert text["size"] == "1.25 × 0.25 × 1 µm"
    empty = Volume.from_array(np.full((1, 1, 2), np.nan))
    assert range_text(statistics(empty), empty.info) == "none that is finite"
