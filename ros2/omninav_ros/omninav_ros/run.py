"""A run of `omninav live` in a process of its own, which ends when nobody holds its standard input any more.

So it ends with whoever started it, however that ends, and one that crashes or is killed takes nobody with it.
"""

import io
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Callable
from typing import Any

READY = "ready"
"""Line by which the process says that its configuration is right."""
END_S = 20.0
"""Time in which a run writes its report, seconds; then it is killed. It publishes nothing meanwhile."""


class Run:
    """The process, as seen by the one that started it."""

    def __init__(self, words: list[str], say: Callable[[str], None]) -> None:
        """Start it: it checks the settings `words` and waits. `say`: takes the lines of the run, in another thread."""
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-m", "omninav_ros.run", *words],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            encoding="utf-8",
            errors="replace",
            start_new_session=True,  # Ctrl-C is for the one that started it
        )
        self._checked = threading.Event()
        self._ready = False
        self._problems: list[str] = []
        self._say = say
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def problems(self) -> str:
        """Wait until the settings are checked, and give what is wrong with them; '' where nothing is."""
        self._checked.wait()
        return "" if self._ready else "\n".join(self._problems) or "the process has ended"

    def go(self) -> None:
        """Begin the run."""
        assert self._process.stdin is not None
        self._process.stdin.write("\n")
        self._process.stdin.flush()

    @property
    def ended(self) -> int | None:
        """Its exit code; None as long as it runs."""
        return self._process.poll()

    def end(self) -> None:
        """End it well: map, metrics and report are written."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(END_S)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._reader.join()

    def _read(self) -> None:
        assert self._process.stdout is not None
        for line in map(str.rstrip, self._process.stdout):
            if self._ready:
                self._say(line)
            elif line == READY:
                self._ready = True
                self._checked.set()
            else:
                self._problems.append(line)
        self._checked.set()


class Output(io.FileIO):
    """Output that nobody need read: the run goes on to its report."""

    def write(self, data: Any, /) -> int:
        """Write, or do without."""
        try:
            return super().write(data)
        except BrokenPipeError:
            return len(data)


def main(words: list[str]) -> int:
    """Check the settings, wait for a byte, and run; the exit code is that of the command."""
    sys.stdout, sys.stderr = (
        io.TextIOWrapper(io.BufferedWriter(Output(number, "w")), encoding="utf-8", line_buffering=True)
        for number in (1, 2)
    )
    from omninav.__main__ import main as omninav
    from omninav.pipeline.cli.commands.live import live_words

    code = omninav(["check", *live_words(words)])
    if code:
        return code
    print(READY, flush=True)
    if not os.read(0, 1):
        return 0

    def end_with_input() -> None:
        os.read(0, 1)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=end_with_input, daemon=True).start()
    return omninav(["live", *words])


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
