"""What the commands print: progress, notes, sizes. Everything but data goes to standard error."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

from volviz.errors import safe_text
from volviz.progress import Progress, silent

WIDE = 160
"""Columns of letters where standard output is no terminal; a table that names its rows takes what
it needs there."""
GAP = 2
"""Columns of letters between those of a table."""


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


def table(
    title: str, columns: tuple[str, ...], rows: Iterable[tuple[str, ...]], *, names: int = 0
) -> None:
    """A table on standard output, plain where that is no terminal.

    names: leading columns that say what a row is about. With them, what is wider than the terminal
    goes on below in further columns, after the same names, instead of breaking words.
    """
    from rich.cells import cell_len
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    cells = [[safe_text(cell, 4000) for cell in row] for row in rows]
    wide = [max(map(cell_len, column)) + GAP for column in zip(columns, *cells, strict=True)]
    piped = max(WIDE, sum(wide)) if names else WIDE
    console = Console(width=None if sys.stdout.isatty() else piped)
    for number, part in enumerate(_parts(wide, names, console.width)):
        made = Table(
            title=(title if number == 0 else "") or None,
            box=None,
            pad_edge=False,
            title_justify="left",
            show_header=any(columns),
        )
        for k in part:
            made.add_column(columns[k], overflow="fold")
        for row in cells:
            made.add_row(*(Text(row[k]) for k in part))
        if number:
            console.print()
        console.print(made)


def _parts(wide: list[int], names: int, width: int) -> list[list[int]]:
    """Which columns, so many letters wide each, stand beside each other; the names in each part."""
    if not names:
        return [list(range(len(wide)))]
    room = width - sum(wide[:names]) + GAP  # the last one has nothing to its right
    parts: list[list[int]] = []
    left = -1
    for k in range(names, len(wide)):
        if not parts or wide[k] > left:
            parts.append(list(range(names)))
            left = room
        parts[-1].append(k)
        left -= wide[k]
    return parts or [list(range(names))]
