"""The plots on an experiment's page: bars or lines of measures, and curves within the runs."""

import itertools
import textwrap
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from omninav.pipeline.report.plot_style import PALETTE, plot

from .intervals import Array
from .result import ExperimentResult, Line, rows_of
from .specification import Experiment, Labels

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


def plots_of(experiment: Experiment, result: ExperimentResult) -> list[PagePlot]:
    """Plots of measures and curves; none where nothing has run."""
    page = experiment.page
    found = [
        measure_plot(experiment, result, name, experiment.name + (f"_{name}" if index else ""))
        for index, name in enumerate(page.drawn or list(experiment.measures)[:1])
        if any(cell.figure is not None for cell in result.cells.get(name, ()))
    ]
    for index, (curve, lines) in enumerate(zip(experiment.curves, result.curves, strict=False)):
        if lines:
            panels = experiment.labels(curve.panels) if curve.panels else [""]
            content = _curve(curve.title, curve.x_label, panels, lines, whole_numbers=not curve.x_path)
            what = "mean of the repetitions, in a band from the least to the largest of them"
            caption = f"{curve.title} along {curve.x_label}: {what}."
            found.append(PagePlot(f"{experiment.name}_curve_{index + 1}.png", curve.title, caption, content))
    return found


def measure_plot(experiment: Experiment, result: ExperimentResult, name: str, file: str) -> PagePlot:
    """A measure's bars, points, or lines along a numeric factor, as the page is laid out. `file`: without its end."""
    measure, page = experiment.measures[name], experiment.page
    if page.along:
        content = _lines(experiment, result, name, page.along, page.panels)
    else:  # of more rows than there are colours bars cannot be distinguished
        content = (_bars if len(rows_of(experiment)) <= len(PALETTE) else _points)(experiment, result, name)
    what = "mean, and standard deviation over" if measure.over_runs == "mean" else f"{measure.over_runs} of"
    caption = f"{measure.title}: {what} the repetitions"
    if experiment.published.get(name) and not page.along:
        caption += "; diamonds are the paper's figures"
    return PagePlot(f"{file}.png", measure.title, f"{caption}.", content)


def _curve(title: str, x_label: str, panels: Sequence[str], lines: Sequence[Line], whole_numbers: bool) -> bytes:
    """A line for each condition: the mean of the repetitions, in a band from the least to the largest of them."""
    names = dict.fromkeys(line.name for line in lines if not line.reference)
    styles = {
        name: (PALETTE[n % len(PALETTE)], ("-", "--", "-.", ":")[n // len(PALETTE) % 4]) for n, name in enumerate(names)
    }
    with plot(4.6 * len(panels) + 0.4, 3.8) as drawn:
        grid = drawn.canvas.subplots(1, len(panels), squeeze=False, sharey=True)[0]
        for axes, panel in zip(grid, panels, strict=True):
            here = [line for line in lines if line.panel == panel]
            for line in here:
                if line.reference:
                    continue
                colour, style = styles[line.name]
                axes.plot(
                    line.x,
                    line.mean,
                    color=colour,
                    linestyle=style,
                    label=line.name or "ours",
                    linewidth=1.5,
                    marker="o" if len(line.x) <= 30 else None,
                    markersize=3,
                )
                if line.low:
                    axes.fill_between(line.x, line.low, line.high, color=colour, alpha=0.15, linewidth=0)
            for index, line in enumerate(line for line in here if line.reference):
                dashes = ("--", ":", "-.")[index % 3]
                axes.plot(line.x, line.mean, color="#555555", linestyle=dashes, linewidth=1.3, label=line.name)
            axes.set_title(panel)
            axes.set_xlabel(x_label)
            axes.locator_params(axis="x", integer=whole_numbers)  # there is no lap 1.5
        # Of each line: one that only begins near zero is no reason for powers of ten.
        _scale(grid[0], [float(np.nanmedian(line.mean)) for line in lines], 10.0)
        _title_beside(grid[0], title)
        _legend_above(drawn.canvas, grid)
    return drawn.content


def _lines(experiment: Experiment, result: ExperimentResult, name: str, along: str, panels: str | None) -> bytes:
    """Lines along a numeric factor; error bars are the spread."""
    measure = experiment.measures[name]
    panel_labels = experiment.labels(panels) if panels else [""]
    series = [factor for factor in experiment.sweep if factor not in (along, panels)]
    combinations = list(itertools.product(*(experiment.labels(factor) for factor in series)))
    heights: list[float] = []
    places = experiment.labels(along)
    with plot(4.6 * len(panel_labels) + 0.4, 3.8) as drawn:
        grid = drawn.canvas.subplots(1, len(panel_labels), squeeze=False, sharey=True)[0]
        for axes, panel in zip(grid, panel_labels, strict=True):
            for index, chosen in enumerate(combinations):
                labels = dict(zip(series, chosen, strict=True)) | ({panels: panel} if panels else {})
                means, spreads = _values(experiment, result, name, [labels | {along: x} for x in places])
                known = ~np.isnan(means)
                heights += means[known].tolist()
                axes.errorbar(
                    np.array(places, np.float64)[known],
                    means[known],
                    yerr=spreads[known],
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
            axes.locator_params(axis="x", integer=all(float(x).is_integer() for x in places))
        _scale(grid[0], heights)
        _title_beside(grid[0], measure.title)
        _legend_above(drawn.canvas, grid)
    return drawn.content


def _bars(experiment: Experiment, result: ExperimentResult, name: str) -> bytes:
    """Bars; error bars are the spread, hollow diamonds the paper's values."""
    measure = experiment.measures[name]
    columns, rows = experiment.labels(experiment.page.columns), rows_of(experiment)
    width = 0.8 / len(rows)
    column_in = max(0.42 * (len(rows) + 1), 0.95, 3.9 / len(columns))
    all_heights: list[float] = []
    with plot(1.1 + len(columns) * column_in, 3.6) as drawn:
        axes = drawn.canvas.subplots()
        for index, labels in enumerate(rows):
            at = np.arange(len(columns)) + (index - (len(rows) - 1) / 2) * width
            by = experiment.page.columns
            heights, spreads = _values(experiment, result, name, [labels | {by: column} for column in columns])
            all_heights += heights.tolist()
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
            paper = [experiment.published_value(name, labels | {by: column}) for column in columns]
            shown = [(x, value) for x, value in zip(at, paper, strict=True) if value is not None]
            if shown:
                axes.plot(
                    *zip(*shown, strict=True), "D", color="white", markeredgecolor="#111111", markersize=5, zorder=5
                )
        if experiment.published.get(name):
            axes.plot([], [], "D", color="white", markeredgecolor="#111111", markersize=5, label="paper")
        axes.set_xticks(
            np.arange(len(columns)),
            [textwrap.fill(c, int(column_in / LETTER_IN), break_long_words=False) for c in columns],
        )
        _title_beside(axes, measure.title)
        _scale(axes, all_heights)
        axes.grid(axis="x", visible=False)
        _legend_above(drawn.canvas, [axes])
    return drawn.content


def _points(experiment: Experiment, result: ExperimentResult, name: str) -> bytes:
    """A line of points for each row of the table, one for each column; error bars are the spread."""
    columns, rows = experiment.labels(experiment.page.columns), rows_of(experiment)
    places = -np.arange(len(rows), dtype=np.float64)  # the first row on top
    values: list[float] = []
    with plot(8.0, 1.3 + 0.28 * len(rows)) as drawn:
        axes = drawn.canvas.subplots()
        for index, column in enumerate(columns):
            of_column = [labels | {experiment.page.columns: column} for labels in rows]
            means, spreads = _values(experiment, result, name, of_column)
            values += means.tolist()
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
        _scale(axes, values, axis="x")
        _legend_above(drawn.canvas, [axes])
    return drawn.content


def _values(
    experiment: Experiment, result: ExperimentResult, name: str, conditions: Sequence[Labels]
) -> tuple[Array, Array]:
    """A measure's values in some conditions, and their spreads: 0 of one repetition; NaN where there is none."""
    factors = (*experiment.page.rows, experiment.page.columns)
    cells = [result.cell(name, [labels[factor] for factor in factors]) for labels in conditions]
    spreads = [0.0 if cell.spread is None and cell.found == 1 else cell.spread for cell in cells]
    return np.array([cell.figure for cell in cells], np.float64), np.array(spreads, np.float64)


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


def _scale(axes: Any, values: Sequence[float], ratio: float = 20.0, axis: Literal["x", "y"] = "y") -> None:
    """Scales an axis from zero up; in powers of ten where the highest is more than `ratio` times the lowest above zero.

    Where one is zero, the axis is linear up to the lowest above zero, so that a line at zero is seen.
    """
    above = [value for value in values if value > 0]
    if above and max(above) > ratio * min(above):
        if 0.0 in values:
            getattr(axes, f"set_{axis}scale")("symlog", linthresh=min(above), linscale=0.5)
            axes.set(**{f"{axis}lim": (-0.2 * min(above), None)})
        else:
            axes.set(**{f"{axis}scale": "log", f"{axis}lim": (0.5 * min(above), None)})
    else:
        axes.set(**{f"{axis}lim": (0, None)})
