"""Units of length: short names as files and people write them, and their size."""

from __future__ import annotations

MM: dict[str, float] = {
    "Å": 1e-7,
    "nm": 1e-6,
    "µm": 1e-3,
    "mm": 1.0,
    "cm": 10.0,
    "m": 1000.0,
    "km": 1e6,
    "inch": 25.4,
}
"""Millimetres in one of each."""
SMALL = ("Å", "nm", "µm")
"""Those of things that nobody measures in millimetres."""


def spoken(unit: str | None) -> tuple[str, float]:
    """The unit in which people speak of lengths of a file that has them in `unit` (None: it does
    not say), and how many mm that is: its own one for small things, otherwise mm."""
    if unit is None:
        return "(unit unknown)", 1.0
    return (unit, MM[unit]) if unit in SMALL else ("mm", 1.0)
