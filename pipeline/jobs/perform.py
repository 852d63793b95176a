"""What an executor calls, wherever it places a job: run it in a process forked for it, and watch that process."""

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
"""How often a running job is looked at."""
LEASE_S = 60.0
"""For how long a job goes on whose client gives no sign of life."""


def perform(text: str) -> dict[str, Any]:
    """Run a job as `Job.text` describes it, and return its `Outcome` as plain data. It never raises."""
    job = json.loads(text)
    try:
        with _server() as server:
            return server.run(job)
    except OSError as error:  # no process can be started, or the one that forks was killed
        return {"error": f"its process could not be started: {error}", "died": True}


class _Server:
    """The process that imports once and forks for each job (`server.py`). It ends when this one does."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", "-c", "from omninav.pipeline.jobs.server import main; main()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **ONE_THREAD},
            start_new_session=True,  # Ctrl-C is for whoever waits for the jobs
        )
        self._answers = b""
        self._modules: list[str] = []

    @property
    def ready(self) -> bool:
        """Whether it lives."""
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
        """Have it run a job. Raises `OSError` where it dies itself."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps({**job, "modules": self._modules}).encode() + b"\n")
        self._process.stdin.flush()
        lease, limit, peak = _Lease(job), job["memory"], 0
        known: dict[str, Any] = {}
        while "code" not in known:
            line = self._answer()
            if line is not None:
                known |= json.loads(line)
                continue
            peak = max(peak, _memory(known.get("process", 0)))
            if limit and peak > limit:
                self.close()
                error = f"it took {size_text(peak)} of memory, more than engine.memory={size_text(limit)} allows"
                return {"error": error, "memory": peak}
            if lease.over():
                self.close()
                return {"error": "stopped, because whoever started it has ended"}
        self._modules = known.get("modules", self._modules)  # the next job will need them too
        if known["code"] == 0 and "ended" in known:
            return {**known["ended"], "memory": known["memory"]}
        error = f"{_cause(known['code'])}; it had taken {size_text(known['memory'])} of memory"
        return {"error": error, "died": True, "memory": known["memory"]}

    def _answer(self) -> bytes | None:
        """Its next line; None where it says nothing for a while."""
        assert self._process.stdout is not None
        while b"\n" not in self._answers:
            if not select.select([self._process.stdout], [], [], LOOK_S)[0]:
                return None
            part = os.read(self._process.stdout.fileno(), 1 << 20)
            if not part:
                raise OSError("the process that starts jobs was killed")
            self._answers += part
        line, _, self._answers = self._answers.partition(b"\n")
        return line


class _Lease:
    """Whether whoever started a job still waits for it: its file holds the token, and is renewed."""

    def __init__(self, job: dict[str, Any]) -> None:
        self._file, self._token = Path(job["lease"]), job["token"]
        self._renewed, self._since = 0, time.monotonic()

    def over(self) -> bool:
        """Whether it does not."""
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


_free: list[_Server] = []
_lock = threading.Lock()


@contextmanager
def _server() -> Iterator[_Server]:
    """A process that forks: one that waits for a job, or a new one."""
    with _lock:
        server = _free.pop() if _free else None
    if server is None or not server.ready:
        server = _Server()
    try:
        yield server
    except BaseException:
        server.close()
        raise
    with _lock:
        _free.append(server)


def release() -> None:
    """End the processes that wait for a job."""
    with _lock:
        free = _free[:]
        _free.clear()
    for server in free:
        server.close()


def _memory(process: int) -> int:
    """What a process takes now (bytes); 0 where it cannot be known."""
    try:
        pages = Path(f"/proc/{process}/statm").read_text(encoding="ascii").split()[1]
    except (OSError, IndexError):
        return 0
    return int(pages) * os.sysconf("SC_PAGE_SIZE")


def _cause(code: int) -> str:
    if code < 0:
        return f"its process was ended by {signal.Signals(-code).name}"
    return f"its process ended without a message (exit code {code})"


def size_text(size: int) -> str:
    """A number of bytes, for people."""
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"
