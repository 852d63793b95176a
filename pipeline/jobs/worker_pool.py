"""Runs many jobs: one that fails is reported, one that dies is tried again, and neither stops the others."""

import json
import os
import queue
import secrets
import threading
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import CancelledError, Executor, Future
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.problems import BadInput

from .executors import ExecutorSettings, cores, executor_of
from .job import Job, Outcome
from .perform import perform, release
from .throttle import Throttle

ATTEMPTS = 3
"""Largest number of starts of a job whose process dies."""
RENEW_S = 5.0
"""Time between signs of life of the client, seconds."""
LOOK_S = 0.2
"""Time between looks for messages, seconds."""
Ends = queue.SimpleQueue[tuple[Job, int, Future[dict[str, Any]]]]
"""Jobs that have ended, each with the number of the attempt."""


class WorkerPool:
    """Runs jobs by the executor that settings describe; a context manager.

    It is started with the first job. `folder` must be seen by all of its machines.
    """

    def __init__(self, settings: ExecutorSettings, folder: Path) -> None:
        self.settings = replace(settings, folder=folder.absolute())
        self._lease = folder / ".client"
        self._token = secrets.token_hex(16)
        self._executor: Executor | None = None
        self._over = threading.Event()

    def __enter__(self) -> "WorkerPool":
        return self

    def __exit__(self, kind: type[BaseException] | None, *raised: object) -> None:
        self._over.set()
        self._lease.unlink(missing_ok=True)  # jobs that still run end at this
        if self._executor is not None:
            self._executor.shutdown(wait=kind is None, cancel_futures=True)
        release()

    @property
    def number(self) -> int:
        """Number of jobs that run at a time, as far as it is known before they start."""
        default = {"local": cores(), "slurm": 4}.get(self.settings.name, 8)
        return self.settings.workers or int(getattr(self._executor, "workers", 0)) or default

    def run(
        self,
        jobs: Sequence[Job],
        on_message: Callable[[Job, Any], None] = lambda job, message: None,
        on_end: Callable[[Job, Outcome], None] = lambda job, outcome: None,
    ) -> dict[str, Outcome]:
        """Run jobs. Returns how each ended, by name. Raises `BadInput` where the executor itself is gone.

        `on_message` gets every message of a job, `on_end` how it ended.
        """
        if not jobs:
            return {}
        if self._executor is None:
            self.start(executor_of(self.settings))
        outcomes: dict[str, Outcome] = {}
        ends: Ends = queue.SimpleQueue()
        mailbox, throttle = _Mailbox(on_message), Throttle(LOOK_S)
        for job in jobs:
            job.log.parent.mkdir(parents=True, exist_ok=True)
            job.messages.unlink(missing_ok=True)
        for job in jobs:
            self._submit(job, 0, ends)
        open_jobs = {job.name: job for job in jobs}
        while open_jobs:
            with suppress(queue.Empty):
                job, attempt, future = ends.get(timeout=throttle.pause)
                outcome = _outcome(future)
                mailbox.read([job])
                if outcome.died and attempt + 1 < ATTEMPTS:
                    print(f"{job.name}: {outcome.error}; it is started again", flush=True)
                    self._submit(job, attempt + 1, ends)
                    continue
                del open_jobs[job.name]
                job.messages.unlink(missing_ok=True)
                outcomes[job.name] = outcome
                on_end(job, outcome)
            throttle(lambda: mailbox.read(open_jobs.values()))
        return outcomes

    def start(self, executor: Executor) -> None:
        """Give the jobs to this executor."""
        write_whole(self._lease, self._token)
        self._executor = executor
        threading.Thread(target=self._renew, daemon=True).start()

    def _submit(self, job: Job, attempt: int, ends: Ends) -> None:
        assert self._executor is not None
        try:
            future = self._executor.submit(perform, job.text(attempt, self._lease, self._token, self.settings.memory))
        except Exception as error:
            message = f"executor={self.settings.name}: it takes no more jobs ({error}); the same command continues"
            raise BadInput(message) from error
        future.add_done_callback(lambda done: ends.put((job, attempt, done)))

    def _renew(self) -> None:
        while not self._over.wait(RENEW_S):
            with suppress(OSError):  # gone, or a full disk
                os.utime(self._lease)


def _outcome(future: Future[dict[str, Any]]) -> Outcome:
    try:
        return Outcome(**future.result())
    except CancelledError:
        return Outcome("its worker was lost", died=True)
    except Exception as error:
        return Outcome(f"its worker was lost ({type(error).__name__}: {error!s:.200})", died=True)


class _Mailbox:
    """Reads the messages of jobs as they come."""

    def __init__(self, on_message: Callable[[Job, Any], None]) -> None:
        self._on_message = on_message
        self._read: Counter[str] = Counter()

    def read(self, jobs: Iterable[Job]) -> None:
        """Read what jobs have sent since."""
        for job in jobs:
            lines = b""
            with suppress(FileNotFoundError), job.messages.open("rb") as file:
                file.seek(self._read[job.name])
                lines = file.read()
            whole = lines[: lines.rfind(b"\n") + 1]
            self._read[job.name] += len(whole)
            for line in whole.splitlines():
                self._on_message(job, json.loads(line))
