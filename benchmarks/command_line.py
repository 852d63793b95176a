"""How long the command line takes to answer."""

import statistics
import subprocess
import sys
import time

from .table import Row


def rows() -> list[Row]:
    """`omninav --help` in a fresh process, beside a Python process that does nothing."""
    empty = _median([sys.executable, "-c", "pass"])
    helped = _median([sys.executable, "-m", "omninav", "--help"])
    return [Row("omninav --help", helped, "s", "python -c pass", empty, limit=0.5)]


def _median(command: list[str]) -> float:
    taken = []
    for _ in range(7):
        start = time.perf_counter()
        subprocess.run(command, capture_output=True, check=True)
        taken.append(time.perf_counter() - start)
    return statistics.median(taken)
