"""Writing files so that nothing is lost: atomically, and over nothing that was not meant."""

from __future__ import annotations

import errno
import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from volviz.errors import OutputError, UsageError


def path_of(path: str | os.PathLike[str]) -> Path:
    """What was given as a path, as one; UsageError for what is none."""
    if not isinstance(path, str | os.PathLike):
        raise UsageError(
            f"a path is a str or a pathlib.Path, not {type(path).__name__}", field="path"
        )
    return Path(path)


def write_atomically(
    path: str | Path, content: bytes | Callable[[BinaryIO], None], *, overwrite: bool = True
) -> None:
    """Write a file so that it is there whole or not at all; what was there stays on any failure.

    content: the bytes, or a function that writes them into an open file. Raises OutputError.
    """
    check_writable(path, overwrite=overwrite)
    target = followed(path)
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(dir=target.parent, prefix=".", suffix=".part")
        with os.fdopen(handle, "wb") as file:
            if isinstance(content, bytes):
                file.write(content)
            else:
                content(file)
            file.flush()
            os.fsync(file.fileno())
        mask = os.umask(0)
        os.umask(mask)
        os.chmod(temporary, 0o666 & ~mask)
        _put(temporary, target, overwrite)
    except OSError as error:
        raise OutputError(
            f"cannot be written: {error.strerror or error}", file=target, fix=_fix(error)
        ) from error
    finally:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)


def _fix(error: OSError) -> str:
    full = error.errno in (errno.ENOSPC, errno.EDQUOT)
    return "make room there, or choose another place" if full else "choose another place"


def _put(temporary: str, target: Path, overwrite: bool) -> None:
    """Give the finished file its name; one that came meanwhile stays, unless asked."""
    if overwrite:
        os.replace(temporary, target)
        return
    try:
        os.link(temporary, target)
    except FileExistsError as error:
        raise OutputError("exists already", file=target, fix="choose another name") from error
    except OSError:  # a file system without links
        check_writable(target, overwrite=False)
        os.replace(temporary, target)


def check_writable(path: str | Path, *, overwrite: bool = True) -> None:
    """Raise OutputError now rather than after the work, if a file cannot be written there."""
    target = followed(path)
    try:
        there = target.exists()
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or str(error)
        raise OutputError(f"cannot be written: {why}", file=target, fix="change it") from error
    if target.is_dir():
        raise OutputError("is a folder", file=target, fix="give a file name")
    if there and not overwrite:
        raise OutputError("exists already", file=target, fix="give --force to replace it")
    if there and not target.is_file():
        raise OutputError(
            "is not a regular file", file=target, fix="give a file name, or - for standard output"
        )
    if not target.parent.is_dir():
        raise OutputError(
            f"the folder '{target.parent}' does not exist", file=target, fix="make it first"
        )
    if not os.access(target.parent, os.W_OK):
        raise OutputError(
            f"the folder '{target.parent}' may not be written to",
            file=target,
            fix="choose another place",
        )


def followed(path: str | Path) -> Path:
    """Where a symbolic link leads, so that what is written stays behind it; else the path."""
    target = Path(path)
    return Path(os.path.realpath(target)) if os.path.islink(target) else target


def same_file(one: str | Path, other: str | Path) -> bool:
    """True if two paths are one place, there or not."""
    return os.path.realpath(one) == os.path.realpath(other)
