"""Numbers for people."""

from __future__ import annotations


def binary_size(nbytes: float) -> str:
    """A count of bytes for people: 3.6 PiB, 64 MiB, 512 B."""
    size, units = (
        float(min(nbytes, 1 << 1000)),
        ["B", "KiB", "MiB", "GiB", "TiB", "PiB", "EiB", "ZiB", "YiB"],
    )
    while size >= 1024 and len(units) > 1:
        size /= 1024
        units.pop(0)
    digits = 0 if size >= 100 or size == int(size) else 1
    return f"{size:.{digits}f} {units[0]}"
