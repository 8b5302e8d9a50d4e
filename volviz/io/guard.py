"""Whatever a format's library raises becomes one of our errors, naming the file."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from volviz.errors import InputError, LimitError, VolvizError


@contextmanager
def library_errors(path: Path, explain: Callable[[Exception], VolvizError]) -> Iterator[None]:
    """Run a library on an untrusted file, its warnings silent.

    Our own errors pass; what runs out of memory or cannot be read is said alike for all formats;
    `explain` turns the rest, which may be nearly any built-in type, into an error with a fix.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except VolvizError:
        raise
    except MemoryError as error:
        raise LimitError(
            "the machine has not enough memory for this file", file=path, fix="close other programs"
        ) from error
    except Exception as error:
        if _too_deep(error):
            raise InputError(
                "structures are nested too deeply", file=path, fix="the file is broken or hostile"
            ) from error
        if isinstance(error, OSError) and error.strerror:
            raise InputError(
                error.strerror, file=path, fix="check the file and its disk"
            ) from error
        raise explain(error) from error


def _too_deep(error: BaseException | None) -> bool:
    """A library may have caught the RecursionError and raised something of its own."""
    for _ in range(8):
        if error is None or isinstance(error, RecursionError):
            break
        error = error.__cause__ or error.__context__
    return isinstance(error, RecursionError)
