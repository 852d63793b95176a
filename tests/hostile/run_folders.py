"""Folders of runs that were stopped, and the cache: with damage a run ends at the same bytes, or in one line."""

import functools
import os
import shutil
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr
from io import StringIO
from pathlib import Path
from typing import Any

from toy_runs import Stop, noisy_sum

from omninav.pipeline.run.execution import execute
from omninav.pipeline.run.prepared_run import PreparedRun, prepare_run
from omninav.pipeline.run.resume import resume
from omninav.pipeline.run.run_folder import start

from .harness import Format, Wrong
from .mutations import BINARY, TEXT, Files, on


def prepared(cache: Path | None = None) -> PreparedRun:
    """A small graph with state, random numbers and a sequence."""
    return prepare_run(noisy_sum(Path("runs"), **({"cache": str(cache)} if cache else {})))


@contextmanager
def inside(folder: Path) -> Iterator[None]:
    """Work in a folder, with what is said on the way kept quiet."""
    before = Path.cwd()
    os.chdir(folder)
    try:
        with redirect_stderr(StringIO()):
            yield
    finally:
        os.chdir(before)


@functools.cache
def _whole() -> bytes:
    """The metrics of a run that was never stopped."""
    with tempfile.TemporaryDirectory() as scratch, inside(Path(scratch)):
        run = start(prepared(), ["omninav", "variant=toy"], Path("run"))
        execute(run, prepared())
        return Path("run", "metrics.json").read_bytes()


@functools.cache
def stopped() -> Sequence[Files]:
    """The files of a run that was stopped."""
    with tempfile.TemporaryDirectory() as scratch, inside(Path(scratch)):
        run = start(prepared(), ["omninav", "variant=toy"], Path("run"))
        try:
            execute(run, prepared(), Stop())
        except KeyboardInterrupt:
            return [_files(Path("run"))]
    raise AssertionError("it was not stopped")


@functools.cache
def cached() -> Sequence[Files]:
    """The files of a cache that a run has filled."""
    with tempfile.TemporaryDirectory() as scratch, inside(Path(scratch)):
        execute(start(prepared(Path("cache")), ["omninav"], Path("run")), prepared(Path("cache")))
        return [_files(Path("cache"))]


def _files(folder: Path) -> Files:
    found = {str(path.relative_to(folder)): path for path in sorted(folder.rglob("*")) if path.is_file()}
    return {name: path.read_bytes() for name, path in found.items()}


def resumed(folder: Path, files: Files) -> Any:
    """Go on with the run."""
    expected = _whole()
    with inside(folder):
        resume(folder)
    if (folder / "metrics.json").read_bytes() != expected:
        raise Wrong("it ended at other bytes")


def run_with_cache(folder: Path, files: Files) -> Any:
    """A run that finds this cache."""
    expected = _whole()
    with inside(folder):
        shutil.rmtree(folder.parent / "run", ignore_errors=True)
        run = start(prepared(folder), ["omninav"], folder.parent / "run")
        execute(run, prepared(folder))
    if (run.folder / "metrics.json").read_bytes() != expected:
        raise Wrong("it ended at other bytes")


RUN = Format("run folder", stopped, [on(BINARY), on(TEXT, ".json", ".yaml")], resumed, cases=15)
CACHE = Format("cache", cached, [on(BINARY)], run_with_cache, cases=40)
