"""Metrics as people read them: titles and units as their stages state them or as their names imply."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from omninav.pipeline.graph.results import Metrics, MetricSpec

STATISTICS = ("mean", "std", "median", "p90", "p95", "max", "rmse")
"""A metric with no other keys than these is a distribution."""
SPELLED = {"p90": "90th percentile", "p95": "95th percentile"}
PER_LOG = "logs"
"""The list of each log's own metrics, where there are several logs."""
UNITS = {
    "_bytes": "kB",
    "_deg": "°",
    "_rate": "%",
    "_ms": "ms",
    "_px": "px",
    "_frames": "frames",
    "_m2": "m²",
    "_m": "m",
    "_s": "s",
}
"""The unit that the end of a name means."""
SCALES = {"%": 100.0, "kB": 1e-3}
"""Factor by which a value is multiplied to be shown in a unit."""


@dataclass(frozen=True)
class Metric:
    """A metric of metrics.json: its groups (`after_convergence`, …), its name, and a number, text, None or statistics.

    `spec` is how it is described, `by_path` whether under its own path.
    """

    groups: tuple[str, ...]
    name: str
    value: Any
    spec: MetricSpec
    by_path: bool = False

    @property
    def path(self) -> str:
        """Groups and name, joined by points."""
        return ".".join((*self.groups, self.name))

    @property
    def statistics(self) -> dict[str, float] | None:
        """Mean, median and so on, where it is a distribution."""
        return self.value if isinstance(self.value, dict) else None

    @property
    def title(self) -> str:
        """Its name without its groups."""
        return self.spec.title or title(self.name)

    @property
    def unit(self) -> str:
        """The unit in which it is shown, '' where there is none."""
        return unit(self.name) if self.spec.unit is None else self.spec.unit

    @property
    def where(self) -> str:
        """Its groups in words; nothing where its title is complete."""
        return "" if self.by_path and self.spec.title else ", ".join(humanise(part) for part in self.groups)

    def text(self, value: Any) -> str:
        """The value, or one of its statistics, as shown, without its unit."""
        if value is None:
            return self.spec.absent
        if isinstance(value, bool | str) or not isinstance(value, int | float):
            return str(value)
        scale = SCALES.get(self.unit)
        return digits(value if scale is None else scale * value)

    def in_words(self, value: Any) -> tuple[str, str]:
        """The value by itself, and its unit: (`0.19`, `m`), (`after 1`, `frame`), (`at once`, '')."""
        if value == 0 and self.spec.zero is not None:
            return self.spec.zero, ""
        if value is None or isinstance(value, str):
            return self.text(value), ""
        unit = self.unit.removesuffix("s") if value == 1 and len(self.unit) > 2 else self.unit
        return " ".join(part for part in (self.spec.before, self.text(value)) if part), unit

    def is_shown(self, value: Any) -> bool:
        """Tells if there is a value, or a word for its absence."""
        return value is not None or self.spec.absent != MetricSpec().absent

    def is_off(self, value: Any) -> bool:
        """Tells if a value, or its absence, is not acceptable."""
        if value is None:
            return self.is_shown(value)
        if not isinstance(value, int | float):
            return False
        least, most = self.spec.least, self.spec.most
        return (least is not None and value < least) or (most is not None and value > most)


@dataclass(frozen=True)
class MetricValue:
    """The value of a metric: a number or text; of a distribution, one of its statistics."""

    name: str
    metric: Metric
    value: float | int | str | None

    @property
    def unit(self) -> str:
        """The unit in which it is shown, '' where there is none."""
        return self.metric.unit

    @property
    def text(self) -> str:
        """The value as shown, without its unit."""
        return self.metric.text(self.value)

    @property
    def head(self) -> str:
        """Name and unit: the head of a row or column."""
        name = f"{self.name} {self.metric.spec.before}".rstrip()
        return f"{name} ({self.unit})" if self.unit else name


def in_order(metrics: Metrics) -> list[Metric]:
    """All metrics but those of single logs: described ones in their order, then by name; groups after what is in none.

    Those of a group follow the same order.
    """
    return [metric for metric in _in_order(metrics, metrics.values, ()) if not metric.spec.setting]


def _in_order(metrics: Metrics, values: Mapping[str, Any], groups: tuple[str, ...]) -> Iterator[Metric]:
    ranks = {path: rank for rank, path in enumerate(metrics.specs)}

    def order(name: str) -> tuple[int, str]:
        path = ".".join((*groups, name))
        return ranks.get(path, ranks.get(name, len(ranks))), name

    deeper = []
    for name in sorted(values, key=order):
        value, path = values[name], ".".join((*groups, name))
        spec = metrics.specs.get(path) or metrics.specs.get(name) or MetricSpec()
        by_path = path in metrics.specs
        if isinstance(value, Mapping):
            if value and all(key in STATISTICS for key in value):
                spread = {key: value[key] for key in STATISTICS if key in value}
                yield Metric(groups, name, spread, spec, by_path)
            else:
                deeper.append((name, value))
        elif not isinstance(value, list | tuple):
            yield Metric(groups, name, value, spec, by_path)
    for name, value in deeper:
        yield from _in_order(metrics, value, (*groups, name))


def metric_values(metrics: Metrics) -> dict[str, MetricValue]:
    """Every value by its path."""
    flat = {}
    for metric in in_order(metrics):
        for statistic, value in (metric.statistics or {"": metric.value}).items():
            name = ", ".join(part for part in (metric.title, SPELLED.get(statistic, statistic), metric.where) if part)
            path = f"{metric.path}.{statistic}" if statistic else metric.path
            flat[path] = MetricValue(name, metric, value)
    return flat


def per_log(metrics: Metrics) -> list[dict[str, MetricValue]]:
    """The values of each log, where there are several; they are described as those of the run are."""
    logs = metrics.values.get(PER_LOG)
    if not isinstance(logs, list | tuple):
        return []
    return [metric_values(Metrics(values, metrics.specs)) for values in logs]


def headline_paths(runs: Sequence[Metrics]) -> list[str]:
    """Paths of the headlines of any of several runs, in the order in which their stages state them."""
    return list(dict.fromkeys(path for run in runs for path in run.headlines))


def is_detail(path: str, metrics: Metrics) -> bool:
    """Tells whether only the run's own page shows what is at a path."""
    return any(f"{path}.".startswith(f"{detail}.") for detail in metrics.details)


def best_of(path: str, runs: Sequence[Mapping[str, MetricValue]]) -> set[int]:
    """Which runs have the best value, where it is known which is; none where all have the same."""
    better = next((run[path].metric.spec.better for run in runs if path in run), None)
    found = {n: run[path].value for n, run in enumerate(runs) if path in run and better}
    known = {n: float(value) for n, value in found.items() if isinstance(value, int | float)}
    if len(set(known.values())) < 2:
        return set()
    best = min(known.values()) if better == "lower" else max(known.values())
    return {number for number, value in known.items() if value == best}


def head_of(path: str, runs: Sequence[Mapping[str, MetricValue]]) -> str:
    """Name and unit of what is at a path of any of several runs."""
    return next(run[path] for run in runs if path in run).head


def unit(name: str) -> str:
    """The unit that the end of a name means, '' where there is none."""
    return next((shown_as for end, shown_as in UNITS.items() if name.endswith(end)), "")


def with_unit(value: str, unit: str) -> str:
    """`0.19 m`, `0.95°`, `at once`."""
    return f"{value}{'' if unit == '°' else ' '}{unit}".rstrip()


def title(name: str) -> str:
    """`position_error_m` -> `Position error`."""
    text = humanise(next((name.removesuffix(end) for end in UNITS if name.endswith(end) and end != "_rate"), name))
    return text[:1].upper() + text[1:]


def humanise(name: str) -> str:
    """`after_convergence` -> `after convergence`."""
    return name.replace("_", " ")


def digits(number: float) -> str:
    """Three significant digits or so, never scientific: 0.073, 1.52, 12.4, 3500, 0.00012; below 1e-6 it is 0."""
    if isinstance(number, int) or number == 0:
        return f"{number:.0f}" if abs(number) < 10_000 else f"{number:,.0f}".replace(",", "\u2009")
    size = abs(number)
    if size < 1e-6:
        return "0"
    small = 1 - math.floor(math.log10(size)) if size < 0.0005 else 3
    places = 0 if size >= 100 else 1 if size >= 10 else 2 if size >= 1 else small
    return f"{number:.{places}f}"
