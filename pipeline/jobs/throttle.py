"""Calls an expensive function at limited rate."""

import time
from collections.abc import Callable

SHARE = 20
"""It takes at most one part in this many of the time."""


class Throttle:
    """Lets something be done at once, and then not again for 20 times as long as it took, nor for `min_s` seconds."""

    def __init__(self, min_s: float = 0.0) -> None:
        self._min_s = min_s
        self._due = 0.0

    @property
    def pause(self) -> float:
        """Seconds until it may be done again."""
        return max(0.0, self._due - time.monotonic())

    def __call__(self, work: Callable[[], object]) -> None:
        """Do it, if it is time to."""
        begun = time.monotonic()
        if begun >= self._due:
            work()
            now = time.monotonic()
            self._due = now + max(self._min_s, SHARE * (now - begun))
