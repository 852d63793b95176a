"""What is printed, where it cannot be written."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import DRIVE, TOUR


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_a_full_standard_output_is_said_and_stops_nothing(unbuffered: str) -> None:
    with open("/dev/full", "wb") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "omninav", "--version"],
            stdout=full,
            stderr=subprocess.PIPE,
            encoding="utf-8",
            env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
            timeout=60,
        )
    said = "standard output: No space left on device; what was printed is lost, all else was done\n"
    assert (ended.returncode, ended.stderr) == (2, said)


@pytest.mark.parametrize("words", [(), ("-m", "seed=0,1", "hydra.sweep.dir=sweep")])
def test_a_run_whose_output_nobody_reads_goes_on(words: tuple[str, ...], tmp_path: Path, shared_cache: Path) -> None:
    reads, writes = os.pipe()
    os.close(reads)
    few = ("nodes.source.stop=4", "+artifacts.map.nodes.source.stop=12", f"cache={shared_cache}")
    command = [sys.executable, "-m", "omninav", f"tour={TOUR}", f"log={DRIVE}", *few, *words]
    ended = subprocess.run(command, cwd=tmp_path, stdout=writes, stderr=writes, timeout=300)
    os.close(writes)
    manifests = list(tmp_path.glob("sweep/?/manifest.json" if words else "runs/latest/manifest.json"))
    states = [json.loads(file.read_text())["status"] for file in manifests]
    assert (ended.returncode, states) == (0, ["complete"] * (2 if words else 1))


def test_jobs_run_where_standard_error_is_closed(tmp_path: Path, shared_cache: Path) -> None:
    few = f"tour={TOUR} log={DRIVE} nodes.source.stop=4 +artifacts.map.nodes.source.stop=12 cache={shared_cache}"
    command = f"exec '{sys.executable}' -m omninav -m {few} seed=0,1 executor=local hydra.sweep.dir=sweep 0<&- 2>&-"
    assert subprocess.run(["sh", "-c", command], cwd=tmp_path, stdout=-3, timeout=300).returncode == 0
