"""A run's metrics as rows: quantities that are measured in several ways, and single numbers."""

from dataclasses import dataclass

from omninav.pipeline.graph.results import Metrics

from .key_figures import KeyFigure
from .quantities import STATISTICS, Entry, entries, is_detail


@dataclass(frozen=True)
class ResultRow:
    """A quantity under one condition: a cell for each statistic."""

    condition: str
    cells: tuple[str, ...]
    plain: bool
    """True for a figure of all that was measured, under no condition."""


@dataclass(frozen=True)
class Measured:
    """A quantity with a row for each condition under which it was measured; a single condition is part of the name."""

    name: str
    unit: str
    rows: tuple[ResultRow, ...]


@dataclass(frozen=True)
class Results:
    """All of a run's numbers; `columns` are the statistics that any of them has."""

    columns: tuple[str, ...]
    quantities: tuple[Measured, ...]
    singles: tuple[KeyFigure, ...]


def results(metrics: Metrics, details: bool = True) -> Results:
    """The metrics as rows, without their details where these are not asked for."""
    every = entries(metrics)
    found = [e for e in every if e.has_figure(e.value) and (details or not is_detail(e.path, metrics))]
    columns = tuple(s for s in STATISTICS if any(entry.statistics and s in entry.statistics for entry in found))
    spread_out = {entry.groups for entry in found if entry.statistics}  # groups that hold distributions
    by_name: dict[str, list[Entry]] = {}
    for entry in found:
        own_title = entry.groups and not entry.where
        by_name.setdefault(entry.path if own_title else entry.name, []).append(entry)
    quantities, singles = [], []
    for several in by_name.values():
        if any(entry.statistics for entry in several) or (
            len(several) > 1 and all(entry.groups in spread_out for entry in several)
        ):
            rows = tuple(_row(entry, columns) for entry in several)
            where = several[0].where if len(several) == 1 else ""
            name = ", ".join(part for part in (several[0].title, where) if part)
            quantities.append(Measured(name, several[0].unit, rows))
        else:
            singles += [_single(entry) for entry in several]
    return Results(columns, tuple(quantities), tuple(dict.fromkeys(singles)))  # two stages may have measured the same


def _row(entry: Entry, columns: tuple[str, ...]) -> ResultRow:
    alone = "mean" if "mean" in columns else columns[0]
    values = entry.statistics or {alone: entry.value}
    cells = tuple(entry.text(values[column]) if column in values else "" for column in columns)
    return ResultRow(entry.where or "all frames", cells, not entry.groups)


def _single(entry: Entry) -> KeyFigure:
    where, name = entry.where, entry.title
    if where:
        name = f"{where[:1].upper()}{where[1:]}: {name[:1].lower()}{name[1:]}"
    return KeyFigure(name, *entry.in_words(entry.value))
