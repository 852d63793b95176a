"""Headlines: the few metrics of a run that are read first, each on one line."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from omninav.pipeline.graph.results import Metrics

from .metrics import MetricValue, digits, headline_paths, is_detail, metric_values, with_unit

MAX_ROWS = 10
"""Lines that a run prints at most, its speed among them."""
STANDS_FOR_ALL = ("median", "mean", "rmse")
"""Statistics; the first that exists represents a distribution, where no stage states what comes first."""


@dataclass(frozen=True)
class MetricRow:
    """A metric as people read it; `off`: its value is not acceptable."""

    name: str
    value: str
    unit: str = ""
    off: bool = False

    @property
    def text(self) -> str:
        """Value and unit."""
        return with_unit(self.value, self.unit)


def headline_rows(metrics: Metrics, timing: Mapping[str, Any]) -> list[MetricRow]:
    """The headlines that the stages state, else their first metrics; then how fast the run was (of timing.json)."""
    known = {path: each for path, each in metric_values(metrics).items() if each.metric.is_shown(each.value)}
    first = [known[path] for path in headline_paths([metrics]) if path in known] or _plain(known, metrics)
    ends, logs = _speed(timing), len(metrics.values.get("logs") or ())
    begins = [MetricRow("Log", f"the last of {logs}; of each, `logs` in metrics.json")] if logs > 1 else []
    return [*begins, *map(_row, first[: MAX_ROWS - len(begins) - len(ends)]), *ends]


def _row(of: MetricValue) -> MetricRow:
    value, unit = of.metric.in_words(of.value)
    return MetricRow(of.name, value, unit, of.metric.is_off(of.value))


def _plain(known: Mapping[str, MetricValue], metrics: Metrics) -> list[MetricValue]:
    """Values that are no details, one for each metric."""
    found: dict[str, MetricValue] = {}
    for path, value in known.items():
        spread = value.metric.statistics
        if is_detail(path, metrics):
            continue
        if spread is None or path.rpartition(".")[2] == next((s for s in STANDS_FOR_ALL if s in spread), None):
            found[value.metric.path] = value
    return list(found.values())


def _speed(timing: Mapping[str, Any]) -> list[MetricRow]:
    if not timing.get("ticks_per_second"):
        return []
    rate = digits(float(timing["ticks_per_second"]))
    name = "Speed, features from the cache" if timing.get("cached") else "Speed"
    return [MetricRow(name, rate, "frames/s")]
