"""The OpenGL context of the test run, opened once."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

from volviz.gpu.checked import Gpu
from volviz.gpu.contexts import close_shared, shared_gpu


@pytest.fixture(scope="session")
def gpu() -> Iterator[Gpu]:
    yield shared_gpu()
    close_shared()
