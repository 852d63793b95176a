"""A job, as plain data: what crosses from one process to another, and from one machine to another."""

import json
import os
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

ONE_THREAD = dict.fromkeys(
    ("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OPENCV_FOR_THREADS_NUM"), "1"
)
"""Keeps the libraries of a job to one core; read as they are imported."""
PREFIX = "OMNINAV_"
"""Variables of the environment that a job needs wherever it runs."""

Send = Callable[[Any], None]
"""Sends a message (plain data) from a job to the process that started it."""


@dataclass(frozen=True)
class Job:
    """A function to call in a process of its own, with plain data and a `Send`. What it returns is plain data too."""

    name: str
    function: str
    """`module:name`."""
    given: Mapping[str, Any]
    """Its first argument."""
    log: Path
    """Log file of what it prints; a message file is next to it while the job runs."""

    @property
    def messages(self) -> Path:
        """File of its messages, one a line."""
        return self.log.with_name(f"{self.log.name}.messages")

    def text(self, attempt: int, lease: Path, token: str, memory: int | None) -> str:
        """All that is needed to run it. It may run for as long as the file `lease` holds the `token`.

        `memory`: bytes that it may take.
        """
        plain = {
            "function": self.function,
            "given": self.given,
            "log": str(self.log.absolute()),
            "messages": str(self.messages.absolute()),
            "attempt": attempt,
            "lease": str(lease.absolute()),
            "token": token,
            "memory": memory,
            "folder": os.getcwd(),
            "path": [place for place in sys.path if place],
            "environment": {name: value for name, value in os.environ.items() if name.startswith(PREFIX)},
        }
        return json.dumps(plain, default=str)


@dataclass(frozen=True)
class Outcome:
    """End of an attempt at a job."""

    error: str | None = None
    """Error, in one line."""
    died: bool = False
    """Whether its process was ended from outside: then it is worth another attempt."""
    value: Any = None
    """Result of its function."""
    memory: int = 0
    """The most that it took (bytes)."""
