"""A process that runs jobs, one after the other: what it has imported and compiled for one is there for the next.

`perform` starts it and talks to it: a line of its input is a job, and a line that it answers is how that ended.
"""

import faulthandler
import gc
import importlib
import json
import os
import queue
import re
import sys
import threading
import traceback
from contextlib import suppress
from pathlib import Path
from typing import Any

from omninav.pipeline.engine.call import StageFailed
from omninav.pipeline.graph.problems import BadInput, ProblemsFound


def main() -> None:
    """Run jobs until standard input closes or the parent process dies, even in the middle of one."""
    answers, own_output = os.dup(1), os.dup(2)
    environment, path = dict(os.environ), list(sys.path)
    jobs: queue.SimpleQueue[dict[str, Any]] = queue.SimpleQueue()
    threading.Thread(target=_listen, args=(jobs,), daemon=True).start()
    faulthandler.enable()
    while True:
        job = jobs.get()
        os.environ.clear()
        os.environ.update(environment | job["environment"])
        sys.path[:] = [*path, *(place for place in job["path"] if place not in path)]
        _begin_peak()
        ended = _run(job)
        for output in (1, 2):
            os.dup2(own_output, output)
        gc.collect()
        now, peak = _memory()
        answer = json.dumps({**ended, "memory": peak, "left": now}, default=str).encode() + b"\n"
        while answer:
            answer = answer[os.write(answers, answer) :]


def _listen(jobs: "queue.SimpleQueue[dict[str, Any]]") -> None:
    with open(0, "rb", closefd=False) as lines:  # a thread in sys.stdin makes an interpreter that ends abort
        for line in lines:
            jobs.put(json.loads(line))
    os._exit(1)


def _run(job: dict[str, Any]) -> dict[str, Any]:
    module, _, name = job["function"].partition(":")
    first = os.O_TRUNC if job["attempt"] == 0 else os.O_APPEND
    try:
        os.chdir(job["folder"])
        log = os.open(job["log"], os.O_WRONLY | os.O_CREAT | first, 0o666)
        for output in (1, 2):
            os.dup2(log, output)
        os.close(log)
        with open(job["messages"], "a", buffering=1, encoding="utf-8") as messages:

            def send(message: Any) -> None:
                messages.write(json.dumps(message, default=str) + "\n")

            value = getattr(importlib.import_module(module), name)(job["given"], send)
        return {"value": json.loads(json.dumps(value, default=str))}
    except (Exception, SystemExit) as failed:
        with suppress(OSError):  # a full disk
            traceback.print_exc()
        return {"error": _in_one_line(failed)}
    finally:
        for printed in (sys.stdout, sys.stderr):
            with suppress(OSError):
                printed.flush()


def _in_one_line(error: BaseException) -> str:
    known = isinstance(error, StageFailed | BadInput | ProblemsFound)
    return str(error) if known else f"{type(error).__name__}: {error}"


def _begin_peak() -> None:
    """Let the most memory taken count from now on."""
    with suppress(OSError):  # else it counts from the first job on
        Path("/proc/self/clear_refs").write_text("5", encoding="ascii")


def _memory() -> tuple[int, int]:
    """Memory of this process now, and at most so far (bytes)."""
    status = Path("/proc/self/status").read_text(encoding="utf-8")
    now, peak = (re.search(rf"{name}:\s+(\d+) kB", status) for name in ("VmRSS", "VmHWM"))
    return (int(now[1]) * 1024 if now else 0), (int(peak[1]) * 1024 if peak else 0)


if __name__ == "__main__":
    main()
