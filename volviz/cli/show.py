"""What the commands print: progress, notes, sizes. Everything but data goes to standard error."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from volviz.errors import safe_text
from volviz.progress import Progress, silent


@contextmanager
def progress_bar(what: str, *, quiet: bool = False) -> Iterator[Progress]:
    """A Progress on standard error, if that is a terminal. Ctrl-C goes through as it is."""
    if quiet or not sys.stderr.isatty():
        yield silent()
        return
    from rich.console import Console
    from rich.progress import BarColumn, TextColumn, TimeRemainingColumn
    from rich.progress import Progress as Bar

    columns = (TextColumn("{task.description}"), BarColumn(), TimeRemainingColumn())
    with Bar(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(what, total=1.0)

        def report(fraction: float | None, message: str) -> None:
            bar.update(task, completed=fraction or 0.0, description=safe_text(message or what))

        yield Progress(report)


def note(text: str) -> None:
    """One line for the person, on standard error. Where that takes nothing, work goes on."""
    with suppress(OSError):
        print(f"volviz: {safe_text(text, 2000)}", file=sys.stderr)


def warnings(messages: Iterable[str]) -> None:
    """Warnings, a line each."""
    for message in messages:
        note(f"warning: {message}")


def print_json(data: Any) -> None:
    """Data only, on standard output; as ASCII where that does not speak UTF-8."""
    ascii_only = (sys.stdout.encoding or "").lower().replace("-", "") != "utf8"
    print(json.dumps(data, indent=2, ensure_ascii=ascii_only, allow_nan=False))


def table(title: str, columns: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> None:
    """A table on standard output, plain where that is no terminal."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    made = Table(
        title=title or None,
        box=None,
        pad_edge=False,
        title_justify="left",
        show_header=any(columns),
    )
    for name in columns:
        made.add_column(name, overflow="fold")
    for row in rows:
        made.add_row(*(Text(safe_text(cell, 4000)) for cell in row))
    width = None if sys.stdout.isatty() else 160
    Console(width=width).print(made)
