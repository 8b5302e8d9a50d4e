"""Names of sample types as files and people write them, and the type a volume is delivered in."""

from __future__ import annotations

import re
from typing import Any

import numpy as np

_SPELLINGS = {
    "u1": "uint8 u8 uchar ubyte byte unsignedchar unsignedbyte uint8t 8bit",
    "i1": "int8 i8 char schar sbyte signedchar int8t",
    "u2": "uint16 u16 ushort unsignedshort word uint16t 16bit ushort12",
    "i2": "int16 i16 short sshort signedshort int16t",
    "u4": "uint32 u32 uint unsignedint unsigned dword uint32t",
    "i4": "int32 i32 int sint signedint int32t",
    "u8": "uint64 u64 ulong ulonglong unsignedlong uint64t",
    "i8": "int64 i64 long longlong signedlong int64t",
    "f2": "float16 f16 half",
    "f4": "float32 f32 float single real 32bit",
    "f8": "float64 f64 double 64bit",
}
SAMPLE_TYPES = {word: code for code, words in _SPELLINGS.items() for word in words.split()}
"""Spelling in lower case, without blanks and underscores, to numpy's code without byte order."""

COMMON = ("uint8", "int8", "uint16", "int16", "uint32", "int32", "float32", "float64")
"""The names that a message offers."""


def sample_type(text: str) -> np.dtype[Any] | None:
    """The type that a word means ("ushort", "UINT8", "float32"), in native order; None if none."""
    word = re.sub(r"[\s_]+", "", text.strip().lower())
    code = SAMPLE_TYPES.get(word)
    return None if code is None else np.dtype(code)


def delivered(dtype: np.dtype[Any]) -> np.dtype[Any]:
    """The type of a volume's samples: bool to uint8, half to float32, long double to double."""
    if dtype.kind == "b":
        return np.dtype(np.uint8)
    if dtype.kind == "f" and dtype.itemsize == 2:
        return np.dtype(np.float32)
    return np.dtype(np.float64) if dtype.itemsize > 8 else dtype.newbyteorder("=")
