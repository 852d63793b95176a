"""Says once that code is being compiled, which takes long and happens only where nothing has been kept of it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

WORDS = "compiling, first run only"
_say: list[Callable[[str], None]] = []


@contextmanager
def compile_notice(say: Callable[[str], None]) -> Iterator[None]:
    """While the block runs, call `say` with some words where a function is compiled for the first time, once."""
    _say.append(say)
    try:
        yield
    finally:
        _say.clear()


def compiling() -> None:
    """Prints the notice once, before a function is compiled."""
    while _say:
        _say.pop()(WORDS)
