"""Delayed and held values, which are among a tick's values beside the outputs."""

from collections import deque
from typing import Any

from omninav.pipeline.graph.graph import Wire


class Channel:
    """A delayed wire's memory; wires with the same origin, delay and initial value share one.

    A value that is updated in place is there to stay: a tick at which its writer is skipped does not lose it.
    """

    def __init__(self, wire: Wire, in_place: bool) -> None:
        self.origin, self.delay, self.initial = wire.origin, wire.delay, wire.initial or ""
        self.hold = wire.hold or in_place
        self.waiting: deque[Any] = deque(maxlen=wire.delay)


def channel_key(wire: Wire) -> str:
    """The name under which a delayed wire's present value is among `values`."""
    return f"{wire.origin}@{wire.delay}{'h' if wire.hold else ''}<{wire.initial}"


def held_key(origin: str) -> str:
    """The name under which the last present value of an output is among `values`."""
    return f"{origin}#held"
