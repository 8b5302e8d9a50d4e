"""`volviz view`: the same scene in a window."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from volviz.cli import show
from volviz.cli.flags import read_options, with_flags
from volviz.cli.render import FLAGS, scene_from

view = typer.Typer(add_completion=False)


@view.command()
@with_flags(FLAGS)
def _view(
    *,
    file: Annotated[
        str, typer.Argument(metavar="FILE", help="file, folder, sample:NAME or .volviz.json")
    ],
    given: dict[str, Any],
) -> None:
    from volviz.ui.window import show as show_window

    with show.progress_bar("reading") as progress:
        options = read_options(given, progress)
        scene = scene_from(file, options, given, 4 / 3)
    show.warnings(scene.volume.info.warnings)
    show_window(scene)
