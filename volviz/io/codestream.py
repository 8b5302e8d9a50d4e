"""The size that a JPEG or JPEG 2000 stream declares, read before a codec allocates for it."""

from __future__ import annotations

import struct

_SOF = {0xC0, 0xC1, 0xC2, 0xC3, 0xC5, 0xC6, 0xC7, 0xC9, 0xCA, 0xCB, 0xCD, 0xCE, 0xCF, 0xF7}


def j2k_size(data: bytes) -> tuple[int, int, int] | None:
    """Rows, columns, components from the SIZ marker (ISO/IEC 15444-1 A.5.1)."""
    at = data.find(b"\xff\x4f\xff\x51", 0, 4096)
    if at < 0 or len(data) < at + 42:
        return None
    width, height, left, top = struct.unpack(">4L", data[at + 8 : at + 24])
    (components,) = struct.unpack(">H", data[at + 40 : at + 42])
    return height - top, width - left, components


def jpeg_size(data: bytes) -> tuple[int, int, int] | None:
    """Rows, columns, components from a JPEG or JPEG-LS frame header (ISO/IEC 10918-1 B.2.2)."""
    if data[:2] != b"\xff\xd8":
        return None
    at = 2
    while at + 10 <= len(data):
        if data[at] != 0xFF:
            return None
        marker = data[at + 1]
        if marker == 0xFF:
            at += 1
            continue
        if marker in _SOF:
            rows, columns = struct.unpack(">HH", data[at + 5 : at + 9])
            return rows, columns, data[at + 9]
        at += 2 + struct.unpack(">H", data[at + 2 : at + 4])[0]
    return None
