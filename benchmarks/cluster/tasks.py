"""What the jobs of `twelve_jobs.py` do."""

import os
import signal
import time
from collections.abc import Callable
from typing import Any


def task(kind: str, mark: str) -> str:
    """What each job does."""
    time.sleep(0.2 if mark else 0.0)
    if kind == "raises":
        raise ValueError("no such number")
    if kind == "dies" or (kind == "dies once" and not os.path.exists(mark)):
        open(mark, "w").close()
        os.kill(os.getpid(), signal.SIGKILL)
    return kind


def repeat(given: dict[str, Any], send: Callable[[Any], None]) -> float:
    """Repetitions of an experiment's condition. Returns what they took of the processor (s)."""
    from omninav.pipeline.experiment import repetition

    begun = time.process_time()
    repetition.repeat(given, send)
    return time.process_time() - begun


def job(given: dict[str, str], send: Callable[[Any], None]) -> str:
    """The same, as a job of ours."""
    return task(given["kind"], given["mark"])
