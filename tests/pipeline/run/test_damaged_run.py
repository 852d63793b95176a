"""What a resume reads is checked: damage gives the same bytes or one line, and a run has one owner."""

import os
import random
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path

import pytest
from toy_runs import Stop, begun, ended, noisy_sum

from omninav.pipeline.engine import damage
from omninav.pipeline.files import read_json
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.run.execution import execute
from omninav.pipeline.run.prepared_run import prepare_run
from omninav.pipeline.run.resume import resume
from omninav.pipeline.run.run_folder import RunFolder


@pytest.fixture(autouse=True)
def in_its_place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)  # a run goes on where it was started
    monkeypatch.setattr(damage, "_shown", set())


@pytest.fixture
def complete(tmp_path: Path) -> RunFolder:
    """A run that was never stopped."""
    return ended(noisy_sum(tmp_path / "whole"))


@pytest.fixture
def whole(complete: RunFolder) -> bytes:
    """Its metrics."""
    return (complete.folder / "metrics.json").read_bytes()


@pytest.fixture
def stopped(tmp_path: Path) -> RunFolder:
    stopping = noisy_sum(tmp_path / "stopped")
    run = begun(stopping)
    with pytest.raises(KeyboardInterrupt):
        execute(run, prepare_run(stopping), Stop())
    return run


def files_of(folder: Path) -> Iterator[str]:
    """The files that a resume may read."""
    yield from (str(path.relative_to(folder)) for path in sorted(folder.rglob("*")) if path.is_file())


def damaged(run: RunFolder, name: str, seed: int) -> RunFolder:
    """A copy of a run folder in which one bit of a file is flipped, or its end is gone."""
    folder = run.folder.with_name(f"damaged_{seed}_{name.replace('/', '_')}")
    shutil.copytree(run.folder, folder)
    content, chance = bytearray((folder / name).read_bytes()), random.Random(f"{name} {seed}")
    if content and seed:
        content[chance.randrange(len(content))] ^= 1 << chance.randrange(8)
    (folder / name).write_bytes(content if seed else content[: len(content) // 2])
    return RunFolder(folder)


def test_a_stopped_run_with_any_damage_ends_at_the_same_bytes(stopped: RunFolder, whole: bytes):
    names = list(files_of(stopped.folder))
    assert {"checkpoints/checkpoint", "checkpoints/start", "checkpoints/sum.number.sequence"} <= set(names)
    for name in names:
        for seed in range(3):
            run = damaged(stopped, name, seed)
            resume(run.folder)
            assert (run.folder / "metrics.json").read_bytes() == whole, (name, seed)
            assert read_json(run.folder / "manifest.json")["status"] == "complete"


@pytest.mark.parametrize("names", [("manifest.json", "checkpoints/start"), ("config.yaml", "checkpoints/start")])
def test_a_run_of_which_too_much_is_damaged_is_refused_in_one_line(stopped: RunFolder, names: tuple[str, str]):
    run = damaged(damaged(stopped, names[0], 1), names[1], 1)
    with pytest.raises(BadInput, match=f"{names[0]} is damaged.* start ") as refused:
        resume(run.folder)
    assert "\n" not in str(refused.value)


def test_a_complete_run_with_any_damage_is_made_again_or_refused_in_one_line(complete: RunFolder, whole: bytes):
    for name in files_of(complete.folder):
        run = damaged(complete, name, 1)
        with pytest.raises(BadInput) if name in ("config.yaml", "manifest.json") else nullcontext():
            resume(run.folder)
        assert (run.folder / "metrics.json").read_bytes() == whole, name


def test_damage_is_said_once_and_where_it_is(stopped: RunFolder, capfd: pytest.CaptureFixture[str]):
    file = stopped.memory / "sum.number.sequence"
    file.write_bytes(file.read_bytes().replace(b"toys.Number", b"toys.number", 1))
    resume(stopped.folder)
    said = capfd.readouterr().err
    assert said.count("sum.number.sequence is damaged: the checksum of the record at byte 0 does not fit") == 1
    assert "begins again at its first tick" in said


def test_a_run_that_a_living_process_owns_is_refused_by_its_number(stopped: RunFolder):
    hold = (
        "import sys\nfrom pathlib import Path\nfrom omninav.pipeline.run.run_folder import RunFolder\n"
        f"with RunFolder(Path({str(stopped.folder)!r})).owned():\n    print('owned', flush=True)\n    sys.stdin.read()"
    )
    owner = subprocess.Popen([sys.executable, "-c", hold], stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert owner.stdout is not None
    owner.stdout.readline()
    with pytest.raises(BadInput, match=f"process {owner.pid} is running it; wait until it has ended"):
        resume(stopped.folder)
    assert read_json(stopped.folder / "manifest.json")["status"] == "interrupted"
    owner.kill()
    owner.wait()
    resume(stopped.folder)
    assert read_json(stopped.folder / "manifest.json")["status"] == "complete"


@pytest.mark.parametrize("link", [os.symlink, os.link])
@pytest.mark.parametrize("name", [".lock", "run.log", "checkpoints/sum.number.sequence"])
def test_nothing_is_written_through_a_link(stopped: RunFolder, tmp_path: Path, name: str, link: object):
    elsewhere = tmp_path / "elsewhere"
    elsewhere.write_text("mine")
    (stopped.folder / name).unlink()
    link(elsewhere, stopped.folder / name)  # type: ignore[operator]
    with pytest.raises(OSError, match="delete it"):
        resume(stopped.folder)
    assert elsewhere.read_text() == "mine"


def test_a_sequence_that_does_not_hold_every_tick_stops_the_run(stopped: RunFolder, monkeypatch: pytest.MonkeyPatch):
    """As two processes in one folder would have left it."""
    from omninav.pipeline.engine.disk_sequence import DiskSequence

    append = DiskSequence.append

    def twice(sequence: DiskSequence, value: object) -> None:
        append(sequence, value)
        append(sequence, value)

    monkeypatch.setattr(DiskSequence, "append", twice)
    with pytest.raises(BadInput, match=r"has 14 values, and there were 10 ticks"):
        resume(stopped.folder)
    assert read_json(stopped.folder / "manifest.json")["status"] == "failed"
