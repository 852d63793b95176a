"""A sweep as tables: a line per job, and a line per condition with means over its seeds and their intervals."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from omninav.pipeline.tables import write_table

from .metrics import MetricValue, head_of, headline_paths, metric_values, with_unit

SEED = "seed"
"""The setting over which means are taken."""


@dataclass(frozen=True)
class Mean:
    """The mean of a metric over seeds with its 95 % interval (Student's t); without an interval for a single seed."""

    mean: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Row:
    """A condition as people read it: a text for each setting that varies and for each metric."""

    settings: tuple[str, ...]
    jobs: int
    cells: tuple[str, ...]


@dataclass(frozen=True)
class Overview:
    """A sweep as people read it."""

    settings: tuple[str, ...]
    """Names of the settings that vary, but the seed."""
    seeds: bool
    """Whether the seed varies."""
    constant: tuple[str, ...]
    """Overrides of all jobs alike, as they were typed."""
    paths: tuple[str, ...]
    """Headlines, but those that are the same in all jobs."""
    heads: tuple[str, ...]
    """Their names and units."""
    same: tuple[str, ...]
    """Those that are the same in all jobs, each with its name and unit."""
    conditions: tuple[Row, ...]


@dataclass(frozen=True)
class Condition:
    """Jobs that differ in nothing but the seed: their settings, how many ended well, and means by path."""

    settings: dict[str, str]
    jobs: int
    means: dict[str, Mean]


def settings_of(manifest: Mapping[str, Any]) -> dict[str, str]:
    """Overrides of a job, as name and value; older sweeps wrote them as one text."""
    given = manifest.get("overrides", ())
    words = given.split() if isinstance(given, str) else map(str, given)
    return {name.lstrip("+~"): value for name, _, value in (word.partition("=") for word in words)}


def conditions(rows: Sequence[Mapping[str, Any]]) -> list[Condition]:
    """Jobs by what they override beside the seed, in the order in which these first come; rows as on the page."""
    found: dict[tuple[tuple[str, str], ...], list[dict[str, MetricValue]]] = {}
    for row in rows:
        settings = settings_of(row["manifest"])
        settings.pop(SEED, None)
        jobs = found.setdefault(tuple(settings.items()), [])
        if row["metrics"] is not None:
            jobs.append(metric_values(row["metrics"]))
    return [Condition(dict(settings), len(jobs), _means(jobs)) for settings, jobs in found.items()]


def overview_of(rows: Sequence[Mapping[str, Any]]) -> Overview:
    """A sweep as people read it, of rows as on the page."""
    typed = [settings_of(row["manifest"]) for row in rows]
    values = {name: {one.get(name) for one in typed} for name in dict.fromkeys(name for one in typed for name in one)}
    varied = tuple(name for name, those in values.items() if len(those) > 1)
    settings = tuple(name for name in varied if name != SEED)
    runs = [row["metrics"] for row in rows if row["metrics"] is not None]
    measured = [metric_values(run) for run in runs]
    every = [path for path in headline_paths(runs) if any(path in run for run in measured)]
    same = [p for p in every if len(measured) > 1 and len({run[p].text if p in run else "" for run in measured}) == 1]
    paths = tuple(path for path in every if path not in same)
    return Overview(
        settings,
        SEED in varied,
        tuple(f"{name}={typed[0][name]}" for name in values if name not in varied),
        paths,
        tuple(head_of(path, measured) for path in paths),
        tuple(_stated(next(run[path] for run in measured if path in run)) for path in same),
        tuple(
            Row(
                tuple(each.settings.get(name, "") for name in settings),
                each.jobs,
                tuple(_shown(each.means.get(path), path, measured) for path in paths),
            )
            for each in conditions(rows)
        ),
    )


def _stated(value: MetricValue) -> str:
    return f"{value.name}: {with_unit(*value.metric.in_words(value.value))}"


def _shown(mean: Mean | None, path: str, runs: Sequence[Mapping[str, MetricValue]]) -> str:
    if mean is None:
        return ""
    metric = next(run[path] for run in runs if path in run).metric
    if mean.low is None or mean.high is None:
        return metric.text(mean.mean)
    low, high = mean.mean - mean.low, mean.high - mean.mean
    if math.isclose(low, high, rel_tol=1e-9, abs_tol=1e-12):
        return f"{metric.text(mean.mean)} ± {metric.text(high)}"
    return f"{metric.text(mean.mean)} ({metric.text(mean.low)} to {metric.text(mean.high)})"


def _means(jobs: Sequence[Mapping[str, MetricValue]]) -> dict[str, Mean]:
    found = {}
    for path in dict.fromkeys(path for job in jobs for path in job):
        there = [job[path] for job in jobs if path in job]
        values = [number for one in there if (number := _number(one.value)) is not None]
        if values:
            found[path] = mean_of(values, 1.0 if there[0].unit == "%" else math.inf)
    return found


def mean_of(values: Sequence[float], most: float = math.inf) -> Mean:
    """The mean of some numbers with its 95 % interval, which ends at 0 where none is negative, and at `most`."""
    mean = float(np.mean(values))
    if len(values) < 2:
        return Mean(mean, None, None)
    from scipy.special import stdtrit  # of Student's t; scipy.stats takes a second to import

    half = float(stdtrit(len(values) - 1, 0.975) * np.std(values, ddof=1) / math.sqrt(len(values)))
    least = -math.inf if min(values) < 0 else 0.0
    return Mean(mean, max(mean - half, least), min(mean + half, max(most, mean)))


def write_sweep_tables(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write `sweep.csv`, a line per job with all metrics, and `sweep_means.csv`, one per condition; also Parquet."""
    jobs = []
    for row in rows:
        manifest = row["manifest"]
        values = {} if row["metrics"] is None else metric_values(row["metrics"])
        jobs.append(
            {"job": int(row["job"]), "status": str(manifest.get("status", ""))}
            | settings_of(manifest)
            | {path: value for path, one in values.items() if (value := _number(one.value)) is not None}
        )
    means = []
    for each in conditions(rows):
        line: dict[str, Any] = {**each.settings, "jobs": each.jobs}
        for path, mean in each.means.items():
            line |= {path: mean.mean, f"{path}.low": mean.low, f"{path}.high": mean.high}
        means.append(line)
    write_table(folder / "sweep", _columns(jobs))
    write_table(folder / "sweep_means", _columns(means))


def _columns(lines: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    names = dict.fromkeys(name for line in lines for name in line)
    return {name: _column([line.get(name) for line in lines]) for name in names}


def _column(values: Sequence[Any]) -> Any:
    """An array of numbers where all are numbers, typed or written; else of texts."""
    try:
        return np.array([math.nan if value is None else float(value) for value in values])
    except ValueError:
        return np.array([None if value is None else str(value) for value in values], dtype=object)


def _number(value: Any) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None
