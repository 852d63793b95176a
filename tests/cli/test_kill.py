"""`kill -9` at any moment, then `omninav resume`: the same bytes as the unbroken run."""

import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

FILES = ("trajectory.tum", "metrics.json", "map.omap")


def start(place: Path, *words: str) -> subprocess.Popen[bytes]:
    command = [sys.executable, "-m", "omninav.pipeline", *words]
    return subprocess.Popen(
        command, cwd=place, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True
    )


def stop(process: subprocess.Popen[bytes]) -> None:
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()


@pytest.mark.parametrize("cached", [True, False])
def test_a_killed_run_resumes_to_the_same_bytes(tmp_path: Path, demo: Path, shared_cache: Path, cached: bool):
    """Kills at moments spread over the whole run, again and again, until a resume comes through."""
    moments = random.Random(5 if cached else 6)
    cache = f"cache={shared_cache}" if cached else "cache=null"
    process = start(tmp_path, cache, "checkpoint_s=0.05")
    runs = tmp_path / "runs"
    while not list(runs.glob("*/checkpoints/checkpoint")) and not list(runs.glob("*/checkpoints/*/checkpoint")):
        time.sleep(0.02)
        if process.poll() is not None:
            break
    kills = 0
    while process.poll() is None and kills < 3:
        time.sleep(moments.uniform(0.0, 4.0))
        if process.poll() is None:
            stop(process)
            kills += 1
            (runs / "latest" / "result.mcap.1.part").write_bytes(b"half")  # as if killed while that file was written
            process = start(tmp_path, "resume", "runs/latest")
    assert kills > 0
    assert process.wait() == 0
    for name in FILES:
        assert (runs / "latest" / name).read_bytes() == (demo / name).read_bytes(), name
    assert not (runs / "latest" / "checkpoints").exists()
    assert not list((runs / "latest").glob("*.part"))
