"""Every error that a user can cause, and how it is told: one line, what is wrong, how to fix it.

A `VolvizError` names the file, the field, what is wrong and the fix, and carries the exit code
of the command line. The library raises, the command line and the window show; nobody does both.
"""

from __future__ import annotations

import difflib
import unicodedata
from collections.abc import Iterable
from os import PathLike, fspath


class VolvizError(Exception):
    """Base of all errors with a cause that the user can act on.

    Parameters: `what` is wrong, in one sentence without a full stop; `file` and `field` say where;
    `fix` says what to do about it.
    """

    exit_code = 1

    def __init__(
        self,
        what: str,
        *,
        file: str | PathLike[str] | None = None,
        field: str | None = None,
        fix: str | None = None,
    ) -> None:
        self.what = what
        self.file = None if file is None else fspath(file)
        self.field = field
        self.fix = fix
        super().__init__(str(self))

    def __str__(self) -> str:
        where = [safe_text(part) for part in (self.file, self.field) if part]
        text = ": ".join([*where, safe_text(self.what)])
        return f"{text} — {safe_text(self.fix)}" if self.fix else text


class UsageError(VolvizError):
    """A wrong name, flag or value from the user."""

    exit_code = 2


class InputError(VolvizError):
    """A file that is missing, broken or not what it says it is."""

    exit_code = 3


class UnsupportedError(VolvizError):
    """A valid file that volviz does not read (yet), or not without an extra package."""

    exit_code = 4


class GraphicsError(VolvizError):
    """No usable OpenGL, or an OpenGL call that failed."""

    exit_code = 5


class LimitError(VolvizError):
    """The work needs more memory than the stated limit or than the machine has."""

    exit_code = 6


class OutputError(VolvizError):
    """A result that could not be written. What was there before is still there."""

    exit_code = 7


class Cancelled(VolvizError):
    """The user stopped the work."""

    exit_code = 130

    def __init__(self, what: str = "cancelled") -> None:
        super().__init__(what)


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """A sentence that helps with an unknown name: the nearest one, or all of them."""
    names = sorted(known)
    folded = {n.casefold(): n for n in names}
    near = difflib.get_close_matches(name.casefold(), folded, n=1, cutoff=0.55)
    if near:
        return f"did you mean '{folded[near[0]]}'?"
    listed = ", ".join(names[:40]) + (" …" if len(names) > 40 else "")
    return f"choose one of: {listed}" if names else "there is nothing to choose from"


def safe_text(text: object, limit: int = 400) -> str:
    """Text from a file or a path, fit for a terminal line: no control or direction characters."""
    shown = str(text)[: limit + 1]
    if not shown.isprintable():  # what is printable has none of these: panels ask every frame
        shown = "".join(
            c if unicodedata.category(c) not in ("Cc", "Cf", "Cs", "Zl", "Zp") else "�"
            for c in shown
        )
    return shown if len(shown) <= limit else shown[:limit] + "…"
