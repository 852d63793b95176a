"""Progress of a run: one live line in a terminal, JSON lines elsewhere. Both on stderr, so that stdout stays clean."""

import json
import re
import shutil
import sys
import time
from collections.abc import Callable
from typing import TextIO

from .terminal_text import Uncleaned, plain

SAID_S = 2.5
"""Longest time for which words of a stage are shown beside the frames, seconds."""
RATED_S = 0.05
"""Shortest time over which frames per second are stated, seconds."""


class Progress:
    """Shows frames done, frames per second and the time left; a context manager.

    `update` is called every tick and returns at once unless something is due: ten times a second in a terminal, every
    two seconds elsewhere, and once when a graph's loop has ended. `unit` is what is counted, where it is not frames.
    `stream` and `clock` are there for tests.
    """

    def __init__(
        self, stream: TextIO | None = None, clock: Callable[[], float] = time.monotonic, unit: str = "frames"
    ) -> None:
        self._unit = unit
        self._stream = Uncleaned(sys.stderr) if stream is None else stream
        self._clock = clock
        self._live = self._stream.isatty()
        self._every = 0.1 if self._live else 2.0
        self._due = self._now = 0.0
        self._name = ""
        self._ended: tuple[str, int] | None = None
        self._started = 0.0
        self._first = self._done = 0
        self._total: int | None = None
        self._shown: int | None = None
        self._note = self._doing = ""
        self._doing_since = 0.0
        self._rows = 1

    def __enter__(self) -> "Progress":
        return self

    def __exit__(self, *raised: object) -> None:
        if self._doing and not self._name and self._live:
            self._paint("")  # what is printed from now on begins a line
            self._stream.flush()
        self._close()

    def begin(self, name: str, done: int, total: int | None = None) -> None:
        """`done` were there before; only what comes after them counts for the rate and the time left."""
        self._begin(name, done)
        self._done, self._total = done, total

    def update(self, name: str, done: int, total: int | None = None, note: str = "") -> None:
        """`done` frames of `total` (None: not known) have gone through the graph `name`; `note` is shown with it."""
        if (name, done) == self._ended:
            return
        if name != self._name:
            self._begin(name, done - 1)
        self._done, self._total, self._note = done, total, note
        self._now = now = self._clock()
        if now >= self._due:
            self._due = now + self._every
            self._show(now)
        if done == total:  # what is printed from now on comes below
            self._ended = (name, done)
            self._close()

    def say(self, words: str) -> None:
        """Show what a stage does or waits for: beside the frames once there are any.

        In a terminal it stays until something else is shown. Elsewhere it is a line, where only its numbers have
        changed every two seconds at most.
        """
        now, new = self._clock(), re.sub(r"[\d.]+", "", words) != re.sub(r"[\d.]+", "", self._doing)
        self._doing, self._doing_since = words, now
        if not new and now < self._due:
            return
        self._due = now + self._every
        if self._name:
            self._now = now
            self._show(now)
        elif self._live:
            self._paint(f"{words} …")
        else:
            self._stream.write(json.dumps({"doing": words}) + "\n")
        self._stream.flush()

    def _begin(self, name: str, before: int) -> None:
        self._close()
        self._now = now = self._clock()
        self._name, self._started, self._first, self._note = name, now, before, ""
        self._shown, self._due = None, now + self._every

    def _close(self) -> None:
        if self._name and self._shown != self._done:
            self._show(self._now)  # the last frame's time: what came after it was no frame
        if self._name and self._live:
            self._stream.write("\n")
            self._stream.flush()
            self._rows = 1
        self._name = ""

    def _show(self, now: float) -> None:
        self._shown = self._done
        seconds = now - self._started
        rate = (self._done - self._first) / seconds if seconds >= RATED_S and self._done > self._first else None
        left = (self._total - self._done) / rate if self._total is not None and rate else None
        note = ", ".join(filter(None, (self._note, self._doing if now - self._doing_since < SAID_S else "")))
        if self._live:
            self._paint(live_line(self._name, self._done, self._total, rate, left, self._unit, note))
        else:
            state = {"graph": self._name, self._unit: self._done, "of": self._total}
            state |= {
                f"{self._unit}_per_second": None if rate is None else _rounded(rate),
                "seconds_left": None if left is None else round(left, 1),
            }
            state |= {"note": note} if note else {}
            self._stream.write(json.dumps(state) + "\n")
        self._stream.flush()

    def _paint(self, line: str) -> None:
        """Write over what was painted last, however many rows of the terminal that took."""
        line = plain(line)
        up = f"\x1b[{self._rows - 1}A" if self._rows > 1 else ""
        self._stream.write(f"\r{up}\x1b[J{line}")
        self._rows = 1 + max(len(line) - 1, 0) // max(shutil.get_terminal_size().columns, 1)


def _rounded(rate: float) -> float:
    """A tenth of a thing is enough where there are many a second; two digits where one takes long."""
    return round(rate, 1) if rate >= 1 else float(f"{rate:.2g}")


def live_line(
    name: str,
    done: int,
    total: int | None,
    rate: float | None,
    left: float | None,
    unit: str = "frames",
    note: str = "",
) -> str:
    """The line in the terminal: `name  ━━━━────  120/300 frames  48.2 frames/s  0:04 left`; slow ones `12.5 s each`."""
    words = [name]
    if total:
        full = min(24, 24 * done // total)
        words.append("━" * full + "─" * (24 - full))
    words.append(
        f"{done}/{total} {unit}" if total is not None else f"{done} {unit.removesuffix('s') if done == 1 else unit}"
    )
    if rate is not None:
        words.append(f"{rate:.1f} {unit}/s" if rate >= 1 else f"{1 / rate:.1f} s each")
    if left is not None and (total is None or done < total):
        minutes, seconds = divmod(int(left), 60)
        hours, minutes_only = divmod(minutes, 60)
        words.append((f"{hours}:{minutes_only:02d}:{seconds:02d}" if hours else f"{minutes}:{seconds:02d}") + " left")
    return "  ".join([*words, note] if note else words)
