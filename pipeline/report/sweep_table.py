"""A sweep as tables: a line per job, and a line per condition with means over its seeds and their intervals."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from omninav.pipeline.tables import write_table

from .quantities import Number, numbers

SEED = "seed"
"""The setting over which means are taken."""


@dataclass(frozen=True)
class Mean:
    """The mean of a figure over seeds with its 95 % interval (Student's t); without an interval for a single seed."""

    mean: float
    low: float | None
    high: float | None


@dataclass(frozen=True)
class Condition:
    """Jobs that differ in nothing but the seed: their settings, how many ended well, and means by path."""

    settings: dict[str, str]
    jobs: int
    means: dict[str, Mean]


def settings_of(overrides: str) -> dict[str, str]:
    """What a job overrides, as name and value."""
    return {name.lstrip("+~"): value for name, _, value in (word.partition("=") for word in overrides.split())}


def conditions(rows: Sequence[Mapping[str, Any]]) -> list[Condition]:
    """Jobs by what they override beside the seed, in the order in which these first come; rows as on the page."""
    found: dict[tuple[tuple[str, str], ...], list[dict[str, Number]]] = {}
    for row in rows:
        settings = settings_of(str(row["manifest"].get("overrides", "")))
        settings.pop(SEED, None)
        jobs = found.setdefault(tuple(settings.items()), [])
        if row["metrics"] is not None:
            jobs.append(numbers(row["metrics"]))
    return [Condition(dict(settings), len(jobs), _means(jobs)) for settings, jobs in found.items()]


def _means(jobs: Sequence[Mapping[str, Number]]) -> dict[str, Mean]:
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
    """Write `sweep.csv`, a line per job with all figures, and `sweep_means.csv`, one per condition; also Parquet."""
    jobs = []
    for row in rows:
        manifest = row["manifest"]
        figures = {} if row["metrics"] is None else numbers(row["metrics"])
        jobs.append(
            {"job": int(row["job"]), "status": str(manifest.get("status", ""))}
            | settings_of(str(manifest.get("overrides", "")))
            | {path: value for path, one in figures.items() if (value := _number(one.value)) is not None}
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
