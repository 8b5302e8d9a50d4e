"""RAW files that nothing describes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.ui.test_app import settle
from volviz.app import App
from volviz.app.raw import RawAnswer, raw_question
from volviz.errors import InputError, UsageError


@pytest.fixture
def app(tmp_path):
    app = App(folder=tmp_path / "config")
    yield app
    app.close()


def test_what_is_missing_is_asked_and_the_answer_opens(app, tmp_path):
    data = np.arange(12 * 10 * 8, dtype=">i2").reshape(8, 10, 12)
    file = tmp_path / "unknown.raw"
    file.write_bytes(b"header" + data.tobytes())
    app.open(str(file))
    settle(app)
    assert app.scene is None
    assert not app.messages.all  # the dialog tells
    assert app.raw is not None
    assert app.raw.size == file.stat().st_size
    answer = RawAnswer((12, 10, 8), "int16", "big", 6, (1.0, 1.0, 2.5))
    assert answer.nbytes == app.raw.size
    app.open(str(file), **answer.choices())
    settle(app)
    np.testing.assert_array_equal(app.scene.volume.data, data)
    assert app.scene.volume.spacing == pytest.approx((1.0, 1.0, 2.5))


def test_a_cube_is_guessed(app, tmp_path):
    (tmp_path / "cube.raw").write_bytes(bytes(20**3 * 2))
    app.open(str(tmp_path / "cube.raw"))
    settle(app)
    assert ((20, 20, 20), "uint16") in app.raw.guesses


def test_other_errors_ask_nothing(tmp_path):
    assert raw_question(InputError("no", file=tmp_path, field="shape")) is None
    assert raw_question(UsageError("no", field="shape")) is None
    assert raw_question(UsageError("no", file=tmp_path / "gone", field="shape")) is None
