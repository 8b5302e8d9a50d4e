"""Data in files beside their header: which names are allowed, and lists and patterns of names.

A header may only name regular files in its own folder or below, after symbolic links are
resolved, unless the user allows one more folder.
"""

from __future__ import annotations

import re
import stat
from pathlib import Path, PureWindowsPath

from volviz.errors import InputError, safe_text

_URL = re.compile(r"[A-Za-z][A-Za-z0-9+.\-]*://|file:", re.IGNORECASE)
_FORMAT = re.compile(r"%([-+ 0#]*)(\d{0,3})(?:\.(\d{1,2}))?[dui]")


def resolve_sibling(
    header: Path, name: str, *, field: str, allow_outside: Path | None = None
) -> Path:
    """The data file that a header names, resolved; nothing is opened.

    Backslashes count as separators, percent-encodings are taken literally. Raises InputError for
    a name that leads out of the header's folder (and of `allow_outside`), is missing, or is no
    regular file.
    """
    if not name or "\0" in name:
        raise _unusable(header, field, "the name of the data file is empty or not a name")
    if _URL.match(name) or PureWindowsPath(name).drive:
        raise _outside(header, name, field)
    shown = safe_text(name, 80)
    try:
        root = header.resolve().parent
        path = (root / name.replace("\\", "/")).resolve()
        roots = [root] if allow_outside is None else [root, allow_outside.resolve()]
        if not any(path.is_relative_to(r) for r in roots):
            raise _outside(header, name, field)
        mode = path.stat().st_mode
    except (FileNotFoundError, NotADirectoryError) as error:
        raise InputError(
            f"the data file is missing; expected {safe_text(path)}",
            file=header,
            field=field,
            fix="put it there, or correct the name in the header (was it moved or renamed?)",
        ) from error
    except (OSError, RuntimeError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise _unusable(header, field, f"cannot use the data file '{shown}': {reason}") from error
    if not stat.S_ISREG(mode):
        raise _unusable(header, field, f"'{shown}' is not a regular file")
    return path


def expand_pattern(
    pattern: str, first: int, last: int, step: int, *, file: Path, field: str, most: int
) -> list[str]:
    """The names that a printf pattern such as `slice%03d.raw` gives for first, first+step, … last.

    The pattern is read as text, never handed to a formatter that could do more than numbers.
    """
    pieces = list(_FORMAT.finditer(pattern))
    if len(pieces) != 1 or "%" in pattern.replace(pieces[0].group(), "", 1).replace("%%", ""):
        raise InputError(
            f"'{safe_text(pattern, 80)}' is no pattern with one number",
            file=file,
            field=field,
            fix="write it like slice%03d.raw",
        )
    if step == 0 or (last - first) * step < 0:
        raise InputError(
            f"from {first} to {last} in steps of {step} never arrives",
            file=file,
            field=field,
            fix="give first, last and a step that leads from one to the other",
        )
    count = (last - first) // step + 1
    if count > most:
        raise InputError(
            f"{count} data files are more than {most}",
            file=file,
            field=field,
            fix="check the range",
        )
    found = pieces[0]
    before = pattern[: found.start()].replace("%%", "%")
    after = pattern[found.end() :].replace("%%", "%")
    form = found.group()[:-1] + "d"
    return [before + form % (first + i * step) + after for i in range(count)]


def _outside(header: Path, name: str, field: str) -> InputError:
    return InputError(
        f"the data file '{safe_text(name, 80)}' lies outside the header's folder",
        file=header,
        field=field,
        fix="put it beside the header, or allow its folder with --allow-outside DIR",
    )


def _unusable(header: Path, field: str, what: str) -> InputError:
    return InputError(what, file=header, field=field, fix="name a file beside the header")
