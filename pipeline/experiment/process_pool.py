"""Jobs in processes of their own, some at a time: one that fails or dies says so and does not stop the others."""

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
"""What keeps the libraries of a job to one core where several jobs run beside each other."""

Tell = Callable[[Any], None]


@dataclass(frozen=True)
class Job:
    """Something to do in a process of its own: `function` (`module:name`) is called with `given` and a `tell`.

    `given` is plain data; `tell` sends plain data back while the job runs. What it prints goes to `log`.
    """

    name: str
    function: str
    given: Mapping[str, Any]
    log: Path


def work_through(
    jobs: Sequence[Job], cores: int, heard: Callable[[Job, Any], None], ended: Callable[[Job, str | None], None]
) -> dict[str, str]:
    """Do all jobs, `cores` at a time, in their order. Returns what went wrong, by the job's name.

    `heard` gets what a job tells; `ended` is called at each one's end, with what went wrong or None. When this process
    is killed the jobs end too, at the next word they tell.
    """
    spawn = get_context("spawn")  # a fork of a process with compiled threads may hang
    waiting, errors = list(jobs), dict[str, str]()
    running: dict[Any, tuple[Job, Any]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < cores:
                job = waiting.pop(0)
                ours, theirs = spawn.Pipe(duplex=False)
                process = spawn.Process(target=_work, args=(job, theirs), name=job.name)
                with _environment(ONE_THREAD if cores > 1 else {}):
                    process.start()
                theirs.close()
                running[ours] = (job, process)
            ready: Any
            for ready in connection.wait(list(running)):
                job, process = running[ready]
                try:
                    kind, word = ready.recv()
                except EOFError:
                    kind, word = "died", None
                if kind == "told":
                    heard(job, word)
                    continue
                process.join()
                del running[ready]
                error = word if kind != "died" else _death(process.exitcode)
                if error is not None:
                    errors[job.name] = error
                ended(job, error)
    finally:
        for _, process in running.values():
            process.terminate()
    return errors


def _death(code: int | None) -> str:
    if code is not None and code < 0:
        return f"its process was ended by {signal.Signals(-code).name}"
    return f"its process ended without a word (exit code {code})"


def _work(job: Job, pipe: Any) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent hears Ctrl-C and ends its jobs
    job.log.parent.mkdir(parents=True, exist_ok=True)
    log = job.log.open("w", buffering=1)
    os.dup2(log.fileno(), 1)
    os.dup2(log.fileno(), 2)
    error: str | None = None
    try:
        module, _, name = job.function.partition(":")
        getattr(import_module(module), name)(job.given, lambda word: pipe.send(("told", word)))
    except BrokenPipeError:  # nobody listens any more
        sys.exit(1)
    except Exception as failed:
        traceback.print_exc()
        error = _said(failed)
    pipe.send(("ended", error))


def _said(error: Exception) -> str:
    from omninav.pipeline.engine.engine import StageFailed
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
