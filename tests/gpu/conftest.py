"""The OpenGL context of the test run, opened once."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from volviz.gpu.checked import Gpu
from volviz.gpu.contexts import close_shared, shared_gpu

Write = Callable[..., None]


@pytest.fixture(scope="session")
def gpu() -> Iterator[Gpu]:
    yield shared_gpu()
    close_shared()


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Writes shader files: `lib__a="text"` is lib/a.glsl, `main_v` is main_v.vert."""

    def write(**files: str) -> None:
        for name, text in files.items():
            path = tmp_path / name.replace("__", "/")
            path = path.with_suffix(".vert" if name == "main_v" else path.suffix or ".glsl")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(text, encoding="utf-8")

    return write
