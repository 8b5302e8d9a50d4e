"""Where the shaders and the assets are. Only this file knows.

In a checkout (pyproject.toml beside the package) they are the top-level folders `shaders/` and
`assets/`; in an installed wheel they are copies under `volviz/_data/`. The checkout wins: an
editable install may leave a stale copy in site-packages.
"""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from pathlib import Path

from volviz.errors import InputError, UsageError, did_you_mean

_PACKAGE = Path(__file__).resolve().parent


def checkout() -> Path | None:
    """The folder of the checkout that this package runs from, or None in an installed wheel."""
    root = _PACKAGE.parent
    return root if (root / "pyproject.toml").is_file() and (root / "shaders").is_dir() else None


@cache
def _folder(name: str) -> Path:
    root = checkout()
    folder = _PACKAGE / "_data" / name if root is None else root / name
    if not folder.is_dir():
        raise InputError(
            f"the folder of volviz's {name} is missing", file=folder, fix="install volviz again"
        )
    return folder


def shader_dir() -> Path:
    """The folder of the GLSL sources. InputError if the install lacks it."""
    return _folder("shaders")


def asset_dir() -> Path:
    """The folder of the assets (icons, fonts, presets). InputError if the install lacks it."""
    return _folder("assets")


def asset(name: str) -> Path:
    """The path of one asset, e.g. "icon.png". UsageError for a name that is not there."""
    folder = asset_dir()
    path = (folder / name).resolve()
    if path.is_relative_to(folder.resolve()) and path.is_file():
        return path
    known = (p.relative_to(folder).as_posix() for p in folder.rglob("*") if p.is_file())
    raise UsageError(f"unknown asset '{name}'", fix=did_you_mean(name, known))


def font(*, bold: bool = False) -> Path | None:
    """A font with Greek, µ, °, Å, ×, −, ² (Roboto, Apache 2.0); None where its package lacks it.

    It comes with imgui-bundle, which is not imported for it.
    """
    spec = find_spec("imgui_bundle")
    name = f"assets/fonts/Roboto/Roboto-{'Bold' if bold else 'Regular'}.ttf"
    folders = (spec.submodule_search_locations or []) if spec is not None else []
    return next((p for p in (Path(f) / name for f in folders) if p.is_file()), None)
