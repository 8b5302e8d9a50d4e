from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from volviz import resources
from volviz.errors import InputError, UsageError

ROOT = Path(__file__).resolve().parent.parent


@pytest.fixture
def wheel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A package folder as a wheel installs it, in use until the test ends."""
    package = tmp_path / "site-packages" / "volviz"
    for name in ("shaders", "assets"):
        (package / "_data" / name).mkdir(parents=True)
    monkeypatch.setattr(resources, "_PACKAGE", package)
    resources._folder.cache_clear()
    yield package
    resources._folder.cache_clear()


def test_checkout_is_preferred() -> None:
    if not (ROOT / "pyproject.toml").is_file() or resources.checkout() is None:
        pytest.skip("the tests run against an installed wheel")
    assert resources.checkout() == ROOT
    assert resources.shader_dir() == ROOT / "shaders"
    assert resources.asset_dir() == ROOT / "assets"


def test_wheel_has_its_own_copies(wheel: Path) -> None:
    assert resources.checkout() is None
    assert resources.shader_dir() == wheel / "_data" / "shaders"
    assert resources.asset_dir() == wheel / "_data" / "assets"


def test_stale_copy_loses_against_the_checkout(wheel: Path) -> None:
    (wheel.parent / "pyproject.toml").touch()
    (wheel.parent / "shaders").mkdir()
    assert resources.shader_dir() == wheel.parent / "shaders"


def test_broken_install_is_told(wheel: Path) -> None:
    (wheel / "_data" / "shaders").rmdir()
    with pytest.raises(InputError, match="install volviz again"):
        resources.shader_dir()


def test_asset_by_name(wheel: Path) -> None:
    (wheel / "_data" / "assets" / "icon.png").touch()
    (wheel / "secret.txt").touch()
    assert resources.asset("icon.png") == wheel / "_data" / "assets" / "icon.png"
    with pytest.raises(UsageError, match=r"did you mean 'icon\.png'"):
        resources.asset("icno.png")
    with pytest.raises(UsageError):
        resources.asset("../../secret.txt")
