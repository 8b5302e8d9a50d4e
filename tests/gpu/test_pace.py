"""How much to draw at once: by what was measured, and never much more than before."""

from __future__ import annotations

import pytest

from volviz.gpu.pace import Pace


def test_it_follows_what_was_measured():
    pace = Pace(1000.0)
    assert pace.amount(0.5) == 500
    pace.took(500, 5.0)  # ten times as dear as thought
    assert pace.amount(0.5) == 50
    pace.took(50, 0.4)
    assert pace.amount(0.5) == pytest.approx(62, abs=1)


def test_what_was_quick_says_little_about_what_follows():
    pace = Pace(1000.0)
    pace.took(10, 0.0)
    assert pace.amount(1.0) == 1500
    assert Pace(0.001).amount() == 1
