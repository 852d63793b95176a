"""An experiment as one page: verdicts, the paper's table or figure beside ours, failures, and how to run it again."""

import base64
import itertools
import json
import math
import shlex
import textwrap
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from omninav.pipeline.files import write_whole
from omninav.pipeline.report.plot_style import PALETTE, picture
from omninav.pipeline.report.rendering import render

from .series import series_at
from .specification import Condition, Curve, Experiment, Labels, Measure, figure_of, space_of
from .verdicts import Array, Case, Results, Verdict, judge, key_of, pooled, samples

if TYPE_CHECKING:
    from .runner import ExperimentRun

MARKS = {"holds": "held", "does not hold": "broken", "undecided": "quiet"}
"""How a verdict looks."""


def write_page(run: "ExperimentRun") -> Path:
    """Write `<name>.md`, `<name>.html`, its pictures and `verdicts.json` into the experiment's folder.

    All of it follows from the repetitions' results as they stand; conditions that failed or are still to run say so.
    """
    experiment, folder = run.experiment, run.folder
    results = run.results
    verdicts = judge(experiment, results)
    write_whole(
        folder / "verdicts.json",
        json.dumps([verdict.plain() for verdict in verdicts], indent=1, ensure_ascii=False) + "\n",
    )
    pictures = pictures_of(experiment, results)
    for drawing in pictures:
        write_whole(folder / drawing["file"], drawing.pop("content"))
    first = run.cells[0].words
    common = [word for word in first if all(word in cell.words for cell in run.cells)]
    conditions = [_condition(cell, common) for cell in run.cells]
    said: dict[str, Any] = {
        "experiment": experiment,
        "profile": run.profile,
        "command": shlex.join(run.argv),
        "verdicts": [_verdict(experiment, verdict) for verdict in verdicts],
        "tables": [_table(experiment, results, name) for name in experiment.measures],
        "remarks": [_remark(run, number) for number in range(len(experiment.remarks))],
        "logs": [(log.name, _facts(log.facts)) for log in run.logs.values()],
        "conditions": conditions,
        "run_columns": [name for name in conditions[0]["run"] if any(row["run"][name] for row in conditions)],
        "common_words": common,
        "made": _made(folder),
        "marks": MARKS,
        "tiles": _tiles(run, verdicts),
        "failures": [(cell.name, cell.error) for cell in run.all_cells if cell.error],
        "missing": sum(len(cell.seeds) - len(cell.results) for cell in run.all_cells if not cell.error),
        "repetitions": experiment.runs_of_a_condition,
        "seeds": experiment.repetitions,
        "pictures": pictures,
    }
    write_whole(folder / f"{experiment.name}.md", render("experiment.md", **said))
    for drawing in pictures:
        content = base64.b64encode((folder / drawing["file"]).read_bytes()).decode()
        drawing["file"] = f"data:image/png;base64,{content}"
    path = folder / f"{experiment.name}.html"
    write_whole(path, render("experiment.html", **said))
    return path


# words


def number(value: float | None, digits: int) -> str:
    """A figure with a measure's digits, more where it would look like 0 and is not; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}f}"
    return f"{value:.1g}" if value and not float(text) else text


def mean_and_spread(values: Sequence[float], digits: int) -> str:
    """Mean ± standard deviation; the one value where it is alone, a dash where there is nothing."""
    if len(values) < 2:
        return number(values[0], digits) if values else "–"
    mean, spread = float(np.mean(values)), float(np.std(values))
    spread = spread if spread > 1e-9 * abs(mean) else 0.0  # equal figures, but for rounding
    return f"{number(mean, digits)} ± {number(spread, digits)}"


def beside_the_mean(values: Sequence[float], ran: int, digits: int) -> list[str]:
    """What a mean does not say: the median where it is another, and how many of those that ran have a figure at all."""
    mean, median = (number(float(of(values)), digits) if values else "" for of in (np.mean, np.median))
    said = [f"median {median}"] if mean != median else []
    return [*said, f"{len(values)} of {ran}"] if len(values) < ran else said


def _verdict(experiment: Experiment, verdict: Verdict) -> dict[str, Any]:
    measure = next(m for m in experiment.measures.values() if m.title == verdict.measure)
    rows = [_case(case, measure) for case in verdict.cases]
    return {
        "claim": verdict.claim,
        "paper": verdict.paper,
        "measure": measure.title,
        "holds": _held(verdict.holds),
        "rows": rows,
    }


def _held(holds: bool | None) -> str:
    return {True: "holds", False: "does not hold", None: "undecided"}[holds]


def _case(case: Case, measure: Measure) -> dict[str, str]:
    digits = max(2, measure.digits) if case.ratio else measure.digits
    difference = interval = ""
    if case.difference is not None and case.interval is not None:
        low, high = (f"{end:+.{digits}f}" for end in case.interval)
        difference, interval = f"{case.difference:+.{digits}f}", f"[{low}, {high}]"
    return {
        "where": case.where,
        "survivors": f"{case.judged} of {case.repetitions}" if case.judged < case.repetitions else "",
        "ours": number(case.ours, digits),
        "other": number(case.other, digits),
        "against": case.against,
        "difference": difference,
        "interval": interval,
        "holds": _held(case.holds),
    }


def _table(experiment: Experiment, results: Results, name: str) -> dict[str, Any]:
    measure, page = experiment.measures[name], experiment.page
    columns = experiment.labels(page.columns)
    printed = bool(experiment.published.get(name))
    rows = []
    for labels in _row_labels(experiment):
        cells = []
        for column in columns:
            here = labels | {page.columns: column}
            ran = len(results.get(key_of(here), {}))
            found = list(samples(experiment, results, name, here).values())
            beside = beside_the_mean(found, ran, measure.digits)
            if measure.pooled:
                whole = pooled(experiment, results, name, here)
                found, beside = [] if whole is None else [whole], []
            cells.append(
                {
                    "ours": mean_and_spread(found, measure.digits),
                    "beside": ", ".join(beside),
                    "paper": number(experiment.published_figure(name, here), measure.digits),
                }
            )
        rows.append({"head": [labels[factor] for factor in page.rows] or ["all"], "cells": cells})
    return {
        "title": measure.title,
        "heads": list(page.rows) or [""],
        "columns": columns,
        "rows": rows,
        "printed": printed,
    }


def _row_labels(experiment: Experiment) -> list[Labels]:
    rows = experiment.page.rows
    return [dict(zip(rows, chosen, strict=True)) for chosen in itertools.product(*(experiment.labels(f) for f in rows))]


def _remark(run: "ExperimentRun", number_: int) -> str:
    remark = run.experiment.remarks[number_]
    measure = Measure("", (remark.measure,), remark.times)
    parts = []
    for label in run.experiment.labels(remark.over):
        cells = [cell for cell in run.beside[number_] if cell.condition.labels[remark.over] == label]
        found = [figure_of(measure, result) for cell in cells for result in cell.results.values()]
        known = [figure for figure in found if figure is not None]
        parts.append(f"{label} {number(float(np.mean(known)), 1) if known else 'not run'}")
    return remark.says.replace("{}", "; ".join(parts))


def _facts(facts: Mapping[str, Any]) -> str:
    return ", ".join(_in_words(key, value) for key, value in facts.items())


def _in_words(name: str, value: Any) -> str:
    words = name.removesuffix("_m").replace("_", " ")
    return f"{words} {value} m" if name.endswith("_m") else f"{words} {value}"


def _made(folder: Path) -> str:
    """With which omninav, as experiment.json states it."""
    path = folder / "experiment.json"
    stated: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    if not stated:
        return ""
    commit, dirty, _ = str(stated.get("git_commit") or "").partition("-dirty")
    known = f", commit {commit[:12]}" + (" with changes that are not committed" if dirty else "") if commit else ""
    return f"Made with omninav {stated.get('omninav')}{known}"


def _tiles(run: "ExperimentRun", verdicts: Sequence[Verdict]) -> list[dict[str, str]]:
    """What one looks for first: how many claims hold, and how much has run."""
    done = sum(len(cell.results) for cell in run.cells)
    wanted = sum(len(cell.seeds) for cell in run.cells)
    claims = [
        {"value": f"{sum(v.holds is True for v in verdicts)}", "of": f"of {len(verdicts)}", "name": "claims hold"}
    ]
    return [
        *(claims if verdicts else []),
        {"value": str(len(run.experiment.conditions())), "of": "", "name": "conditions"},
        {"value": str(done), "of": f"of {wanted}", "name": "repetitions done"},
        {"value": run.profile, "of": "", "name": "profile"},
    ]


def _condition(cell: Any, common: Sequence[str]) -> dict[str, Any]:
    first: Mapping[str, Any] = next(iter(cell.results.values()), {})
    metrics = first.get("metrics", {})
    frames = metrics.get("frames")
    length = metrics.get("driven_m")
    map_size = metrics.get("map", {})
    return {
        "name": cell.name,
        "own_words": shlex.join(word for word in cell.words if word not in common),
        "done": f"{len(cell.results)}/{len(cell.seeds)}",
        "run": {
            "frames": "" if frames is None else str(frames),
            "length (m)": "" if length is None else f"{length:.0f}",
            "spacing (m)": "" if not length or not frames else f"{length / frames:.2f}",
            "references": str(map_size.get("references", "")),
        },
        "error": cell.error,
    }


# the picture


def pictures_of(experiment: Experiment, results: Results) -> list[dict[str, Any]]:
    """Pictures of measures and curves: `file`, `title`, `caption`, `content` (PNG). None where nothing has run."""
    if not any(results.values()):
        return []
    page, found = experiment.page, []
    for index, name in enumerate(page.drawn or list(experiment.measures)[:1]):
        measure = experiment.measures[name]
        content = (
            _lines(experiment, results, name, page.along, page.panels)
            if page.along
            else _bars(experiment, results, name)
        )
        caption = f"{measure.title}: mean, and standard deviation over the repetitions"
        if experiment.published.get(name) and not page.along:
            caption += "; diamonds are the paper's figures"
        file = experiment.name + (f"_{name}" if index else "")
        found.append({"file": f"{file}.png", "title": measure.title, "caption": f"{caption}.", "content": content})
    for index, curve in enumerate(experiment.curves):
        content = _curve(experiment, results, curve)
        caption = (
            f"{curve.title} along {curve.along}: mean of the repetitions, in a band that holds the middle half of them"
        )
        file = f"{experiment.name}_curve_{index + 1}.png"
        found.append({"file": file, "title": curve.title, "caption": f"{caption}.", "content": content})
    return [drawing for drawing in found if drawing["content"]]


def _curve(experiment: Experiment, results: Results, curve: Curve) -> bytes:
    """A line for each condition: the mean of the repetitions' series, in a band that holds the middle half of them."""
    boxes = experiment.labels(curve.panels) if curve.panels else [""]
    conditions = [condition for condition in experiment.conditions() if condition.fits(curve.only)]
    shown = [f for f in experiment.sweep if f != curve.panels and f not in curve.only]
    colours = {
        name: PALETTE[n % len(PALETTE)] for n, name in enumerate(dict.fromkeys(_named(c, shown) for c in conditions))
    }
    levels: list[float] = []  # of each line: a map that grows from one reference is no reason for powers of ten
    with picture(4.6 * len(boxes) + 0.4, 3.8) as drawn:
        grid = drawn.canvas.subplots(1, len(boxes), squeeze=False, sharey=True)[0]
        for axes, box in zip(grid, boxes, strict=True):
            here = [c for c in conditions if not curve.panels or c.labels[curve.panels] == box]
            alike: dict[str, tuple[Array, Array]] = {}
            for condition in here:
                runs = list(results.get(key_of(condition.labels), {}).values())
                for label, path in curve.beside.items():
                    x, y = series_of(runs, path, curve.at)
                    if len(x):
                        alike.setdefault(label, (x, curve.times * np.nanmean(y, axis=0)))
                x, y = series_of(runs, curve.of, curve.at)
                if not len(x):
                    continue
                y = curve.times * y
                name, middle = _named(condition, shown), np.nanmean(y, axis=0)
                levels.append(float(np.nanmedian(middle)))
                marker = "o" if len(x) <= 30 else None
                axes.plot(
                    x, middle, color=colours[name], label=name or "ours", linewidth=1.5, marker=marker, markersize=3
                )
                if len(y) > 1:
                    low, high = np.nanpercentile(y, [25, 75], axis=0)
                    axes.fill_between(x, low, high, color=colours[name], alpha=0.18, linewidth=0)
            for index, (label, (x, y)) in enumerate(alike.items()):
                levels.append(float(np.nanmedian(y)))
                axes.plot(x, y, color="#555555", linestyle=("--", ":", "-.")[index % 3], linewidth=1.3, label=label)
            axes.set_title(box)
            axes.set_xlabel(curve.along)
            axes.locator_params(axis="x", integer=not curve.at)  # there is no lap 1.5
        if not levels:
            return b""
        _scale(grid[0], levels, 10.0)
        grid[0].set_ylabel(curve.title)
        _legend_above(drawn.canvas, grid)
    return drawn.content


def series_of(runs: Sequence[Mapping[str, Any]], path: str, at_path: str = "") -> tuple[Array, Array]:
    """Where the entries of a series lie (N,), and the series of all runs that have it (runs, N); NaN where one ends.

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
    boxes = experiment.labels(panels) if panels else [""]
    series = [factor for factor in experiment.sweep if factor not in (along, panels)]
    combinations = list(itertools.product(*(experiment.labels(factor) for factor in series)))
    heights: list[float] = []
    with picture(4.6 * len(boxes) + 0.4, 3.8) as drawn:
        grid = drawn.canvas.subplots(1, len(boxes), squeeze=False, sharey=True)[0]
        for axes, box in zip(grid, boxes, strict=True):
            for index, chosen in enumerate(combinations):
                labels = dict(zip(series, chosen, strict=True)) | ({panels: box} if panels else {})
                points = [
                    (float(x), samples(experiment, results, name, labels | {along: x}))
                    for x in experiment.labels(along)
                ]
                known = [(x, list(found.values())) for x, found in points if found]
                heights += [float(np.mean(values)) for _, values in known]
                axes.errorbar(
                    [x for x, _ in known],
                    [float(np.mean(v)) for _, v in known],
                    yerr=[float(np.std(v)) for _, v in known],
                    color=PALETTE[index % len(PALETTE)],
                    marker="os^Dvx"[index % 6],
                    markersize=4,
                    capsize=2.5,
                    linewidth=1.4,
                    elinewidth=0.8,
                    label=", ".join(chosen),
                )
            axes.set_title(box)
            axes.set_xlabel(along)
        _scale(grid[0], heights)
        grid[0].set_ylabel(measure.title)
        _legend_above(drawn.canvas, grid)
    return drawn.content


def _bars(experiment: Experiment, results: Results, name: str) -> bytes:
    """Bars; error bars are the spread, hollow diamonds the paper's figures."""
    measure = experiment.measures[name]
    columns, rows = experiment.labels(experiment.page.columns), _row_labels(experiment)
    width = 0.8 / len(rows)
    all_heights: list[float] = []
    with picture(max(5.0, 1.1 + len(columns) * max(0.42 * (len(rows) + 1), 0.95)), 3.6) as drawn:
        axes = drawn.canvas.subplots()
        for index, labels in enumerate(rows):
            at = np.arange(len(columns)) + (index - (len(rows) - 1) / 2) * width
            found = [
                list(samples(experiment, results, name, labels | {experiment.page.columns: c}).values())
                for c in columns
            ]
            heights = [float(np.mean(v)) if v else np.nan for v in found]
            spreads = [float(np.std(v)) if v else np.nan for v in found]
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
        axes.set_xticks(np.arange(len(columns)), [textwrap.fill(c, 14) for c in columns])
        axes.set_ylabel(measure.title)
        _scale(axes, all_heights)
        axes.grid(axis="x", visible=False)
        if axes.get_legend_handles_labels()[1]:
            axes.legend(ncols=2, loc="lower left", bbox_to_anchor=(0.0, 1.0), borderaxespad=0.2)
    return drawn.content


def _legend_above(canvas: Any, grid: Any) -> None:
    """One legend for all boxes, where it hides none of the lines."""
    lines: dict[str, Any] = {}
    for axes in grid:
        handles, labels = axes.get_legend_handles_labels()
        lines |= dict(zip(labels, handles, strict=True))
    if lines:
        canvas.legend(lines.values(), lines.keys(), loc="outside upper left", ncols=min(3, len(lines)))


def _scale(axes: Any, heights: Sequence[float], apart: float = 20.0) -> None:
    """From zero up; in powers of ten where the highest, `apart` times the lowest, would hide it."""
    above = [height for height in heights if height > 0]
    if above and max(above) > apart * min(above):
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.5 * min(above))
    else:
        axes.set_ylim(bottom=0)


def verdict_lines(verdicts: Sequence[Mapping[str, Any]]) -> list[str]:
    """Verdicts for the terminal, a line each."""
    return [f"{verdict['holds']:>14}  {verdict['claim']}" for verdict in verdicts]
