"""Runs a job in a process of this machine and watches it: called by an executor, wherever it places the job."""

import json
import os
import select
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from .job import ONE_THREAD

LOOK_S = 0.5
"""Time between looks at a running job, seconds."""
LEASE_S = 60.0
"""Time after which a job ends whose client gives no sign of life, seconds."""
MAX_LEFT = 1_000_000_000
"""Memory above which an idle worker process is replaced (bytes)."""


def perform(text: str) -> dict[str, Any]:
    """Run a job as `Job.text` describes it, and return its `Outcome` as plain data. It never raises."""
    job = json.loads(text)
    try:
        with _worker(job["token"]) as worker:
            return worker.run(job)
    except OSError as error:
        return {"error": f"its process could not be started: {error}", "died": True}


class _Worker:
    """A process for jobs (`worker.py`). It ends when this one does."""

    def __init__(self, token: str) -> None:
        self.token = token
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", "from omninav.pipeline.jobs.worker import main; main()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **ONE_THREAD},
            start_new_session=True,  # Ctrl-C is for the process that waits for the jobs
        )
        self._answers = b""

    @property
    def ready(self) -> bool:
        """Tells whether it lives."""
        return self._process.poll() is None

    def close(self) -> None:
        """End it, and the job that it runs."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            if pipe is not None:
                with suppress(OSError):
                    pipe.close()

    def run(self, job: dict[str, Any]) -> dict[str, Any]:
        """Have it run a job."""
        lease, limit, peak = _Lease(job), job["memory"], 0
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):  # it has died; that is seen below
            self._process.stdin.write(json.dumps(job).encode() + b"\n")
            self._process.stdin.flush()
        while (line := self._answer()) is None:
            peak = max(peak, _memory(self._process.pid))
            if limit and peak > limit:
                return self._ended(f"it took {_size(peak)} of memory, more than executor.memory={_size(limit)} allows")
            if lease.over():
                return self._ended("stopped, because the process that started it has ended")
        if not line:
            taken = f"; it had taken {_size(peak)} of memory" if peak else ""
            return {"error": _cause(self._process.wait()) + taken, "died": True, "memory": peak}
        ended: dict[str, Any] = json.loads(line)
        if ended.pop("left") > MAX_LEFT:
            self.close()
        return ended

    def _ended(self, why: str) -> dict[str, Any]:
        self.close()
        return {"error": why}

    def _answer(self) -> bytes | None:
        """Its next line; None where it writes nothing for a while, nothing where it has died."""
        assert self._process.stdout is not None
        while b"\n" not in self._answers:
            if not select.select([self._process.stdout], [], [], LOOK_S)[0]:
                return None
            part = os.read(self._process.stdout.fileno(), 1 << 20)
            if not part:
                return b""
            self._answers += part
        line, _, self._answers = self._answers.partition(b"\n")
        return line


class _Lease:
    """Tells whether the process that started a job still waits for it: its file holds the token, and is renewed."""

    def __init__(self, job: dict[str, Any]) -> None:
        self._file, self._token = Path(job["lease"]), job["token"]
        self._renewed, self._since = 0, time.monotonic()

    def over(self) -> bool:
        """Tells whether it does not."""
        try:
            renewed = self._file.stat().st_mtime_ns
            if self._file.read_text(encoding="utf-8") != self._token:
                return True
        except FileNotFoundError:
            return True
        except OSError:  # a file system on the network that does not answer
            renewed = self._renewed
        if renewed != self._renewed:
            self._renewed, self._since = renewed, time.monotonic()
        return time.monotonic() - self._since > LEASE_S


_free: list[_Worker] = []
_lock = threading.Lock()


@contextmanager
def _worker(token: str) -> Iterator[_Worker]:
    """A process that waits for a job of the same client (another's may have imported other code), or a new one."""
    with _lock:
        old = [worker for worker in _free if worker.token != token or not worker.ready]
        _free[:] = [worker for worker in _free if worker not in old]
        worker = _free.pop() if _free else None
    for each in old:
        each.close()
    worker = worker or _Worker(token)
    try:
        yield worker
    except BaseException:
        worker.close()
        raise
    with _lock:
        _free.append(worker)


def release() -> None:
    """End the processes that wait for a job."""
    with _lock:
        free = _free[:]
        _free.clear()
    for worker in free:
        worker.close()


def _memory(process: int) -> int:
    """Memory of a process now (bytes); 0 where it cannot be known."""
    try:
        pages = Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1]
    except (OSError, IndexError):
        return 0
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


def _cause(code: int) -> str:
    if code < 0:
        return f"its process was ended by {signal.Signals(-code).name}"
    return f"its process ended without a message (exit code {code})"


def _size(size: int) -> str:
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"
