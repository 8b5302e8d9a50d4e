"""Names of numbered slices: natural order and gaps in the numbering."""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise

_PARTS = re.compile(r"(\d+)")


def natural_key(name: str) -> tuple[tuple[int, int, str], ...]:
    """A sort key under which "slice2" comes before "slice10", without regard to case."""
    return tuple(
        (1, int(part), "") if part.isdecimal() else (0, 0, part)
        for part in _PARTS.split(name.casefold()[:4096])
        if part
    )


def numbering_gaps(names: Sequence[str]) -> list[int]:
    """Numbers missing from names that differ in just one number, in order; at most 1000 of them.

    Empty where the names are not numbered that way, or by a step other than 1.
    """
    split = [[p for p in _PARTS.split(n) if p] for n in names]
    if len(split) < 3 or len({len(s) for s in split}) != 1:
        return []
    varying = [
        k for k in range(len(split[0])) if len({s[k].lstrip("0") or s[k] for s in split}) > 1
    ]
    if len(varying) != 1 or not all(s[varying[0]].isdecimal() for s in split):
        return []
    numbers = sorted({int(s[varying[0]]) for s in split if len(s[varying[0]]) < 16})
    steps = [b - a for a, b in pairwise(numbers)]
    if not steps or sorted(steps)[len(steps) // 2] != 1:
        return []
    there = set(numbers)
    if numbers[-1] - numbers[0] > 4 * len(numbers) + 1000:
        return []
    return [n for n in range(numbers[0], numbers[-1]) if n not in there][:1000]
