"""The selective sum over a view's segments by a sorting network, as machine code without loops."""

import functools
from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from omninav.stages.geometry.arrays import Ints


@functools.cache
def sorting_network(length: int) -> Ints:
    """Pairs (i, j), i < j, whose exchange in this order sorts `length` items: Batcher's odd-even merge sort. (P, 2)."""
    pairs = []
    p = 1
    while p < length:
        k = p
        while k >= 1:
            for j in range(k % p, length - k, 2 * k):
                for i in range(min(k, length - j - k)):
                    if (i + j) // (2 * p) == (i + j + k) // (2 * p):
                        pairs.append((i + j, i + j + k))
            k //= 2
        p *= 2
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


llvm: Any = cgutils
UNROLLED = range(24, 49)
"""Numbers of segments that are sorted in registers; machine code of more is large, fewer are sorted in no time."""


def _selective_sum(context: Any, similarities: Any, heading: Any, reference: Any, factors: Any) -> Any:
    """max_k (sum of the k largest) factors[k] over `similarities` (headings, segments, references) at one heading and
    reference; `factors` is a tuple of as many float32 as there are segments.

    The sorting network becomes one instruction for each exchange's larger and smaller value, so that a loop over
    references keeps all segments of 16 of them in registers, where sorting rows in memory takes four times as long.
    """

    def code(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        array = context.make_array(signature.args[0])(context, builder, arguments[0])
        shape, strides = (llvm.unpack_tuple(builder, part) for part in (array.shape, array.strides))
        values = []
        for segment in range(len(signature.args[3])):
            place = [arguments[1], context.get_constant(types.intp, segment), arguments[2]]
            values.append(
                builder.load(llvm.get_item_pointer2(context, builder, array.data, shape, strides, "C", place))
            )
        for i, j in sorting_network(len(values)):
            first, second = values[i], values[j]
            ordered = builder.fcmp_ordered(">", first, second)
            values[i], values[j] = builder.select(ordered, first, second), builder.select(ordered, second, first)
        total = best = context.get_constant(types.float32, 0.0)
        for value, factor in zip(values, llvm.unpack_tuple(builder, arguments[3]), strict=True):
            total = builder.fadd(total, value)
            score = builder.fmul(total, factor)
            best = builder.select(builder.fcmp_ordered(">", score, best), score, best)
        return best

    return types.float32(similarities, heading, reference, factors), code


selective_sum: Any = intrinsic(_selective_sum)
