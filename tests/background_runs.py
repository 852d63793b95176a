"""Runs of the command line in the background: left to end, or killed on their way."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path


def start(place: Path, *words: str) -> subprocess.Popen[bytes]:
    """Begins `omninav …` in a folder, which is made, in a process group of its own."""
    place.mkdir(exist_ok=True)
    command = [sys.executable, "-m", "omninav", *words]
    return subprocess.Popen(
        command, cwd=place, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def kill(process: subprocess.Popen[bytes]) -> None:
    """Kills it, and what it has started, as `kill -9` does."""
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


def wait_for_checkpoint(process: subprocess.Popen[bytes], place: Path) -> None:
    """Returns once a run in that folder could be resumed, or is over."""
    while process.poll() is None and not any(place.glob("runs/*/checkpoints/**/checkpoint")):
        time.sleep(0.02)


def finished(place: Path, *words: str) -> Path:
    """The folder of a run that was left to end."""
    assert start(place, *words).wait(timeout=900) == 0
    return place / "runs" / "latest"


def killed_and_resumed(place: Path, *words: str, after_s: float) -> Path:
    """The folder of a run that was killed `after_s` after its first checkpoint, and resumed."""
    process = start(place, *words)
    wait_for_checkpoint(process, place)
    time.sleep(after_s)
    assert process.poll() is None, "it was over before it could be killed"
    kill(process)
    return finished(place, "resume", "runs/latest")


def assert_same_bytes(run: Path, whole: Path, *names: str) -> None:
    """Whether these files of two runs are the same."""
    for name in names:
        assert (run / name).read_bytes() == (whole / name).read_bytes(), name
