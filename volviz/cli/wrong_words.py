"""What the parser of the command line did not take, as one line that names the option."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from volviz.errors import did_you_mean, safe_text

_KINDS = {"int": "whole number", "float": "number", "number": "number"}


def told(error: Any, args: Sequence[str], path: str, options: Sequence[Any]) -> str:
    """The line for a parser's error.

    args: as they were given. path: the command as it is typed, e.g. `volviz surface`. options: its
    parameters, as the parser has them (opts, help).
    """
    see = f"see '{path} --help'"
    kind = type(error).__name__
    text = " ".join(error.format_message().split())
    if kind == "NoSuchOption":
        known = [spelling for o in options for spelling in _spellings(o)]
        near = did_you_mean(error.option_name, known) if known else ""
        hint = near if near.startswith("did you mean") else see
        return f"there is no option {error.option_name} — {hint}"
    if kind == "BadOptionUsage" and "require" in text:
        about = next((o.help for o in options if error.option_name in _spellings(o)), None)
        return f"{error.option_name}: a value is missing — {f'{about}; ' if about else ''}{see}"
    if kind == "MissingParameter":
        return f"{_name(error.param)} is missing — {see}"
    given = _given(error, args)
    if kind == "BadParameter" and given is not None:
        wanted = re.search(r"\b(int|float|number)", text)
        if wanted:
            noun = _KINDS[wanted.group(1)]
            return f"{given[0]}: '{safe_text(given[1])}' is not a {noun} — {see}"
    return f"{safe_text(text)} — {see}"


def _spellings(option: Any) -> list[str]:
    return [*getattr(option, "opts", ()), *getattr(option, "secondary_opts", ())]


def _name(parameter: Any) -> str:
    if parameter is None:
        return "something"
    if getattr(parameter, "param_type_name", "") == "argument":
        return str(parameter.metavar or parameter.name.upper())
    return _spellings(parameter)[0]


def _given(error: Any, args: Sequence[str]) -> tuple[str, str] | None:
    """The option that was not taken and its word, the last one given."""
    spelled = _spellings(error.param) if getattr(error, "param", None) is not None else []
    found = None
    for i, word in enumerate(args):
        name, equals, value = word.partition("=")
        if name in spelled and equals:
            found = name, value
        elif word in spelled and i + 1 < len(args):
            found = word, args[i + 1]
    return found
