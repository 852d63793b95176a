"""Jobs for the tests of executors."""

import os
import signal
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from omninav.pipeline.jobs.job import Send


def count(given: Mapping[str, Any], send: Send) -> int:
    """Sends as many messages as it is given."""
    for number in range(given["messages"]):
        send({"number": number})
    print("counted")
    return int(given["messages"])


def nothing(given: Mapping[str, Any], send: Send) -> None:
    """Takes no time."""


def fail(given: Mapping[str, Any], send: Send) -> None:
    raise ValueError("no such number")


def die(given: Mapping[str, Any], send: Send) -> None:
    print("dying")
    os.kill(os.getpid(), signal.SIGKILL)


def die_once(given: Mapping[str, Any], send: Send) -> None:
    """Dies at the first attempt, at which the file `mark` is not there."""
    mark = Path(given["mark"])
    if not mark.exists():
        mark.touch()
        os.kill(os.getpid(), signal.SIGKILL)


def take(given: Mapping[str, Any], send: Send) -> None:
    """Leaves its process's number in a file, then takes memory (MB) and time (s)."""
    mark = Path(given["mark"])
    unfinished = mark.with_suffix(".unfinished")
    unfinished.write_text(str(os.getpid()))
    unfinished.rename(mark)
    taken = bytearray(given["megabytes"] * 1_000_000)
    for page in range(0, len(taken), 4096):
        taken[page] = 1
    time.sleep(given["seconds"])


def threads(given: Mapping[str, Any], send: Send) -> list[int]:
    """How many threads the libraries use."""
    import cv2
    import numba
    import threadpoolctl

    pools = [int(each["num_threads"]) for each in threadpoolctl.threadpool_info()]
    return [cv2.getNumThreads(), numba.get_num_threads(), *pools]


def process(given: Mapping[str, Any], send: Send) -> int:
    """The number of the process that runs it."""
    return os.getpid()
