"""The plots on an experiment's page: bars or lines of measures, and curves within the runs."""

import itertools
import textwrap
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from omninav.pipeline.report.plot_style import PALETTE, plot

from .intervals import Array
from .series import series_at
from .specification import Condition, Curve, Experiment, Labels, Measure, space_of
from .verdicts import Results, key_of, over_runs, samples

LEGEND_LINES_IN = 0.45
"""Height of a legend (inches) that fits a plot as it is: two lines."""
LETTER_IN = 0.08
"""Width of a letter (inches) in names below a plot."""


@dataclass(frozen=True)
class PagePlot:
    """A plot on an experiment's page; `content` is a PNG."""

    file: str
    title: str
    caption: str
    content: bytes


def plots_of(experiment: Experiment, results: Results) -> list[PagePlot]:
    """Plots of measures and curves; none where nothing has run."""
    if not any(results.values()):
        return []
    page, found = experiment.page, []
    for index, name in enumerate(page.drawn or list(experiment.measures)[:1]):
        measure = experiment.measures[name]
        if page.along:
            content = _lines(experiment, results, name, page.along, page.panels)
        else:  # of more rows than there are colours bars cannot be told apart
            content = (_bars if len(row_labels(experiment)) <= len(PALETTE) else _points)(experiment, results, name)
        what = "mean, and standard deviation over" if measure.over_runs == "mean" else f"{measure.over_runs} of"
        caption = f"{measure.title}: {what} the repetitions"
        if experiment.published.get(name) and not page.along:
            caption += "; diamonds are the paper's figures"
        file = experiment.name + (f"_{name}" if index else "")
        found.append(PagePlot(f"{file}.png", measure.title, f"{caption}.", content))
    for index, curve in enumerate(experiment.curves):
        content = _curve(experiment, results, curve)
        what = "mean of the repetitions, in a band from the least to the largest of them"
        caption = f"{curve.title} along {curve.x_label}: {what}"
        file = f"{experiment.name}_curve_{index + 1}.png"
        found.append(PagePlot(file, curve.title, f"{caption}.", content))
    return [plot for plot in found if plot.content]


def _curve(experiment: Experiment, results: Results, curve: Curve) -> bytes:
    """A line for each condition: the mean of the repetitions, in a band from the least to the largest of them."""
    panel_labels = experiment.labels(curve.panels) if curve.panels else [""]
    conditions = [condition for condition in experiment.conditions() if condition.fits(curve.only)]
    shown = [f for f in experiment.sweep if f != curve.panels and f not in curve.only]
    styles = {
        name: (PALETTE[n % len(PALETTE)], ("-", "--", "-.", ":")[n // len(PALETTE) % 4])
        for n, name in enumerate(dict.fromkeys(_named(c, shown) for c in conditions))
    }
    levels: list[float] = []  # of each line: one that only begins near zero is no reason for powers of ten
    with plot(4.6 * len(panel_labels) + 0.4, 3.8) as drawn:
        grid = drawn.canvas.subplots(1, len(panel_labels), squeeze=False, sharey=True)[0]
        for axes, panel in zip(grid, panel_labels, strict=True):
            here = [c for c in conditions if not curve.panels or c.labels[curve.panels] == panel]
            common: dict[str, tuple[Array, Array]] = {}
            for condition in here:
                runs = list(results.get(key_of(condition.labels), {}).values())
                for label, path in curve.reference.items():
                    x, y = series_of(runs, path, curve.x_path)
                    if len(x):
                        common.setdefault(label, (x, curve.scale * np.nanmean(y, axis=0)))
                x, y = series_of(runs, curve.path, curve.x_path)
                if not len(x):
                    continue
                y = curve.scale * y
                name, middle = _named(condition, shown), np.nanmean(y, axis=0)
                levels.append(float(np.nanmedian(middle)))
                colour, line = styles[name]
                axes.plot(
                    x,
                    middle,
                    color=colour,
                    linestyle=line,
                    label=name or "ours",
                    linewidth=1.5,
                    marker="o" if len(x) <= 30 else None,
                    markersize=3,
                )
                if len(y) > 1:
                    low, high = np.nanmin(y, axis=0), np.nanmax(y, axis=0)
                    axes.fill_between(x, low, high, color=colour, alpha=0.15, linewidth=0)
            for index, (label, (x, y)) in enumerate(common.items()):
                levels.append(float(np.nanmedian(y)))
                axes.plot(x, y, color="#555555", linestyle=("--", ":", "-.")[index % 3], linewidth=1.3, label=label)
            axes.set_title(panel)
            axes.set_xlabel(curve.x_label)
            axes.locator_params(axis="x", integer=not curve.x_path)  # there is no lap 1.5
        if not levels:
            return b""
        _scale(grid[0], levels, 10.0)
        _title_beside(grid[0], curve.title)
        _legend_above(drawn.canvas, grid)
    return drawn.content


def series_of(runs: Sequence[Mapping[str, Any]], path: str, at_path: str = "") -> tuple[Array, Array]:
    """Positions of the entries of a series (N,), and the series of all runs that have it (runs, N); NaN where one ends.

    Entries that no run has a figure for are left out.
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


def _named(condition: Condition, factors: Sequence[str]) -> str:
    return ", ".join(condition.labels[factor] for factor in factors)


def _lines(experiment: Experiment, results: Results, name: str, along: str, panels: str | None) -> bytes:
    """Lines along a numeric factor; error bars are the spread."""
    measure = experiment.measures[name]
    panel_labels = experiment.labels(panels) if panels else [""]
    series = [factor for factor in experiment.sweep if factor not in (along, panels)]
    combinations = list(itertools.product(*(experiment.labels(factor) for factor in series)))
    heights: list[float] = []
    with plot(4.6 * len(panel_labels) + 0.4, 3.8) as drawn:
        grid = drawn.canvas.subplots(1, len(panel_labels), squeeze=False, sharey=True)[0]
        for axes, panel in zip(grid, panel_labels, strict=True):
            for index, chosen in enumerate(combinations):
                labels = dict(zip(series, chosen, strict=True)) | ({panels: panel} if panels else {})
                points = [
                    (float(x), samples(experiment, results, name, labels | {along: x}))
                    for x in experiment.labels(along)
                ]
                known = [(x, list(found.values())) for x, found in points if found]
                heights += [over_runs(measure, values) for _, values in known]
                axes.errorbar(
                    [x for x, _ in known],
                    [over_runs(measure, v) for _, v in known],
                    yerr=[_spread(measure, v) for _, v in known],
                    color=PALETTE[index % len(PALETTE)],
                    marker="os^Dvx"[index % 6],
                    markersize=4,
                    capsize=2.5,
                    linewidth=1.4,
                    elinewidth=0.8,
                    label=", ".join(chosen),
                )
            axes.set_title(panel)
            axes.set_xlabel(along)
            axes.locator_params(axis="x", integer=all(float(x).is_integer() for x in experiment.labels(along)))
        _scale(grid[0], heights)
        _title_beside(grid[0], measure.title)
        _legend_above(drawn.canvas, grid)
    return drawn.content


def _bars(experiment: Experiment, results: Results, name: str) -> bytes:
    """Bars; error bars are the spread, hollow diamonds the paper's figures."""
    measure = experiment.measures[name]
    columns, rows = experiment.labels(experiment.page.columns), row_labels(experiment)
    width = 0.8 / len(rows)
    column_in = max(0.42 * (len(rows) + 1), 0.95, 3.9 / len(columns))
    all_heights: list[float] = []
    with plot(1.1 + len(columns) * column_in, 3.6) as drawn:
        axes = drawn.canvas.subplots()
        for index, labels in enumerate(rows):
            at = np.arange(len(columns)) + (index - (len(rows) - 1) / 2) * width
            heights, spreads = _means([(labels, column) for column in columns], experiment, results, name)
            all_heights += heights
            colour = PALETTE[index % len(PALETTE)]
            title = ", ".join(labels.values())
            axes.bar(
                at,
                heights,
                0.9 * width,
                yerr=spreads,
                color=colour,
                capsize=2.5,
                label=title,
                error_kw={"elinewidth": 0.8},
            )
            paper = [experiment.published_figure(name, labels | {experiment.page.columns: c}) for c in columns]
            shown = [(x, value) for x, value in zip(at, paper, strict=True) if value is not None]
            if shown:
                axes.plot(
                    *zip(*shown, strict=True), "D", color="white", markeredgecolor="#111111", markersize=5, zorder=5
                )
        if experiment.published.get(name):
            axes.plot([], [], "D", color="white", markeredgecolor="#111111", markersize=5, label="paper")
        axes.set_xticks(np.arange(len(columns)), [textwrap.fill(c, int(column_in / LETTER_IN)) for c in columns])
        _title_beside(axes, measure.title)
        _scale(axes, all_heights)
        axes.grid(axis="x", visible=False)
        _legend_above(drawn.canvas, [axes])
    return drawn.content


def _points(experiment: Experiment, results: Results, name: str) -> bytes:
    """A line of points for each row of the table, one for each column; error bars are the spread."""
    columns, rows = experiment.labels(experiment.page.columns), row_labels(experiment)
    places = -np.arange(len(rows), dtype=np.float64)  # the first row on top
    figures: list[float] = []
    with plot(8.0, 1.3 + 0.28 * len(rows)) as drawn:
        axes = drawn.canvas.subplots()
        for index, column in enumerate(columns):
            means, spreads = _means([(labels, column) for labels in rows], experiment, results, name)
            figures += means
            axes.errorbar(
                means,
                places - 0.1 * (index - (len(columns) - 1) / 2),
                xerr=spreads,
                color=PALETTE[index % len(PALETTE)],
                fmt="os^Dvx"[index % 6],
                markersize=4.5,
                capsize=2.0,
                elinewidth=0.8,
                label=column,
            )
        axes.set_yticks(places, [", ".join(labels.values()) for labels in rows])
        axes.set_xlabel(experiment.measures[name].title)
        _scale(axes, figures, axis="x")
        _legend_above(drawn.canvas, [axes])
    return drawn.content


def _means(
    cells: Sequence[tuple[Labels, str]], experiment: Experiment, results: Results, name: str
) -> tuple[list[float], list[float]]:
    """Figure and spread over the repetitions of cells of the table, each a row's labels and a column."""
    measure, by = experiment.measures[name], experiment.page.columns
    found = [list(samples(experiment, results, name, labels | {by: column}).values()) for labels, column in cells]
    return [over_runs(measure, v) if v else np.nan for v in found], [_spread(measure, v) for v in found]


def _spread(measure: Measure, figures: Sequence[float]) -> float:
    """Standard deviation over the repetitions; of a largest figure there is none."""
    return float(np.std(figures)) if figures and measure.over_runs == "mean" else np.nan


def _title_beside(axes: Any, title: str) -> None:
    """The title of the axis on the left, in as many lines as its height needs."""
    axes.set_ylabel(textwrap.fill(title, 40))


def _legend_above(canvas: Any, grid: Any) -> None:
    """One legend for all panels, where it hides none of the lines, in as many columns as fit; it adds height."""
    lines: dict[str, Any] = {}
    for axes in grid:
        handles, labels = axes.get_legend_handles_labels()
        lines |= dict(zip(labels, handles, strict=True))
    if not lines:
        return
    for columns in range(min(3, len(lines)), 0, -1):
        legend = canvas.legend(lines.values(), lines.keys(), loc="outside upper left", ncols=columns)
        size = legend.get_window_extent()
        if columns == 1 or size.width <= canvas.bbox.width:
            break
        legend.remove()
    canvas.set_figheight(canvas.get_figheight() + max(0.0, size.height / canvas.dpi - LEGEND_LINES_IN))


def _scale(axes: Any, figures: Sequence[float], ratio: float = 20.0, axis: Literal["x", "y"] = "y") -> None:
    """Scales an axis from zero up; in powers of ten where the highest is more than `ratio` times the lowest above zero.

    Where one is zero, the axis is linear up to the lowest above zero, so that a line at zero is seen.
    """
    above = [figure for figure in figures if figure > 0]
    if above and max(above) > ratio * min(above):
        if 0.0 in figures:
            getattr(axes, f"set_{axis}scale")("symlog", linthresh=min(above), linscale=0.5)
            axes.set(**{f"{axis}lim": (-0.2 * min(above), None)})
        else:
            axes.set(**{f"{axis}scale": "log", f"{axis}lim": (0.5 * min(above), None)})
    else:
        axes.set(**{f"{axis}lim": (0, None)})


def row_labels(experiment: Experiment) -> list[Labels]:
    """The labels of the table's rows."""
    rows = experiment.page.rows
    return [dict(zip(rows, chosen, strict=True)) for chosen in itertools.product(*(experiment.labels(f) for f in rows))]
