"""The user's choice of one time and one channel, and what the reader says about it; short names."""

from __future__ import annotations

import re
from pathlib import Path

from volviz.errors import UsageError

_SUFFIX = re.compile(
    r"\.(seg\.nrrd|nrrd|nhdr|mha|mhd|nii\.gz|nii|hdr\.gz|img\.gz|hdr|img|raw\.gz|raw)$", re.I
)
_MODALITY = {"MRI": "MR", "PET": "PT", "SPECT": "NM", "ULTRASOUND": "US", "XRAY": "CR"}


def chosen_index(wanted: int, count: int, *, what: str, file: Path) -> int:
    """The index if the file has it, counted from 0. Raises UsageError."""
    if not 0 <= wanted < count:
        raise UsageError(
            f"there is no {what} {wanted}; the file has {count}",
            file=file,
            field=what,
            fix=f"choose 0 to {count - 1}" if count > 1 else f"leave out --{what}",
        )
    return wanted


def choice_note(count: int, index: int, *, what: str) -> tuple[str, ...]:
    """A warning that only one of several is shown."""
    if count < 2:
        return ()
    return (f"{what} {index} of {count} ({what}s 0 to {count - 1}; choose with --{what})",)


def title_of(path: Path) -> str:
    """The file's name without its suffixes."""
    return _SUFFIX.sub("", path.name)


def modality_code(text: str | None) -> str | None:
    """DICOM's code of a modality from a header's words, None if it says nothing known."""
    word = (text or "").strip().upper().removeprefix("MET_MOD_")
    word = _MODALITY.get(word, word)
    known = {"CT", "MR", "PT", "NM", "US", "CR", "DX", "MG", "XA", "RF", "OT", "OCT", "OPT", "SEG"}
    return word if word in known else None
