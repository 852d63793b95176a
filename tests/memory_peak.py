"""Measures the peak of memory while something runs."""

import tracemalloc
from collections.abc import Callable


def memory_peak(function: Callable[..., object], *given: object) -> int:
    """The most bytes that Python's objects and numpy's arrays take in a call, beside what was there before."""
    tracemalloc.start()
    try:
        function(*given)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
