"""`volviz view`: the desktop window, at once; what is asked for is read while it is open."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from typing import Annotated, Any

import typer

from volviz.cli.flags import read_options, with_flags
from volviz.cli.render import FLAGS, scene_from
from volviz.errors import GraphicsError, UsageError
from volviz.progress import Progress

view = typer.Typer(add_completion=False)


@view.command()
@with_flags(FLAGS)
def _view(
    *,
    files: Annotated[
        list[str] | None,
        typer.Argument(metavar="[FILE]...", help="file, folder, sample:NAME or .volviz.json"),
    ] = None,
    given: dict[str, Any],
) -> None:
    show_window(files or [], given)


def show_window(files: list[str], given: dict[str, Any]) -> None:
    """Open the window with these files (none: the welcome) and the flags that were given."""
    check_display()
    from volviz.app import App
    from volviz.app.opening import Making, Offer, absolute, offer_of, prepared
    from volviz.model.scene import SceneState
    from volviz.sources import is_sample
    from volviz.ui.window import show

    app = App()
    if not given:
        _check_there(files)
        show(names=files, app=app)
        return
    if not files:
        files = ["sample:ct-head"]
    name = absolute(files[0])

    def making(flags: dict[str, Any]) -> Making:
        def make(progress: Progress) -> SceneState | Offer:
            options = dict(flags)
            reading = read_options(options, progress.part(0.0, 0.7))
            try:
                scene = scene_from(files[0], reading, options, app.aspect)
            except UsageError as error:
                if error.field != "series" or reading.series is not None:
                    raise
                # the window asks which, and the flags hold for the answer
                return replace(offer_of(name, progress), again=again)
            return prepared(scene, app.limits, progress.part(0.7, 1.0))

        def again(choices: dict[str, Any]) -> Making:
            return making({**flags, **choices})

        return make

    if not is_sample(files[0]):
        _check_there(files[:1])
    show(load=(name, making(given)), app=app)


def check_display() -> None:
    """Raise GraphicsError where no window can be, before anything is read."""
    if not has_display():
        raise GraphicsError(
            "no window can be opened: there is no display",
            fix="use 'volviz render' to draw to a file",
        )


def has_display() -> bool:
    """False on Linux and its kin without X and Wayland."""
    if sys.platform in ("win32", "darwin"):
        return True
    return bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))


def _check_there(files: list[str]) -> None:
    """A mistyped name is told where it was typed, not in a window."""
    from pathlib import Path

    from volviz.io import check_readable
    from volviz.sources import is_sample

    for name in files:
        if not is_sample(name):
            check_readable(Path(name))
