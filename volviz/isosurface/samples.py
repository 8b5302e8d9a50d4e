"""The samples of a volume as bytes, so that kernels that seldom look at them are compiled once.

Compiling marching cubes takes seconds, and there are ten kinds of samples. Only what looks at many
of them is compiled for each kind.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numba
import numpy as np
from llvmlite import ir
from numba.extending import intrinsic, overload
from numpy.typing import NDArray

from volviz.compiled import hot

UNSIGNED, SIGNED, FLOAT = 0, 1, 2
_KINDS = {"u": UNSIGNED, "i": SIGNED, "f": FLOAT}


class Samples(NamedTuple):
    """bytes: uint8[n], of the samples in C order. shape: samples along z, y, x. size: bytes of
    one; kind: UNSIGNED, SIGNED or FLOAT."""

    bytes: NDArray[np.uint8]
    shape: tuple[int, int, int]
    size: int
    kind: int


def samples(data: NDArray[Any]) -> Samples:
    """Of a C-contiguous array [z, y, x] of 1 to 8 byte integers or 4 or 8 byte floats."""
    nz, ny, nx = data.shape
    flat = data.reshape(-1).view(np.uint8)
    return Samples(flat, (nz, ny, nx), data.dtype.itemsize, _KINDS[data.dtype.kind])


@intrinsic
def eight_bytes(context: Any, octets: Any, at: Any) -> Any:
    """The bytes at..at + 8 of a flat array as a uint64, the first one lowest; all must be there."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.load(_place(context, builder, signature, arguments, 64), align=1)

    return numba.types.uint64(octets, numba.types.uint64), generate


@intrinsic
def some_bytes(context: Any, octets: Any, at: Any, size: Any) -> Any:
    """The 1, 2, 4 or 8 bytes from `at` on, as a uint64 whose other bits are 0."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        after = builder.append_basic_block("after")
        blocks = {n: builder.append_basic_block(f"bytes{n}") for n in (1, 2, 4, 8)}
        choice = builder.switch(arguments[2], blocks[8])
        for n in (1, 2, 4):
            choice.add_case(ir.Constant(word, n), blocks[n])
        found = []
        for n, block in blocks.items():
            builder.position_at_end(block)
            value = builder.load(_place(context, builder, signature, arguments, 8 * n), align=1)
            found.append((builder.zext(value, word) if n < 8 else value, block))
            builder.branch(after)
        builder.position_at_end(after)
        result = builder.phi(word)
        for value, block in found:
            result.add_incoming(value, block)
        return result

    return numba.types.uint64(octets, numba.types.uint64, numba.types.int64), generate


def _place(context: Any, builder: Any, signature: Any, arguments: Any, bits: int) -> Any:
    array = context.make_array(signature.args[0])(context, builder, value=arguments[0])
    begin = builder.gep(array.data, [arguments[1]])
    return builder.bitcast(begin, ir.IntType(bits).as_pointer())


def number_in(word: Any, shift: Any, like: Any) -> Any:
    """For kernels: what the lowest 64 − shift bits of a word say, as float64.

    like: a float32, float64, int64 or uint64, as which they are meant.
    """
    raise NotImplementedError


@overload(number_in, jit_options={"forceinline": True, "_nrt": False})
def _number_in(word: Any, shift: Any, like: Any) -> Any:
    if isinstance(like, numba.types.Float):
        return _single if like.bitwidth == 32 else _double
    return _signed if like.signed else _unsigned


def _single(word: Any, shift: Any, like: Any) -> Any:
    return np.float64(np.uint32(word).view(np.float32))


def _double(word: Any, shift: Any, like: Any) -> Any:
    return np.uint64(word).view(np.float64)


def _signed(word: Any, shift: Any, like: Any) -> Any:
    return np.float64(np.int64(word << shift) >> np.int64(shift))


def _unsigned(word: Any, shift: Any, like: Any) -> Any:
    return np.float64(word << shift >> shift)


def value_at(data: Any, z: Any, y: Any, x: Any) -> Any:
    """For kernels: a sample of an array, or of `Samples`, as float64."""
    raise NotImplementedError


@overload(value_at, jit_options={"_nrt": False})
def _value_at(data: Any, z: Any, y: Any, x: Any) -> Any:
    return _of_array if isinstance(data, numba.types.Array) else _of_samples


def _of_array(data: Any, z: Any, y: Any, x: Any) -> Any:
    return np.float64(data[z, y, x])


def _of_samples(data: Any, z: Any, y: Any, x: Any) -> Any:
    return value_from(data, byte_of(data, z, y, x))


@hot
def byte_of(data: Any, z: Any, y: Any, x: Any) -> Any:
    """Where the bytes of a sample begin; data: `Samples`."""
    _, ny, nx = data.shape
    return np.uint64(((z * ny + y) * nx + x) * data.size)


@hot
def value_from(data: Any, at: Any) -> Any:
    """The sample whose bytes begin there, as float64."""
    word, shift = some_bytes(data.bytes, at, data.size), np.uint64(64 - 8 * data.size)
    if data.kind == FLOAT and data.size == 4:
        return number_in(word, shift, np.float32(0))
    if data.kind == FLOAT:
        return number_in(word, shift, np.float64(0))
    if data.kind == SIGNED:
        return number_in(word, shift, np.int64(0))
    return number_in(word, shift, np.uint64(0))


def fill_corners(data: Any, z: Any, y: Any, x: Any, values: Any) -> None:
    """For kernels: float64[8], the samples at the corners x + 2y + 4z of a cell."""
    raise NotImplementedError


@overload(fill_corners, jit_options={"forceinline": True, "_nrt": False})
def _fill_corners(data: Any, z: Any, y: Any, x: Any, values: Any) -> Any:
    return _corners_of_array if isinstance(data, numba.types.Array) else _corners_of_samples


def _corners_of_array(data: Any, z: Any, y: Any, x: Any, values: Any) -> None:
    for c in range(8):
        values[c] = np.float64(data[z + (c >> 2), y + (c >> 1 & 1), x + (c & 1)])


def _corners_of_samples(data: Any, z: Any, y: Any, x: Any, values: Any) -> None:
    at, size = byte_of(data, z, y, x), np.uint64(data.size)
    row = np.uint64(data.shape[2]) * size
    layer = np.uint64(data.shape[1]) * row
    for c in range(4):
        begin = at + np.uint64(c & 1) * row + np.uint64(c >> 1) * layer
        values[2 * c] = value_from(data, begin)
        values[2 * c + 1] = value_from(data, begin + size)
