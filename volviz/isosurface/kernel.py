"""Kernels on several threads, and words of 64 bits in them.

A kernel works on a range of z-slabs without the interpreter's lock; `in_slabs` runs the ranges on
a small pool of threads (where milliseconds count, `turns.in_turns` does). So progress and cancel
work between ranges, two extractions may run at once, and no threading library beyond Python's is
needed.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor, wait
from functools import cache
from typing import Any

import numba
import numpy as np
from llvmlite import ir
from numba.extending import intrinsic

from volviz.compiled import bare, hot, inline, kernel
from volviz.progress import Progress

__all__ = [
    "add_bytes",
    "aside",
    "at_least",
    "bare",
    "fetch",
    "finite",
    "hot",
    "in_slabs",
    "inline",
    "kernel",
    "lowest_bit",
    "popcount",
    "threads",
    "threshold",
    "uneven",
]
_SAMPLES = 1 << 20  # a range holds about as many samples: some milliseconds of work


@intrinsic
def popcount(context: Any, word: Any) -> Any:
    """How many bits of a uint64 are set, as int64."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.ctpop(arguments[0])

    return numba.types.int64(numba.types.uint64), generate


@intrinsic
def lowest_bit(context: Any, word: Any) -> Any:
    """Index of the lowest set bit of a uint64 that is not 0, as int64."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return builder.cttz(arguments[0], ir.Constant(ir.IntType(1), 1))

    return numba.types.int64(numba.types.uint64), generate


@intrinsic
def at_least(context: Any, samples: Any, at: Any, limit: Any) -> Any:
    """Bit i of a uint64: is sample at + i of a flat array at least the limit? For 64 of them."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        values = _sixty_four(context, builder, signature, arguments)
        one = builder.insert_element(
            ir.Constant(values.type, ir.Undefined), arguments[2], ir.Constant(ir.IntType(32), 0)
        )
        places = ir.Constant(ir.VectorType(ir.IntType(32), 64), [0] * 64)
        limits = builder.shuffle_vector(one, one, places)
        if isinstance(signature.args[0].dtype, numba.types.Float):
            found = builder.fcmp_ordered(">=", values, limits)
        elif signature.args[0].dtype.signed:
            found = builder.icmp_signed(">=", values, limits)
        else:
            found = builder.icmp_unsigned(">=", values, limits)
        return builder.bitcast(found, ir.IntType(64))

    return numba.types.uint64(samples, numba.types.uint64, samples.dtype), generate


@intrinsic
def uneven(context: Any, words: Any, first: Any, second: Any, third: Any, fourth: Any) -> Any:
    """Bit i of a uint64: has word i of a row of cells one whose corners differ? For 8 of them.

    words: flat, of uint64; the others: where the row's own first word and those of its next in y,
    in z and in both are. The words after them are read as well, nine in all.
    """

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, value=arguments[0])
        word, eight = ir.IntType(64), ir.VectorType(ir.IntType(64), 8)
        some: Any = [None, None]
        every: Any = [None, None]
        for row in arguments[1:]:
            for k in range(2):
                at = builder.gep(array.data, [builder.add(row, ir.Constant(word, k))])
                found = builder.load(builder.bitcast(at, eight.as_pointer()), align=8)
                some[k] = found if some[k] is None else builder.or_(some[k], found)
                every[k] = found if every[k] is None else builder.and_(every[k], found)
        one, last = ir.Constant(eight, [1] * 8), ir.Constant(eight, [63] * 8)
        for own, after in (some, every):
            ahead = builder.or_(builder.lshr(own, one), builder.shl(after, last))
            if own is some[0]:
                any_inside = builder.or_(own, ahead)
            else:
                all_inside = builder.and_(own, ahead)
        mixed = builder.and_(any_inside, builder.not_(all_inside))
        flags = builder.icmp_unsigned("!=", mixed, ir.Constant(eight, [0] * 8))
        return builder.zext(builder.bitcast(flags, ir.IntType(8)), word)

    place = numba.types.uint64
    return place(words, place, place, place, place), generate


@intrinsic
def finite(context: Any, samples: Any, at: Any) -> Any:
    """Bit i of a uint64: is sample at + i of a flat array neither NaN nor infinite?"""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if not isinstance(signature.args[0].dtype, numba.types.Float):
            return ir.Constant(ir.IntType(64), (1 << 64) - 1)
        values = _sixty_four(context, builder, signature, arguments)
        nothing = ir.Constant(values.type, [0.0] * 64)
        found = builder.fcmp_ordered("==", builder.fsub(values, values), nothing)
        return builder.bitcast(found, ir.IntType(64))

    return numba.types.uint64(samples, numba.types.uint64), generate


@intrinsic
def add_bytes(context: Any, target: Any, source: Any, table: Any, at: Any) -> Any:
    """target[:16] = source[:16] + table[at : at + 16]: flat, of uint32; the table of uint8."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        kinds = signature.args[:3]
        arrays = [
            context.make_array(kind)(context, builder, value=value).data
            for kind, value in zip(kinds, arguments[:3], strict=True)
        ]
        words, octets = ir.VectorType(ir.IntType(32), 16), ir.VectorType(ir.IntType(8), 16)
        row = builder.bitcast(builder.gep(arrays[2], [arguments[3]]), octets.as_pointer())
        more = builder.zext(builder.load(row, align=1), words)
        before = builder.load(builder.bitcast(arrays[1], words.as_pointer()), align=4)
        after = builder.bitcast(arrays[0], words.as_pointer())
        builder.store(builder.add(before, more), after, align=4)
        return context.get_dummy_value()

    return numba.types.none(target, source, table, numba.types.uint64), generate


@intrinsic
def fetch(context: Any, samples: Any, at: Any) -> Any:
    """Have a sample of a flat array brought near, for later; at may be anywhere."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, value=arguments[0])
        byte, flag = ir.IntType(8).as_pointer(), ir.IntType(32)
        place = builder.bitcast(builder.gep(array.data, [arguments[1]]), byte)
        kind = ir.FunctionType(ir.VoidType(), [byte, flag, flag, flag])
        function = builder.module.declare_intrinsic("llvm.prefetch", [byte], kind)
        builder.call(function, [place, flag(0), flag(3), flag(1)])
        return context.get_dummy_value()

    return numba.types.none(samples, numba.types.uint64), generate


def _sixty_four(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """64 consecutive samples of a flat array as one vector."""
    kind = signature.args[0]
    array = context.make_array(kind)(context, builder, value=arguments[0])
    begin = builder.gep(array.data, [arguments[1]])
    vector = ir.VectorType(context.get_data_type(kind.dtype), 64)
    pointer = builder.bitcast(begin, vector.as_pointer())
    return builder.load(pointer, align=kind.dtype.bitwidth // 8)


def threads() -> int:
    """How many threads work at once: NUMBA_NUM_THREADS, or the processors we may use."""
    asked = os.environ.get("NUMBA_NUM_THREADS", "")
    if asked.isdigit() and int(asked) > 0:
        return int(asked)
    if hasattr(os, "sched_getaffinity"):
        return max(1, len(os.sched_getaffinity(0)))
    return os.cpu_count() or 1


def in_slabs(
    task: Callable[[int, int], Any],
    layers: int,
    layer_size: int,
    progress: Progress,
    message: str,
) -> list[Any]:
    """task(first, last) for consecutive ranges of `layers`, results in order.

    layer_size: samples per layer; a range holds about a million of them, so that a cancel takes
    effect between two ranges, within some milliseconds.
    """
    step = max(1, min(_SAMPLES // max(layer_size, 1), -(-layers // (2 * threads()))))
    ranges = [(a, min(a + step, layers)) for a in range(0, layers, step)]
    futures = [_pool().submit(task, a, b) for a, b in ranges]
    results = []
    try:
        for i, future in enumerate(futures):
            progress(i / len(ranges), message)
            while not future.done():
                wait([future], timeout=0.1)
                progress(i / len(ranges), message)
            results.append(future.result())
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    return results


def aside(task: Callable[[], Any], progress: Progress, message: str) -> Any:
    """task() on another thread: what takes long in one piece, and a cancel need not wait for."""
    return in_slabs(lambda *_: task(), 1, 1, progress, message)[0]


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(threads(), thread_name_prefix="volviz-isosurface")


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_pool.cache_clear)


def threshold(dtype: np.dtype[Any], isovalue: float) -> Any | None:
    """The least value of this dtype that is at least the isovalue; None if there is none.

    So that a kernel compares samples in their own dtype: value ≥ isovalue ⇔ value ≥ threshold.
    """
    if dtype.kind == "f":
        with np.errstate(over="ignore"):
            near = dtype.type(isovalue)
        if float(near) < isovalue:
            near = np.nextafter(near, dtype.type(np.inf))
        return near if np.isfinite(near) else None
    limits = np.iinfo(dtype)
    least = int(np.ceil(isovalue))
    if least > limits.max:
        return None
    return dtype.type(max(least, limits.min))
