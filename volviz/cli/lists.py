"""`volviz presets` and `volviz samples`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import typer

from volviz.cli import show

presets = typer.Typer(add_completion=False)
samples = typer.Typer(add_completion=False)
AsJson = Annotated[bool, typer.Option("--json", help="print JSON")]


@presets.command()
def _presets(json: AsJson = False) -> None:
    from volviz.classify.own_presets import own
    from volviz.classify.presets import presets as known

    mine = own()
    whose = dict.fromkeys(mine.presets, "you")
    rows = [(p.name, p.group, whose.get(p.name, "volviz"), p.description) for p in known().values()]
    _list(("name", "group", "from", "description"), rows, json)
    show.warnings(map(str, mine.broken.values()))


@samples.command()
def _samples(json: AsJson = False) -> None:
    from volviz.samples import SAMPLES

    rows = [(f"sample:{name}", made.about) for name, made in SAMPLES.items()]
    _list(("name", "description"), rows, json)


def _list(columns: tuple[str, ...], rows: Sequence[tuple[str, ...]], json: bool) -> None:
    if json:
        show.print_json([dict(zip(columns, row, strict=True)) for row in rows])
    else:
        show.table("", columns, rows)
