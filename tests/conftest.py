"""Shared fixtures: the folder of real volumes, seeds, and the golden switch."""

from __future__ import annotations

import os
import signal
import tempfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

settings.register_profile("volviz", deadline=None)  # a busy machine is no fault
settings.load_profile("volviz")

# the presets and settings of whoever runs the tests are no part of them
_own = tempfile.TemporaryDirectory(prefix="volviz-tests-")
os.environ["VOLVIZ_CONFIG_DIR"] = _own.name

# in the background of a shell, interrupts are ignored, also by the programs that tests start
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT.parent / "shared" / "data"


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption(
        "--regenerate-golden", action="store_true", help="write the golden pictures anew"
    )


@pytest.fixture(scope="session")
def data() -> Path:
    if not DATA.is_dir():
        pytest.skip("the folder of real volumes (../shared/data) is not here")
    return DATA


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20261122)
