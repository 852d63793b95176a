"""Results that any "after" stage may give: numbers for `metrics.json`, plots and tables for the report."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import field
from typing import Any, Literal

import numpy as np

from .stage import Outputs, Stage
from .value import Value


class MetricSpec(Value):
    """Presentation of a metric. Whatever is not stated follows from its name."""

    title: str | None = None
    """Label. None: its name in words (`position_error_m` is `Position error`)."""
    unit: str | None = None
    """Its unit as shown: shares are shown in `%` (times 100), bytes in `kB`. None: from the end of its name."""
    better: Literal["lower", "higher"] | None = None
    """Which values are better; None where neither is, so that a comparison marks none as best."""
    absent: str = "–"
    """Text in place of a value that is None. A word (`never`) is shown and marked as bad; with a dash the metric is
    left out."""
    zero: str | None = None
    """Shown where it is by itself and is 0 (`at once`); None: the number."""
    before: str = ""
    """Word before the number (`after` 12 frames)."""
    least: float | None = None
    """Smallest acceptable value, before it is scaled to its unit; a lower one is marked as bad. None: any."""
    most: float | None = None
    """Largest acceptable value, before it is scaled to its unit; a higher one is marked as bad. None: any."""
    setting: bool = False
    """True for a value that states how another was measured, and is not a result: only metrics.json holds it."""
    context: bool = False
    """True for a metric of the run's size (frames, length): an experiment's page states it for each condition."""


class Metrics(Value):
    """Metrics of a run, merged into `metrics.json`, and how they are to be read.

    The unit is the end of a name: `_m`, `_deg`, `_s`, `_ms`, `_px`, `_rate` (a share), `_bytes`, `_frames`. A mapping
    whose keys are all statistics (mean, std, median, p90, p95, max, rmse) is a distribution.

    A stage that measures states the specs once, beside its class, and passes them with the values::

        SPECS = {
            "position_error_m": MetricSpec(better="lower"),
            "success.at_end": MetricSpec(title="Correct at the end", better="higher"),
        }
        ...
        return self.Out(metrics=Metrics(values, SPECS, headlines=("position_error_m.median", "success.at_end")))
    """

    reported = True
    values: dict[str, Any]
    """Nested mappings of numbers, texts, None and lists."""
    specs: dict[str, MetricSpec] = field(default_factory=dict)
    """Specs by path (`success.at_end`), or by name for all metrics of that name (`position_error_m`). The title of
    a path is shown as it is, that of a name with its groups (`Position error, after convergence`). Tables keep
    this order."""
    headlines: tuple[str, ...] = ()
    """Paths of what one looks for first, with the statistic of a distribution: what a run prints, tiles of a report,
    columns of a sweep. Those that are not among the values are passed over."""
    details: tuple[str, ...] = ()
    """Paths of metrics or whole groups that only the run's own page shows, no comparison and no terminal."""
    foremost: bool = False
    """They tell whether the run reached its goal: their headlines come before those of other stages."""


def merged(parts: Iterable[Metrics]) -> Metrics:
    """The metrics of several stages as one; what two of them state under one name comes from the later one."""
    values: dict[str, Any] = {}
    specs: dict[str, MetricSpec] = {}
    headlines: tuple[str, ...] = ()
    details: tuple[str, ...] = ()
    for part in parts:
        _merge(values, part.values)
        specs |= part.specs
        headlines = part.headlines + headlines if part.foremost else headlines + part.headlines
        details += part.details
    return Metrics(values, specs, tuple(dict.fromkeys(headlines)), tuple(dict.fromkeys(details)))


def _merge(into: dict[str, Any], more: Mapping[str, Any]) -> None:
    for key, value in more.items():
        if isinstance(value, Mapping):
            if not isinstance(into.get(key), dict):
                into[key] = {}
            _merge(into[key], value)
        else:
            into[key] = _as_json(value)


def by_path(values: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    """Yields the values of nested mappings, each with its keys joined by points."""
    for key, value in values.items():
        if isinstance(value, Mapping) and value:
            yield from by_path(value, f"{before}{key}.")
        else:
            yield f"{before}{key}", value


def _as_json(value: Any) -> Any:
    """A value as JSON holds it: a number of numpy's as one of Python's, and None for NaN and infinity."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if isinstance(value, list | tuple):
        return [_as_json(each) for each in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


class Slide(Value):
    """One frame of a plot that is stepped through.

    `label`: what it is of (`frame 12, 3.4 s`). `overlay`: SVG to be laid over the plot's drawing, in its units.
    `photographs`: each its caption and its JPEG bytes. `facts`: names and what they are at this frame, as texts.
    """

    label: str
    overlay: str = ""
    photographs: tuple[tuple[str, bytes], ...] = ()
    facts: tuple[tuple[str, str], ...] = ()


class Plot(Value):
    """A picture for the report. `content`: PNG, JPEG or SVG bytes; `caption`: what it shows and what to look for.

    `name` is its file name without suffix; plots are shown in the order of `order`, then of their names. `slides` are
    what changes from frame to frame over an SVG, which the reader steps through.
    """

    reported = True
    name: str
    title: str
    caption: str
    content: bytes
    media_type: str = "image/png"
    order: int = 50
    slides: tuple[Slide, ...] = ()


class Table(Value):
    """A table for the report: column heads (with units), and rows of texts or numbers."""

    reported = True
    name: str
    title: str
    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Any, ...], ...]
    order: int = 50


class MetricStage(Stage):
    """Base of stages that measure: `step` returns `self.Out(metrics=…)`, or `self.Out()` where nothing was measured."""

    class Out(Outputs):
        """`metrics`: for metrics.json."""

        metrics: Metrics | None = None


class PlotStage(Stage):
    """Base of stages that plot: `step` returns `self.Out(plot=…)`, or `self.Out()` where there is nothing to show."""

    class Out(Outputs):
        """`plot`: for the report."""

        plot: Plot | None = None

    def drawn(
        self, name: str, title: str, caption: str, content: bytes, order: int, slides: tuple[Slide, ...] = ()
    ) -> Out:
        """A plot whose content is SVG; all else as in `Plot`."""
        return self.Out(plot=Plot(name, title, caption, content, "image/svg+xml", order, slides))
