"""Jobs in processes of their own, some at a time: one that fails or dies is reported and does not stop the others."""

import os
import signal
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import connection, get_context
from pathlib import Path
from typing import Any

ONE_THREAD = {
    name: "1"
    for name in (
        "NUMBA_NUM_THREADS",
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
        "MKL_NUM_THREADS",
        "OPENCV_FOR_THREADS_NUM",
    )
}
"""Keeps the libraries of a job to one core where several jobs run at a time."""

Send = Callable[[Any], None]
"""Sends a message (plain data) from a job to the process that started it."""


@dataclass(frozen=True)
class Job:
    """A function to call in a process of its own, with plain data and a `Send`."""

    name: str
    function: str
    """`module:name`."""
    given: Mapping[str, Any]
    """Its first argument."""
    log: Path
    """The file that gets what it prints."""


def run_jobs(
    jobs: Sequence[Job], cores: int, on_message: Callable[[Job, Any], None], on_end: Callable[[Job, str | None], None]
) -> dict[str, str]:
    """Run all jobs in their order, `cores` at a time. Returns the errors by the jobs' names.

    `on_message` gets every message of a job; `on_end` is called when one ends, with its error or None. When this
    process is killed, the jobs end too, at the next message that they send.
    """
    spawn = get_context("spawn")  # a fork of a process with compiled threads may hang
    waiting, errors = list(jobs), dict[str, str]()
    running: dict[Any, tuple[Job, Any]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < cores:
                job = waiting.pop(0)
                ours, theirs = spawn.Pipe(duplex=False)
                process = spawn.Process(target=_run, args=(job, theirs), name=job.name)
                with _environment(ONE_THREAD if cores > 1 else {}):
                    process.start()
                theirs.close()
                running[ours] = (job, process)
            ready: Any
            for ready in connection.wait(list(running)):
                job, process = running[ready]
                try:
                    kind, message = ready.recv()
                except EOFError:
                    kind, message = "died", None
                if kind == "message":
                    on_message(job, message)
                    continue
                process.join()
                del running[ready]
                error = message if kind != "died" else _cause_of_death(process.exitcode)
                if error is not None:
                    errors[job.name] = error
                on_end(job, error)
    finally:
        for _, process in running.values():
            process.terminate()
    return errors


def _cause_of_death(code: int | None) -> str:
    if code is not None and code < 0:
        return f"its process was ended by {signal.Signals(-code).name}"
    return f"its process ended without a message (exit code {code})"


def _run(job: Job, pipe: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent handles Ctrl-C and ends its jobs
    job.log.parent.mkdir(parents=True, exist_ok=True)
    log = job.log.open("w", buffering=1, encoding="utf-8")
    os.dup2(log.fileno(), 1)
    os.dup2(log.fileno(), 2)
    error: str | None = None
    try:
        module, _, name = job.function.partition(":")
        getattr(import_module(module), name)(job.given, lambda message: pipe.send(("message", message)))
    except BrokenPipeError:  # the parent was killed
        sys.exit(1)
    except Exception as failed:
        traceback.print_exc()
        error = _in_one_line(failed)
    pipe.send(("ended", error))


def _in_one_line(error: Exception) -> str:
    from omninav.pipeline.engine.call import StageFailed
    from omninav.pipeline.graph.problems import BadInput, ProblemsFound

    known = isinstance(error, StageFailed | BadInput | ProblemsFound)
    return str(error) if known else f"{type(error).__name__}: {error}"


@contextmanager
def _environment(settings: Mapping[str, str]) -> Iterator[None]:
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update(settings)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
