"""`volviz doctor`: which OpenGL there is and what it can do."""

from __future__ import annotations

from typing import Annotated

import typer

from volviz.cli import show

doctor = typer.Typer(add_completion=False)


@doctor.command()
def _doctor(json: Annotated[bool, typer.Option("--json", help="print JSON")] = False) -> None:
    from volviz.doctor import as_text, report

    facts = report()
    if json:
        show.print_json(facts)
    else:
        print(as_text(facts))
    if not facts["usable"]:
        raise typer.Exit(5)
