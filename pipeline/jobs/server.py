"""A process that imports what jobs need once, and forks for each of them. `perform` starts it and talks to it.

It has no threads, so that a fork is safe. A line of its input is a job. It answers with lines: the process that runs
it; what that returned or raised, where it came so far, and which modules it had imported; and how it ended.
"""

import faulthandler
import gc
import importlib
import json
import os
import sys
import threading
import traceback
from contextlib import suppress
from typing import Any

OWN = "omninav."
"""Whose modules are imported once: a user's own may change between two jobs."""


def main() -> None:
    """Serve until whoever started it closes the input or dies."""
    answers = os.dup(1)
    os.dup2(2, 1)
    while line := _next_line():
        job = json.loads(line)
        sys.path += [place for place in job["path"] if place not in sys.path]
        os.environ.update(job["environment"])
        for name in job["modules"]:
            with suppress(Exception):  # the job imports it again, and says what is wrong
                importlib.import_module(name)
        gc.freeze()  # what is shared with a fork stays shared
        process = os.fork()
        if process == 0:
            _run(job, answers)
        _write(answers, f'{{"process": {process}}}\n'.encode())
        _, status, used = os.wait4(process, 0)
        state = {"code": os.waitstatus_to_exitcode(status), "memory": used.ru_maxrss * 1024}
        _write(answers, json.dumps(state).encode() + b"\n")


def _next_line() -> bytes:
    """Byte by byte: what follows is for the job."""
    line = b""
    while not line.endswith(b"\n"):
        part = os.read(0, 65536)
        if not part:
            return b""
        line += part
    return line


def _write(file: int, line: bytes) -> None:
    while line:
        line = line[os.write(file, line) :]


def _run(job: dict[str, Any], answers: int) -> None:
    code = 1
    try:
        threading.Thread(target=_end_with_parent, daemon=True).start()
        log = os.open(job["log"], os.O_WRONLY | os.O_CREAT | os.O_APPEND | (0 if job["attempt"] else os.O_TRUNC), 0o666)
        os.dup2(log, 1)
        os.dup2(log, 2)
        sys.stdout.reconfigure(line_buffering=True)  # type: ignore[union-attr]
        faulthandler.enable()
        os.chdir(job["folder"])
        ended = json.dumps({"ended": _called(job), "modules": _own_modules()}, default=str)
        sys.stdout.flush()
        sys.stderr.flush()
        _write(answers, ended.encode() + b"\n")
        code = 0
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(code)


def _own_modules() -> list[str]:
    return [name for name in sys.modules if name.startswith(OWN)]


def _end_with_parent() -> None:
    while os.read(0, 65536):
        pass
    os._exit(1)


def _called(job: dict[str, Any]) -> dict[str, Any]:
    module, _, name = job["function"].partition(":")
    messages = open(job["messages"], "a", buffering=1, encoding="utf-8")  # noqa: SIM115 - until the process ends

    def send(message: Any) -> None:
        messages.write(json.dumps(message, default=str) + "\n")

    try:
        return {"value": getattr(importlib.import_module(module), name)(job["given"], send)}
    except (Exception, SystemExit) as failed:
        traceback.print_exc()
        return {"error": _in_one_line(failed)}


def _in_one_line(error: BaseException) -> str:
    from omninav.pipeline.engine.call import StageFailed
    from omninav.pipeline.graph.problems import BadInput, ProblemsFound

    known = isinstance(error, StageFailed | BadInput | ProblemsFound)
    return str(error) if known else f"{type(error).__name__}: {error}"


if __name__ == "__main__":
    main()
