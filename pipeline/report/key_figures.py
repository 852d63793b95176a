"""The few figures of a run that one looks for first, each on one line."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from omninav.pipeline.graph.results import Metrics

from .quantities import Number, digits, headlines, is_detail, numbers, with_unit

MAX_FIGURES = 10
"""Lines that a run prints, its speed among them."""
STANDS_FOR_ALL = ("median", "mean", "rmse")
"""Statistics of which the first that there is stands for a distribution, where no stage says what comes first."""


@dataclass(frozen=True)
class KeyFigure:
    """A figure as people read it; `off`: it is not as it should be."""

    name: str
    value: str
    unit: str = ""
    off: bool = False

    @property
    def text(self) -> str:
        """Value and unit."""
        return with_unit(self.value, self.unit)


def key_figures(metrics: Metrics, timing: Mapping[str, Any]) -> list[KeyFigure]:
    """The headlines that the stages state, else their first figures; then how fast the run was (of timing.json)."""
    known = {path: number for path, number in numbers(metrics).items() if number.entry.has_figure(number.value)}
    first = [known[path] for path in headlines([metrics]) if path in known] or _plain(known, metrics)
    ends, logs = _speed(timing), len(metrics.values.get("logs") or ())
    begins = [KeyFigure("Log", f"the last of {logs}; of each, `logs` in metrics.json")] if logs > 1 else []
    return [*begins, *map(_figure, first[: MAX_FIGURES - len(begins) - len(ends)]), *ends]


def _figure(number: Number) -> KeyFigure:
    value, unit = number.entry.in_words(number.value)
    return KeyFigure(number.name, value, unit, number.entry.is_off(number.value))


def _plain(known: Mapping[str, Number], metrics: Metrics) -> list[Number]:
    """Figures that are no details, one for each entry."""
    found: dict[str, Number] = {}
    for path, number in known.items():
        spread = number.entry.statistics
        if is_detail(path, metrics):
            continue
        if spread is None or path.rpartition(".")[2] == next((s for s in STANDS_FOR_ALL if s in spread), None):
            found[number.entry.path] = number
    return list(found.values())


def _speed(timing: Mapping[str, Any]) -> list[KeyFigure]:
    if not timing.get("ticks_per_second"):
        return []
    rate = digits(float(timing["ticks_per_second"]))
    name = "Speed, features from the cache" if timing.get("cached") else "Speed"
    return [KeyFigure(name, rate, "frames/s")]
