"""How much to draw at once, so that no draw keeps the window's thread for long."""

from __future__ import annotations

DRAW_SECONDS = 0.015
"""What one draw should take: short beside what a person feels as a halt."""
FASTER = 1.5
"""Of two draws in a row the second is at most so many times as large: what was quick (rows of
background, triangles out of sight) says little about what follows."""


class Pace:
    """Amounts (pixels, indices) by what the ones before took; small while nothing is known.

    per_second: what to begin with.
    """

    def __init__(self, per_second: float) -> None:
        self.per_second = per_second

    def amount(self, seconds: float = DRAW_SECONDS) -> int:
        """As much as takes so long."""
        return max(int(self.per_second * seconds), 1)

    def took(self, amount: int, seconds: float) -> None:
        """So much was drawn in so long."""
        rate = amount / max(seconds, 1e-5)
        self.per_second = min(rate, FASTER * self.per_second)
