"""Sweeps: many runs of settings in all combinations, and what came of them as tables."""

import os
import sys
import threading
from contextlib import ExitStack, redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any

from omninav.pipeline.cli.arguments import number_of, value_text
from omninav.pipeline.cli.commands.run import command
from omninav.pipeline.cli.hydra_session import ALONE
from omninav.pipeline.cli.overrides import MAX_JOBS
from omninav.pipeline.graph.problems import BadInput, counted
from omninav.pipeline.tables import read_table

from .arguments import arguments_of
from .plain_errors import plain_errors
from .run import Run


class Sweep:
    """A sweep's folder, as Python sees it. In a notebook it shows its means."""

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(os.path.realpath(folder))
        """Folder of its jobs' folders."""
        if not (self.folder / "sweep.parquet").is_file():
            raise BadInput(f"{folder}: not a sweep's folder (no sweep.parquet); `ls runs` shows what there is")

    @property
    def jobs(self) -> Any:
        """A row for every job: number, status, what it overrides, and all its metrics by path.

        A `pandas.DataFrame` where pandas is installed, else a `pyarrow.Table`.
        """
        return read_table(self.folder / "sweep.parquet")

    @property
    def means(self) -> Any:
        """A row for every condition: what it overrides, how many jobs (seeds) ended well, and for each metric its
        mean over them and the ends `.low` and `.high` of that mean's 95 % interval.
        """
        return read_table(self.folder / "sweep_means.parquet")

    @property
    def runs(self) -> list[Run]:
        """Its runs, in the order of the jobs."""
        folders = [file.parent for file in self.folder.glob("*/manifest.json")]
        return [Run(folder) for folder in sorted(folders, key=lambda folder: (len(folder.name), folder.name))]

    @property
    def report(self) -> Path:
        """The page that shows it."""
        return self.folder / "sweep.html"

    def __repr__(self) -> str:
        return f"Sweep({str(self.folder)!r}: {counted(len(self.runs), 'job')})"

    def _repr_html_(self) -> str:
        means = self.means
        return str(means._repr_html_() if hasattr(means, "_repr_html_") else f"<pre>{means}</pre>")


@plain_errors()
def sweep(*words: str, folder: str | os.PathLike[str] | None = None, progress: bool = True, **settings: Any) -> Sweep:
    """Run all combinations: `sweep("some_variant", "match=selective,l2", seed=range(5))`.

    A word with commas, and a keyword that is a list, tuple or range, mean several values; everything else is as in
    `compose`. `folder`: where its jobs are left; None: a new one in `runs`. `progress`: whether it shows its progress.
    A job that fails is marked as failed in the table, and the others continue. Raises `BadInput` where none could
    begin.
    """
    fixed = {name: value for name, value in settings.items() if not isinstance(value, list | tuple | range)}
    swept = [f"{name}={_values(name, values)}" for name, values in settings.items() if name not in fixed]
    place = [f"hydra.sweep.dir={value_text(Path(folder))}"] if folder else []
    made: list[Path] = []
    before = sys.argv
    try:
        with ALONE, ExitStack() as quiet:
            if not progress:
                quiet.enter_context(redirect_stdout(_Quiet(sys.stdout)))
                quiet.enter_context(redirect_stderr(_Quiet(sys.stderr)))
            command(["-m", *arguments_of(words, fixed), *swept, *place], on_sweep=made.append)
    finally:
        sys.argv = before  # the manifests of jobs record it
    if not made:
        raise BadInput(f"{' '.join(words):.80}: a flag that shows something runs no sweep; leave it out")
    return Sweep(made[0])


class _Quiet:
    """A stream without what the thread that makes it writes: others print meanwhile."""

    def __init__(self, stream: Any) -> None:
        self._stream, self._thread = stream, threading.get_ident()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def write(self, text: str) -> Any:
        """Write what another thread writes."""
        return len(text) if threading.get_ident() == self._thread else self._stream.write(text)


def _values(name: str, values: list[Any] | tuple[Any, ...] | range) -> str:
    number = number_of(values)
    if not 1 <= number <= MAX_JOBS:
        raise BadInput(f"{name}: a sweep of {number:,} values, expected 1 to {MAX_JOBS:,}")
    if isinstance(values, range):
        return f"range({values.start},{values.stop},{values.step})"
    return ",".join(map(value_text, values))


def open_sweep(folder: str | os.PathLike[str]) -> Sweep:
    """A sweep that was run before, by its folder."""
    return Sweep(folder)
