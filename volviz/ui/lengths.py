"""Lengths as people read them: in mm where the file says what they are, else as bare numbers."""

from __future__ import annotations

from volviz.model.volume import VolumeInfo


def known(info: VolumeInfo) -> bool:
    """True if the file says how long its lengths are."""
    return info.length_unit is not None


def form(info: VolumeInfo, number: str) -> str:
    """How a number field writes a length. number: "%.4g" or the like."""
    return f"{number} mm" if known(info) else number


def word(info: VolumeInfo) -> str:
    """For the end of a sentence about a length: ", in mm"."""
    return ", in mm" if known(info) else ", in the file's unit, which it does not say"
