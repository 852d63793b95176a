"""Runs of the command line: in this process, or in the background and killed on their way."""

import glob
import io
import os
import shutil
import signal
import subprocess
import sys
import time
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

from omninav.pipeline.cli.main import main
from omninav.pipeline.engine.engine import Engine
from omninav.pipeline.graph.registry import built_in


def run_here(place: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """Runs `omninav …` in a folder and in this process, which has imported everything already."""
    out, err = (io.TextIOWrapper(io.BytesIO(), "utf-8") for _ in range(2))
    environment = patch.dict(os.environ, COLUMNS="120"), patch("sys.argv", ["omninav", *words])
    with chdir(place), environment[0], environment[1], redirect_stdout(out), redirect_stderr(err):
        code = main(words)
    for stream in (out, err):
        stream.seek(0)
    return subprocess.CompletedProcess(words, code, out.read(), err.read())


def finished(place: Path, *words: str) -> Path:
    """The folder of a run that was left to end."""
    place.mkdir(exist_ok=True)
    ended = run_here(place, *words)
    assert ended.returncode == 0, ended.stdout + ended.stderr
    return place / "runs" / "latest"


def start(place: Path, *words: str) -> subprocess.Popen[bytes]:
    """Begins `omninav …` in a folder, which is made, in a process group of its own."""
    place.mkdir(exist_ok=True)
    list(built_in())  # a checkpoint's values are read by the modules that define them
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
    # Path.glob raises where a folder is renamed meanwhile, as that of a run that ends is.
    there = f"{place}/runs/*/checkpoints/**/checkpoint"
    while process.poll() is None and not any(glob.iglob(there, recursive=True, include_hidden=True)):
        time.sleep(0.02)


def whole_and_resumed(place: Path, *words: str, ticks: int) -> tuple[Path, Path]:
    """The folders of a run that was left to end, and of what `kill -9` would have left of it on its way, resumed.

    Its folder is copied two ticks after a checkpoint at that many ticks. Graphs whose checkpoints lie elsewhere, as
    those of a map that is kept in a cache, do not count.
    """
    copy, tick = place.with_name(f"{place.name}_killed"), Engine.tick

    def ticked(engine: Engine) -> bool:
        goes_on, memory = tick(engine), engine.options.memory
        if goes_on and memory is not None and memory.is_relative_to(place) and not copy.exists():
            if engine.ticks == ticks:
                engine.save()
            elif engine.ticks == ticks + 2:
                shutil.copytree(place / "runs", copy / "runs", symlinks=True)
        return goes_on

    with patch.object(Engine, "tick", ticked):
        whole = finished(place, *words)
    return whole, finished(copy, "resume", "runs/latest")


def assert_same_bytes(run: Path, whole: Path, *names: str) -> None:
    """Whether these files of two runs are the same."""
    for name in names:
        assert (run / name).read_bytes() == (whole / name).read_bytes(), name
