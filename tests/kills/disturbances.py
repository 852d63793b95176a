"""What may happen to a process: it is killed, told to end, stopped for a while, its disk is full, its clock wrong."""

import os
import random
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PATIENCE_S = 900.0
CLOCK = "OMNINAV_KILLS_CLOCK"
SITE = f"""
import datetime, os, time
back = float(os.environ.get("{CLOCK}", "0"))
if back:
    now, now_ns = time.time, time.time_ns
    time.time, time.time_ns = lambda: now() - back, lambda: now_ns() - int(back * 1e9)
    class Back(datetime.datetime):
        @classmethod
        def now(cls, tz=None):
            return super().now(tz) - datetime.timedelta(seconds=back)
    datetime.datetime = Back
"""
"""A sitecustomize.py by which a process reads its clock as many seconds back."""
KINDS = ("SIGKILL", "SIGKILL", "SIGTERM", "SIGINT", "SIGSTOP", "disk full", "clock set back")


@dataclass
class Ended:
    """A process that has ended, of itself or not."""

    code: int
    output: str
    disturbed: bool

    @property
    def traceback(self) -> bool:
        """Whether the user saw the inside of the program."""
        return "Traceback (most recent call last)" in self.output or "Exception ignored" in self.output


@dataclass
class Workplace:
    """A folder in which `omninav` is run."""

    folder: Path

    def start(
        self, words: tuple[str, ...], environment: Mapping[str, str] = {}, bytes_per_file: int | None = None
    ) -> subprocess.Popen[str]:
        """Begin `omninav …` in a process group of its own; what it prints goes to a pipe."""
        site = self.folder / "site"
        site.mkdir(parents=True, exist_ok=True)
        (site / "sitecustomize.py").write_text(SITE)
        path = os.pathsep.join([str(site), str(ROOT), str(self.folder)])
        settings = {**os.environ, "PYTHONPATH": path, "OPENBLAS_NUM_THREADS": "1", **environment}

        def limit() -> None:
            if bytes_per_file is not None:
                resource.setrlimit(resource.RLIMIT_FSIZE, (bytes_per_file, bytes_per_file))

        return subprocess.Popen(
            [sys.executable, "-m", "omninav", *words],
            cwd=self.folder,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=settings,
            start_new_session=True,
            preexec_fn=limit,
        )

    def run(self, words: tuple[str, ...]) -> Ended:
        """Run it to its end."""
        return ended(self.start(words))

    def disturb(self, words: tuple[str, ...], kind: str, wait: Callable[[subprocess.Popen[str]], None]) -> Ended:
        """Run it, and do this to it once `wait` has returned. `disturbed`: it had not ended by then."""
        chance = random.Random(f"{words} {time.monotonic_ns()}")
        if kind == "disk full":
            return ended(self.start(words, bytes_per_file=chance.choice([0, 1 << 10, 1 << 14, 1 << 17])), True)
        process = self.start(words, {CLOCK: "400000"} if kind == "clock set back" else {})
        wait(process)
        disturbed = process.poll() is None
        if disturbed and kind == "SIGSTOP":
            os.killpg(process.pid, signal.SIGSTOP)
            time.sleep(0.3)
            os.killpg(process.pid, signal.SIGCONT)
        elif disturbed:
            end = os.killpg if chance.random() < 0.5 else os.kill  # its own processes may live on for a moment
            end(process.pid, signal.SIGKILL if kind == "clock set back" else signal.Signals[kind])
        return ended(process, disturbed)


def ended(process: subprocess.Popen[str], disturbed: bool = False) -> Ended:
    """Wait for a process, and end its group with it."""
    try:
        output, _ = process.communicate(timeout=PATIENCE_S)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        output, _ = process.communicate()
        output += "\nTraceback (most recent call last): it hung"
    return Ended(process.returncode, output, disturbed)
