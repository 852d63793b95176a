"""Jobs for the tests of the process pool."""

import os
import signal
from collections.abc import Mapping
from typing import Any

from omninav.pipeline.experiment.process_pool import Send


def count(given: Mapping[str, Any], send: Send) -> None:
    """Sends as many messages as it is given."""
    for number in range(given["messages"]):
        send({"number": number})
    print("counted")


def fail(given: Mapping[str, Any], send: Send) -> None:
    raise ValueError("no such number")


def die(given: Mapping[str, Any], send: Send) -> None:
    os.kill(os.getpid(), signal.SIGKILL)
