"""Measured side by side: each row a median, beside what it is compared with, as a ratio of the same run."""

import statistics
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Row:
    """A measured figure. `limit` is what it must stay below, in the unit of `value` or as a ratio where `of_peer`."""

    what: str
    value: float
    unit: str
    peer: str = ""
    peer_value: float | None = None
    limit: float | None = None
    of_peer: bool = False
    higher_is_better: bool = False

    @property
    def ratio(self) -> float | None:
        """Ours over the peer's."""
        return self.value / self.peer_value if self.peer_value else None

    @property
    def reached(self) -> bool | None:
        """Tells whether the figure keeps its limit; None where it has none."""
        measured = self.ratio if self.of_peer else self.value
        if self.limit is None or measured is None:
            return None
        return measured >= self.limit if self.higher_is_better else measured <= self.limit


def milliseconds(what: str, seconds: float, peer: str = "", peer_seconds: float | None = None, **limits: Any) -> Row:
    """A row in milliseconds of times in seconds."""
    theirs = None if peer_seconds is None else 1e3 * peer_seconds
    return Row(what, 1e3 * seconds, "ms", peer, theirs, **limits)


def medians(functions: dict[str, Callable[[], object]], rounds: int = 30, inner: int = 1) -> dict[str, float]:
    """Median seconds per call of several functions, taken in turns so that a noisy moment hits all of them."""
    for function in functions.values():
        function()  # compiled and warm
    times: dict[str, list[float]] = {name: [] for name in functions}
    for _ in range(rounds):
        for name, function in functions.items():
            start = time.perf_counter()
            for _ in range(inner):
                function()
            times[name].append((time.perf_counter() - start) / inner)
    return {name: statistics.median(taken) for name, taken in times.items()}


def printed(rows: list[Row]) -> str:
    """The table, with units, ratios, limits and whether they are kept."""
    lines = [f"{'what':58} {'ours':>10} {'unit':6} {'peer':32} {'peer':>10} {'ratio':>7} {'limit':>9}"]
    for row in rows:
        peer = f"{row.peer_value:10.4g}" if row.peer_value is not None else " " * 10
        ratio = f"{row.ratio:7.3g}" if row.ratio is not None else " " * 7
        sign, of_peer = ">=" if row.higher_is_better else "<=", "x" if row.of_peer else ""
        limit = "" if row.limit is None else f"{sign}{row.limit:g}{of_peer}"
        mark = {True: "kept", False: "MISSED", None: ""}[row.reached]
        lines.append(f"{row.what:58} {row.value:10.4g} {row.unit:6} {row.peer:32} {peer} {ratio} {limit:>9} {mark}")
    return "\n".join(lines)
