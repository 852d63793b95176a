"""A disk that is full: the run says which file, and a cache that is full is no error of the run."""

import errno
import os
import resource
from pathlib import Path

import numpy as np
import pytest
from conftest import DRIVE, TOUR

import omninav
from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.engine.disk_sequence import DiskSequence
from omninav.pipeline.engine.engine import Engine
from omninav.pipeline.graph.problems import as_bad_input


def test_a_full_disk_names_the_file_that_it_could_not_take(tmp_path: Path) -> None:
    sequence = DiskSequence(tmp_path / "match.similarities.sequence")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, before[1]))
    try:
        with pytest.raises(OSError, match=r"match\.similarities\.sequence") as full:
            sequence.append(np.zeros(100_000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert full.value.errno == errno.EFBIG


def test_a_full_cache_is_said_and_the_run_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    keep = Cache.keep

    def full(cache: Cache, key: str, suffix: str, notes: object = None) -> object:
        if cache.folder == tmp_path / "cache":
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(cache.path(key, suffix)))
        return keep(cache, key, suffix, notes)

    monkeypatch.setattr(Cache, "keep", full)
    words = {"tour": TOUR, "log": DRIVE, "cache": tmp_path / "cache", "nodes.source.stop": 3, "progress": False}
    run = omninav.run("plain_matching", folder=tmp_path / "run", **words)
    assert run.status == "complete"
    assert len(run.map) > 0
    said = capsys.readouterr().err
    assert f"cache: {tmp_path}/cache/" in said
    assert "No space left on device; results are not kept there: free some space, or type cache=FOLDER" in said


def test_a_cache_that_one_may_not_write_is_said_once_and_read(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def refused(path: Path, *given: object) -> object:
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    words = {"tour": TOUR, "log": DRIVE, "cache": tmp_path / "cache", "nodes.source.stop": 3, "progress": False}
    omninav.run("plain_matching", folder=tmp_path / "first", **words)
    for name in ("locked", "whole_file", "write_whole"):
        monkeypatch.setattr(f"omninav.pipeline.engine.cache.{name}", refused)
    run = omninav.run("plain_matching", "match=l2", folder=tmp_path / "run", **words)
    assert run.manifest["artifacts"]["map"]["reason"].startswith("found")
    said = f"cache: {tmp_path}/cache: Permission denied; results are not kept there: type cache=FOLDER"
    assert capsys.readouterr().err.splitlines().count(said) == 1


def test_a_copy_to_a_full_disk_names_the_file_that_it_makes(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    copied = OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), "run/prefix.sequence", None, str(tmp_path / "a.prefix"))
    with Cache(tmp_path).unless_full():
        raise copied
    assert f"cache: {tmp_path}/a.prefix: No space left on device" in capsys.readouterr().err
    assert str(as_bad_input(copied)).startswith(f"{tmp_path}/a.prefix: No space left on device; free some space")


def test_a_full_disk_that_names_no_file_names_the_runs_folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> bool:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(Engine, "tick", full)
    words = {"tour": TOUR, "log": DRIVE, "cache": None, "nodes.source.stop": 3, "progress": False}
    said = "No space left on device; free some space; `omninav resume"
    with pytest.raises(omninav.BadInput, match=f"{tmp_path}/run: {said} {tmp_path}/run` continues the run"):
        omninav.run("plain_matching", folder=tmp_path / "run", **words)
    monkeypatch.undo()
    monkeypatch.setattr("omninav.stages.match.selective.SelectiveMatch.compare", full)
    with pytest.raises(omninav.BadInput, match=rf"stage 'match' .*{said}` continues the run"):
        omninav.run("plain_matching", folder=tmp_path / "another", **words)


def test_what_a_run_leaves_that_never_began_is_in_nobodys_way(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(graph: object) -> str:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    words = {"tour": TOUR, "log": DRIVE, "cache": None, "nodes.source.stop": 3, "progress": False}
    monkeypatch.setattr("omninav.pipeline.run.run_folder.svg", full)
    with pytest.raises(omninav.BadInput, match="No space left on device"):
        omninav.run("plain_matching", folder=tmp_path / "run", **words)
    assert (tmp_path / "run" / "config.yaml").is_file()
    monkeypatch.undo()
    assert omninav.run("plain_matching", folder=tmp_path / "run", **words).status == "complete"


def test_an_error_of_the_cache_that_is_no_full_disk_is_one(tmp_path: Path) -> None:
    with pytest.raises(OSError, match="no such"), Cache(tmp_path).unless_full():
        raise OSError(errno.EIO, "no such")
