"""The result of an experiment as one file: verdicts, values and curves, from which its page and plots are made."""

import dataclasses
import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from omninav.pipeline.graph.ports import convert
from omninav.pipeline.graph.problems import BadInput, ProblemsFound
from omninav.pipeline.graph.small_files import read_small

from .intervals import Array
from .series import series_at
from .specification import Condition, Curve, Experiment, Labels, space_of
from .verdicts import Case, Results, Verdict, judge, key_of, over_runs, samples

SUFFIX = ".result.json"
"""End of a result file's name, after the experiment's name."""
MAX_BYTES = 20_000_000
"""Largest accepted result file, bytes. The longest of ours has 200 kB."""


@dataclass(frozen=True)
class Cell:
    """A measure of one condition, over its repetitions."""

    at: tuple[str, ...]
    """The condition's labels: of the table's rows, then of its columns."""
    figure: float | None = None
    """The mean, or the value that the measure judges."""
    spread: float | None = None
    """Standard deviation of the repetitions; of one repetition, or of a largest value, there is none."""
    median: float | None = None
    found: int = 0
    """Repetitions that have a value."""
    ran: int = 0
    """Repetitions that have run."""
    development: float | None = None
    """The value in the scenarios of development: their mean, or that of the worst."""


@dataclass(frozen=True)
class Line:
    """A curve of one condition: the mean of its repetitions, and the least and the largest of them, at each place."""

    name: str
    x: tuple[float, ...]
    mean: tuple[float, ...]
    low: tuple[float, ...] = ()
    """Empty where there is one repetition."""
    high: tuple[float, ...] = ()
    panel: str = ""
    reference: bool = False
    """True for a value that is equal in all conditions of a panel and drawn dashed."""


@dataclass(frozen=True)
class ConditionRow:
    """States of a condition: repetitions that have run, their size, and what was typed for it."""

    name: str
    done: str
    """Repetitions done, and of how many: `6/6`."""
    context: Mapping[str, Any] = field(default_factory=dict)
    overrides: str = ""


@dataclass(frozen=True)
class ExperimentResult:
    """Content of a result file. Titles and sentences are in the experiment's file and are joined to it by keys."""

    name: str
    """The experiment's name."""
    command: str
    profile: str
    made_with: str
    """Version and commit."""
    repeated: str
    """Number of runs of each condition, with their seeds and scenarios."""
    verdicts: Mapping[str, tuple[Case, ...]]
    """Key of a claim -> its cases."""
    cells: Mapping[str, tuple[Cell, ...]]
    """Measure -> its values, in the order of the table's rows and columns."""
    curves: tuple[tuple[Line, ...], ...] = ()
    """Lines of each of the file's curves; none in results that were kept without."""
    recordings: Mapping[str, str] = field(default_factory=dict)
    """Name of a recording -> what was stated of it."""
    conditions: tuple[ConditionRow, ...] = ()
    failures: Mapping[str, str] = field(default_factory=dict)
    """Condition -> why it failed."""
    missing: int = 0
    """Repetitions that are still to run."""
    common_overrides: tuple[str, ...] = ()
    """Overrides of all conditions."""

    def cell(self, measure: str, at: Sequence[str]) -> Cell:
        """A measure's value of one condition; one without a value where there is none."""
        return next((cell for cell in self.cells.get(measure, ()) if cell.at == tuple(at)), Cell(tuple(at)))

    def judged(self, experiment: Experiment) -> dict[str, Verdict]:
        """The verdict on each claim that the experiment's file has and this result judges, by its key."""
        return {key: Verdict(self.verdicts[key]) for key in experiment.claims if key in self.verdicts}


def rows_of(experiment: Experiment) -> list[Labels]:
    """The labels of the table's rows."""
    rows = experiment.page.rows
    return [dict(zip(rows, chosen, strict=True)) for chosen in itertools.product(*(experiment.labels(f) for f in rows))]


def summary_of(
    experiment: Experiment, results: Results, development: Results
) -> tuple[dict[str, tuple[Case, ...]], dict[str, tuple[Cell, ...]], tuple[tuple[Line, ...], ...]]:
    """Verdicts, cells and curves of what has run. Those of `development` are in the cells only."""
    verdicts = {key: verdict.cases for key, verdict in judge(experiment, results).items()}
    cells = {name: tuple(_cells(experiment, results, development, name)) for name in experiment.measures}
    return verdicts, cells, tuple(tuple(_lines(experiment, results, curve)) for curve in experiment.curves)


def _cells(experiment: Experiment, results: Results, development: Results, name: str) -> Iterator[Cell]:
    measure, by = experiment.measures[name], experiment.page.columns
    for labels, column in itertools.product(rows_of(experiment), experiment.labels(by)):
        here = labels | {by: column}
        at, ran = (*labels.values(), column), len(results.get(key_of(here), {}))
        found = list(samples(experiment, results, name, here).values())
        chosen_on = list(samples(experiment, development, name, here).values())
        beside = over_runs(measure, chosen_on) if chosen_on else None
        if not found:
            yield Cell(at, ran=ran, development=beside)
            continue
        spread = _spread(found) if len(found) > 1 and measure.over_runs == "mean" else None
        value, median = over_runs(measure, found), float(np.median(found))
        yield Cell(at, value, spread, median, len(found), ran, beside)


def _spread(values: Sequence[float]) -> float:
    """Standard deviation; 0 of values that are equal but for rounding."""
    spread = float(np.std(values))
    return spread if spread > 1e-9 * abs(float(np.mean(values))) else 0.0


def _lines(experiment: Experiment, results: Results, curve: Curve) -> Iterator[Line]:
    """A line for each condition, panel by panel; below those of a panel its reference lines."""
    conditions = [condition for condition in experiment.conditions() if condition.fits(curve.only)]
    shown = [f for f in experiment.sweep if f != curve.panels and f not in curve.only]
    for panel in experiment.labels(curve.panels) if curve.panels else [""]:
        common: dict[str, Line] = {}
        for condition in conditions:
            if curve.panels and condition.labels[curve.panels] != panel:
                continue
            runs = [run for run in results.get(key_of(condition.labels), {}).values() if run["metrics"]]
            for label, path in curve.reference.items():
                x, y = series_of(runs, path, curve.x_path)
                if len(x) and label not in common:
                    mean = curve.scale * np.nanmean(y, axis=0)
                    common[label] = Line(label, _floats(x), _floats(mean), panel=panel, reference=True)
            x, y = series_of(runs, curve.path, curve.x_path)
            if len(x):
                y = curve.scale * y
                band = (np.nanmin(y, axis=0), np.nanmax(y, axis=0)) if len(y) > 1 else ((), ())
                low, high = (_floats(edge) for edge in band)
                yield Line(_named(condition, shown), _floats(x), _floats(np.nanmean(y, axis=0)), low, high, panel)
        yield from common.values()


def _floats(values: Any) -> tuple[float, ...]:
    """Values of a curve, in six digits: no plot shows more."""
    return tuple(float(f"{value:.6g}") for value in values)


def _named(condition: Condition, factors: Sequence[str]) -> str:
    return ", ".join(condition.labels[factor] for factor in factors)


def series_of(runs: Sequence[Mapping[str, Any]], path: str, at_path: str = "") -> tuple[Array, Array]:
    """Positions of the entries of a series (N,), and the series of all runs that have it (runs, N); NaN where one ends.

    Entries that no run has a value for are left out.
    """
    found = [(series_at(space_of(run), path), series_at(space_of(run), at_path) if at_path else []) for run in runs]
    found = [(y, x or [float(n + 1) for n in range(len(y))]) for y, x in found if y]
    longest = max((len(y) for y, _ in found), default=0)
    filled = np.full((2, len(found), longest), np.nan)
    for row, (y, x) in enumerate(found):
        filled[0, row, : len(x)] = [np.nan if each is None else each for each in x[:longest]]
        filled[1, row, : len(y)] = [np.nan if each is None else each for each in y]
    there = np.isfinite(filled).any(axis=1).all(axis=0)
    return np.nanmean(filled[0][:, there], axis=0) if there.any() else np.empty(0), filled[1][:, there]


def result_text(result: ExperimentResult) -> str:
    """A result as JSON: one self-contained entry on each line, nothing that has its default."""
    parts = []
    for name, value in _stated(result).items():
        if isinstance(value, dict | list) and value:
            parts.append(f'"{name}": {_block(value, 1)}')
        else:
            parts.append(f'"{name}": {_dumped(value)}')
    return "{\n" + ",\n".join(f" {part}" for part in parts) + "\n}\n"


def _block(value: Any, depth: int) -> str:
    """A mapping or list with an entry on each line; lists in a mapping are divided once more."""
    indent = " " * (depth + 1)
    if isinstance(value, dict):
        lines = [
            f"{indent}{_dumped(key)}: {_block(each, depth + 1) if isinstance(each, list) else _dumped(each)}"
            for key, each in value.items()
        ]
        return "{\n" + ",\n".join(lines) + f"\n{' ' * depth}}}"
    return "[\n" + ",\n".join(f"{indent}{_dumped(each)}" for each in value) + f"\n{' ' * depth}]"


def _dumped(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False)


def _stated(value: Any) -> Any:
    """A dataclass as plain data, without fields that have their default."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {
            each.name: _stated(found)
            for each in dataclasses.fields(value)
            if (found := getattr(value, each.name)) != each.default
            and not (each.default_factory is not dataclasses.MISSING and found == each.default_factory())
        }
    if isinstance(value, Mapping):
        return {key: _stated(each) for key, each in value.items()}
    return [_stated(each) for each in value] if isinstance(value, list | tuple) else value


def read_result(path: Path) -> ExperimentResult:
    """The result that a file holds. Raises BadInput where it is none."""
    try:
        plain = json.loads(read_small(path, MAX_BYTES))
    except ValueError as error:
        raise BadInput(f"{path}: is no result of an experiment ({error}); its experiment makes it again") from None
    result, problems = convert(plain, ExperimentResult, str(path))
    if problems:
        raise ProblemsFound(problems)
    return result  # type: ignore[no-any-return]


def result_files(folder: Path) -> list[Path]:
    """The result files of a folder, by name. Raises BadInput where there are none."""
    files = sorted(folder.glob(f"*{SUFFIX}"))
    if not files:
        raise BadInput(f"{folder}: no result is in it; a run of an experiment leaves NAME{SUFFIX} in its folder")
    return files
