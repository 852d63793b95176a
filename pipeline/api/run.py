"""Runs: started, and opened when they have ended."""

import io
import os
import shlex
from collections.abc import Sequence
from html import escape
from pathlib import Path
from typing import Any

from omninav.pipeline.cli.jobs import no_run_in
from omninav.pipeline.engine.artifact import read_artifact
from omninav.pipeline.engine.disk_sequence import DiskSequence
from omninav.pipeline.files import Damaged, read_json
from omninav.pipeline.graph.problems import BadInput, suggest
from omninav.pipeline.graph.small_files import read_mapping
from omninav.pipeline.graph.value import Value
from omninav.pipeline.report.headlines import headline_rows
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.run.execution import execute
from omninav.pipeline.run.metrics_files import MANIFEST, read_metrics, read_timing, refuse_experiment
from omninav.pipeline.run.prepared_run import load_stages
from omninav.pipeline.run.run_folder import CONFIG, recorded_name, start
from omninav.pipeline.tables import read_table

from .configuration import Configuration, configured
from .plain_errors import plain_errors
from .read_only import read_only


class NestedValues(dict[str, Any]):
    """The values of `metrics.json`: nested, and by path too: `values["some_error_m.median"]`."""

    def __missing__(self, path: str) -> Any:
        inside: Any = dict(self)
        for name in str(path).split("."):
            if not isinstance(inside, dict) or name not in inside:
                known = inside if isinstance(inside, dict) else ()
                raise KeyError(f"no metric '{path}'; {suggest(name, known, 'metrics')}")
            inside = inside[name]
        return inside

    def __contains__(self, path: object) -> bool:
        nothing = object()
        return self.get(path, nothing) is not nothing

    def get(self, path: Any, default: Any = None) -> Any:
        """The value at a path, as `values[path]` gives it; `default` where there is none."""
        try:
            return self[path]
        except KeyError:
            return default


class Run:
    """A run's folder, as Python sees it. In a notebook it shows its results.

    Every `.omap` file in its folder is an attribute by the file's name: what the run used or made.
    """

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        self.folder = Path(os.path.realpath(folder))
        """Folder of its files."""
        if not (self.folder / MANIFEST).is_file():
            jobs = [file.parent.name for file in self.folder.glob(f"*/{MANIFEST}")]
            if (self.folder / "sweep.html").is_file() and jobs:
                job = Path(folder) / min(jobs, key=lambda job: (len(job), job))
                raise BadInput(
                    f"{folder}: a sweep, not a run folder; name a job of it, such as {shlex.quote(str(job))}"
                )
            refuse_experiment(self.folder)
            raise BadInput(f"{folder}: not a run folder (no {MANIFEST}); `ls runs` shows what there is")

    @property
    def manifest(self) -> dict[str, Any]:
        """Manifest: command, versions, inputs, seed, status, skipped data."""
        try:
            return read_json(self.folder / MANIFEST)
        except Damaged as damaged:
            raise BadInput(str(damaged)) from None

    @property
    def status(self) -> str:
        """`complete`, `running`, `failed` or `interrupted`."""
        return str(self.manifest.get("status"))

    @property
    def settings(self) -> dict[str, Any]:
        """Its whole configuration."""
        return read_mapping(self.folder / CONFIG)

    @property
    def metrics(self) -> NestedValues:
        """Its metrics; `metrics["some_error_m.median"]`."""
        return NestedValues(read_metrics(self.folder).values)

    @property
    def frames(self) -> Any:
        """A row for every frame: a `pandas.DataFrame` where pandas is installed, else a `pyarrow.Table`.

        `runs/README.md` describes the columns.
        """
        return read_table(self._file("frames.parquet"))

    @property
    def trajectory(self) -> Any:
        """The rows and columns of `frames` with the estimate: `stamp_ns` and `estimate_…`."""
        return read_table(self._file("frames.parquet"), lambda name: name == "stamp_ns" or name.startswith("estimate_"))

    @property
    def report(self) -> Path:
        """The page that shows it."""
        return self._file("report.html")

    @property
    def recorded(self) -> list[str]:
        """Outputs of which `values` has every frame's."""
        return sorted(file.name.removesuffix(recorded_name("")) for file in self.folder.glob(recorded_name("*")))

    def values(self, origin: str) -> Sequence[Any]:
        """Values of an output (`match.similarities`) in every frame, None where it gave none; read when looked at.

        A run keeps it on request: `record=[match.similarities]`.
        """
        file = self.folder / recorded_name(origin)
        if not file.is_file():
            there = f"recorded are: {', '.join(self.recorded)}" if self.recorded else "nothing was recorded"
            raise BadInput(f"{self.folder}: no values of {origin}, {there}; run it again with record=[{origin}]")
        load_stages(self.settings)
        return DiskSequence(file, append=False)

    def __getattr__(self, name: str) -> Value:
        file = self.__dict__.get("folder", Path()) / f"{name}.omap"
        if name.startswith("_") or not file.is_file():
            files = [path.stem for path in file.parent.glob("*.omap")]
            raise AttributeError(f"{self.__dict__.get('folder')}: there is no {name}; {suggest(name, files, 'files')}")
        return load_artifact(file)

    def __dir__(self) -> list[str]:
        return [*super().__dir__(), *(path.stem for path in self.folder.glob("*.omap"))]

    def _file(self, name: str) -> Path:
        file = self.folder / name
        if not file.is_file():
            hint = f"`omninav resume {shlex.quote(str(self.folder))}` continues a run that did not end"
            if self.status == "complete":
                hint = f"a complete run of {self.manifest.get('variant')} leaves none, or it was removed"
            raise BadInput(f"{self.folder}: no {name} in it; {hint}")
        return file

    def __repr__(self) -> str:
        return f"Run({str(self.folder)!r}: {self.manifest.get('variant')}, {self.status})"

    def __str__(self) -> str:
        """Its headlines."""
        from rich.console import Console

        from omninav.pipeline.report.terminal_tables import key_table

        text = io.StringIO()
        Console(file=text, width=100, force_jupyter=False).print(
            key_table(read_metrics(self.folder), read_timing(self.folder))
        )
        return text.getvalue()

    def _repr_html_(self) -> str:
        name, folder = escape(self.folder.name), escape(str(self.folder))
        head = f"<p><b>{name}</b> {escape(self.status)}, <code>{folder}</code></p>"
        if not (self.folder / "metrics.json").is_file():
            return head
        rows = (
            f'<tr><td style="text-align:left">{escape(row.name)}</td><td>{escape(row.text)}</td></tr>'
            for row in headline_rows(read_metrics(self.folder), read_timing(self.folder))
        )
        return f"{head}<table>{''.join(rows)}</table>"


@plain_errors()
def run(
    *words: "str | Configuration",
    folder: str | os.PathLike[str] | None = None,
    progress: bool = True,
    **settings: Any,
) -> Run:
    """Run a configuration to its end: `run("some_variant", log="drive.mcap", seed=3)`.

    Words and settings are those of `compose`, or a configuration comes first. `folder`: where its files are left; None:
    a new one in `runs`. `progress`: whether it shows its progress on standard error. Raises `ProblemsFound`,
    `BadInput`, or `StageFailed` where a stage raised.
    """
    made = configured(words, settings)
    place = None if folder is None else no_run_in(Path(folder), "folder")
    begun = start(made.prepared, ["omninav", *made.words], place)
    with Progress() as shown:
        execute(begun, made.prepared, shown if progress else None)
    return Run(begun.folder)


def open_run(folder: str | os.PathLike[str] = "runs/latest") -> Run:
    """A run that has ended, or is still running, by its folder."""
    return Run(folder)


def load_artifact(file: str | os.PathLike[str]) -> Value:
    """The value in an `.omap` file, checked; its arrays are read-only (`np.array(…)` copies one).

    A large array is read, and checked, where it is needed. Raises `BadInput` naming the file where it is missing, cut
    or changed, and where its content is not a valid value.
    """
    loaded: Value = read_only(read_artifact(Path(file)))
    return loaded
