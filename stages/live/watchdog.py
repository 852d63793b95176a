"""A thread that stops the robot where nobody has commanded it in time."""

import threading
import time
from collections.abc import Callable

MIN_TIMEOUT_S = 0.2
"""Smallest timeout, of a fast robot, seconds: a busy computer that is late must not stop it."""


class Watchdog:
    """Calls `stop` where the time since the last `feed` exceeds that given with it, again and again until it is fed."""

    def __init__(self, stop: Callable[[], None]) -> None:
        self._stop = stop
        self._changed = threading.Condition()
        self._until: float | None = None
        self._closed = False
        threading.Thread(target=self._watch, name="watchdog", daemon=True).start()

    def feed(self, timeout_s: float) -> None:
        """The robot has been commanded; the next command is due within this time."""
        with self._changed:
            self._until = time.monotonic() + max(timeout_s, MIN_TIMEOUT_S)
            self._changed.notify()

    def rest(self) -> None:
        """The robot has stopped: there is nothing to watch."""
        with self._changed:
            self._until = None

    def close(self) -> None:
        """Stop the robot a last time, and watch no longer."""
        with self._changed:
            self._closed = True
            self._changed.notify()
            self._stop()

    def _watch(self) -> None:
        with self._changed:
            while not self._closed:
                now = time.monotonic()
                if self._until is not None and now >= self._until:
                    self._until = now + MIN_TIMEOUT_S
                    self._stop()
                self._changed.wait(None if self._until is None else self._until - now)
