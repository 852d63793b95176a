"""Functions that the jobs of `benchmarks/jobs.py` run."""

import time
from collections.abc import Callable
from typing import Any


def nothing(given: dict[str, str], send: Callable[[Any], None]) -> None:
    """An empty task."""


def repeat(given: dict[str, Any], send: Callable[[Any], None]) -> float:
    """Repetitions of an experiment's condition. Returns what they took of the processor (s)."""
    from omninav.pipeline.experiment import repetition

    begun = time.process_time()
    repetition.repeat(given, send)
    return time.process_time() - begun
