"""State of a live run as the terminal and `/diagnostics` show it."""

import time
from collections import Counter, deque

import numpy as np

WINDOW = 1000
"""Ticks over which latency is taken; the rate is that of the last hundred."""


class LiveStatus:
    """Notes of stages of a live run; they change no byte of it. `live`: no record is being made again."""

    def __init__(self) -> None:
        self.troubles: dict[str, str] = {}
        self.left_out: dict[str, str] = {}
        """Messages that cannot be published or answered in this run, and why: said once, and never tried again."""
        self.sent: set[str] = set()
        """Topics on which this run has published."""
        self._reported: set[str] = set()
        self.counts: Counter[str] = Counter()
        self.live = False
        self.spread_m = float("nan")
        self._taken = (0, 0)
        self._latencies: deque[float] = deque(maxlen=WINDOW)
        self._ages: deque[float] = deque(maxlen=WINDOW)
        self._ended: deque[float] = deque(maxlen=100)

    def note(self, what: str, trouble: str) -> None:
        """Report what is wrong with something, "" once it is right."""
        if trouble:
            self.troubles[what] = trouble
        else:
            self.troubles.pop(what, None)

    def news(self) -> list[str]:
        """Reasons why something is left out that were not reported yet."""
        unsaid = [why for what, why in sorted(self.left_out.items()) if what not in self._reported]
        self._reported |= self.left_out.keys()
        return unsaid

    def taken(self, stamp: int, received: int) -> None:
        """An image with that stamp (ns) becomes a tick; `received`: when it came, in ns by this computer's clock."""
        self._taken = stamp, received

    def published(self, stamp: int) -> None:
        """The tick of an image with that stamp (ns) has ended, and what it led to is published, now."""
        now = time.time_ns()
        if self._taken[0] == stamp:
            self._latencies.append((now - self._taken[1]) / 1e6)
        self._ages.append((now - stamp) / 1e6)
        self._ended.append(time.monotonic())

    @property
    def latencies_ms(self) -> tuple[float, float] | None:
        """From an image's arrival to its pose, ms: median and 95th percentile; None before the first."""
        if not self._latencies:
            return None
        median, high = np.percentile(np.array(self._latencies), [50, 95])
        return float(median), float(high)

    @property
    def age_ms(self) -> float | None:
        """From an image's stamp to its pose, ms, median: also what the robot's clock is behind this computer's."""
        return float(np.median(self._ages)) if self._ages else None

    @property
    def rate_hz(self) -> float:
        """Ticks a second, lately."""
        if len(self._ended) < 2:
            return 0.0
        return (len(self._ended) - 1) / max(1e-6, self._ended[-1] - self._ended[0])

    def line(self) -> str:
        """In one line, what is wrong first."""
        words = [*sorted(self.troubles.values()), f"{self.rate_hz:.1f} Hz"]
        if self.latencies_ms is not None:
            words.append(f"{self.latencies_ms[0]:.0f} ms from image to pose")
        if np.isfinite(self.spread_m):
            words.append(f"spread {self.spread_m:.2f} m")
        return "; ".join(words)
