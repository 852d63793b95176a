"""A run's metrics as a table: distributions, and single values."""

from dataclasses import dataclass

from omninav.pipeline.graph.results import Metrics

from .headlines import MetricRow
from .metrics import STATISTICS, Metric, in_order, is_detail


@dataclass(frozen=True)
class DistributionRow:
    """A metric under one condition: a cell for each statistic."""

    condition: str
    cells: tuple[str, ...]
    plain: bool
    """True for a metric of all that was measured, under no condition."""


@dataclass(frozen=True)
class Distribution:
    """A metric with a row for each condition under which it was measured; a single condition is part of the name."""

    name: str
    unit: str
    rows: tuple[DistributionRow, ...]


@dataclass(frozen=True)
class MetricsTable:
    """All of a run's metrics; `columns` are the statistics that any of them has."""

    columns: tuple[str, ...]
    distributions: tuple[Distribution, ...]
    singles: tuple[MetricRow, ...]


def metrics_table(metrics: Metrics, details: bool = True) -> MetricsTable:
    """The metrics as rows, without their details where these are not asked for."""
    found = [e for e in in_order(metrics) if e.is_shown(e.value) and (details or not is_detail(e.path, metrics))]
    columns = tuple(s for s in STATISTICS if any(metric.statistics and s in metric.statistics for metric in found))
    spread_out = {metric.groups for metric in found if metric.statistics}  # groups that hold distributions
    by_name: dict[str, list[Metric]] = {}
    for metric in found:
        own_title = metric.groups and not metric.where
        by_name.setdefault(metric.path if own_title else metric.name, []).append(metric)
    distributions, singles = [], []
    for several in by_name.values():
        if any(metric.statistics for metric in several) or (
            len(several) > 1 and all(metric.groups in spread_out for metric in several)
        ):
            rows = tuple(_row(metric, columns) for metric in several)
            where = several[0].where if len(several) == 1 else ""
            name = ", ".join(part for part in (several[0].title, where) if part)
            distributions.append(Distribution(name, several[0].unit, rows))
        else:
            singles += [_single(metric) for metric in several]
    singles = list(dict.fromkeys(singles))  # two stages may have measured the same
    return MetricsTable(columns, tuple(distributions), tuple(singles))


def _row(metric: Metric, columns: tuple[str, ...]) -> DistributionRow:
    alone = "mean" if "mean" in columns else columns[0]
    values = metric.statistics or {alone: metric.value}
    cells = tuple(metric.text(values[column]) if column in values else "" for column in columns)
    return DistributionRow(metric.where or "all frames", cells, not metric.groups)


def _single(metric: Metric) -> MetricRow:
    where, name = metric.where, metric.title
    if where:
        name = f"{where[:1].upper()}{where[1:]}: {name[:1].lower()}{name[1:]}"
    return MetricRow(name, *metric.in_words(metric.value))
