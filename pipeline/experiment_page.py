"""An experiment as one page: verdicts, the paper's table or figure beside ours, failures, and how to run it again."""

import base64
import itertools
import json
import math
import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .experiment import Experiment, Labels, Measure, figure_of
from .files import write_whole
from .picture import PALETTE, picture
from .report import render
from .verdicts import Case, Results, Verdict, judge, key_of, samples

if TYPE_CHECKING:
    from .experiment_run import ExperimentRun

MARKS = {"holds": "held", "does not hold": "broken", "undecided": "quiet"}
"""How a verdict looks."""


def write_page(run: "ExperimentRun") -> Path:
    """Write `<name>.md`, `<name>.html`, `<name>.png` and `verdicts.json` into the experiment's folder.

    All of it follows from the repetitions' results as they stand; conditions that failed or are still to run say so.
    """
    experiment, folder = run.experiment, run.folder
    results: Results = {key_of(cell.condition.labels): cell.results for cell in run.cells}
    verdicts = judge(experiment, results)
    write_whole(
        folder / "verdicts.json",
        json.dumps([verdict.plain() for verdict in verdicts], indent=1, ensure_ascii=False) + "\n",
    )
    drawing = draw(experiment, results)
    if drawing:
        write_whole(folder / f"{experiment.name}.png", drawing)
    first = run.cells[0].words
    common = [word for word in first if all(word in cell.words for cell in run.cells)]
    said: dict[str, Any] = {
        "experiment": experiment,
        "profile": run.profile,
        "command": shlex.join(run.argv),
        "verdicts": [_verdict(experiment, verdict) for verdict in verdicts],
        "tables": [_table(experiment, results, name) for name in experiment.measures],
        "remarks": [_remark(run, number) for number in range(len(experiment.remarks))],
        "logs": [(log.name, _facts(log.facts)) for log in run.logs.values()],
        "conditions": [_condition(cell, common) for cell in run.cells],
        "common_words": common,
        "made": _made(folder),
        "marks": MARKS,
        "tiles": _tiles(run, verdicts),
        "failures": [(cell.name, cell.error) for cell in run.all_cells if cell.error],
        "missing": sum(len(cell.seeds) - len(cell.results) for cell in run.all_cells if not cell.error),
        "repetitions": experiment.repetitions,
        "picture": f"{experiment.name}.png" if drawing else "",
    }
    write_whole(folder / f"{experiment.name}.md", render("experiment.md", **said))
    image = "data:image/png;base64," + base64.b64encode(drawing).decode() if drawing else ""
    path = folder / f"{experiment.name}.html"
    write_whole(path, render("experiment.html", **(said | {"picture": image})))
    return path


# words


def number(value: float | None, digits: int) -> str:
    """A figure with a measure's digits; a dash where there is none."""
    return "–" if value is None or not math.isfinite(value) else f"{value:.{digits}f}"


def mean_and_spread(values: Sequence[float], digits: int) -> str:
    """Mean ± standard deviation; a dash where there is nothing."""
    return f"{number(float(np.mean(values)), digits)} ± {number(float(np.std(values)), digits)}" if values else "–"


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
    digits = measure.digits
    difference = interval = ""
    if case.difference is not None and case.interval is not None:
        low, high = (f"{end:+.{digits}f}" for end in case.interval)
        difference, interval = f"{case.difference:+.{digits}f}", f"[{low}, {high}]"
    return {
        "where": case.where,
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
            found = list(samples(experiment, results, name, here).values())
            cells.append(
                {
                    "ours": mean_and_spread(found, measure.digits),
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
    for cell in run.beside[number_]:
        found = [figure_of(measure, result) for result in cell.results.values()]
        known = [figure for figure in found if figure is not None]
        parts.append(f"{cell.condition.labels[remark.over]} {number(float(np.mean(known)), 1) if known else 'not run'}")
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
        {"value": str(len(run.cells)), "of": "", "name": "conditions"},
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
        "frames": "" if frames is None else str(frames),
        "length": "" if length is None else f"{length:.0f}",
        "spacing": "" if not length or not frames else f"{length / frames:.2f}",
        "references": str(map_size.get("references", "")),
        "error": cell.error,
    }


# the picture


def draw(experiment: Experiment, results: Results) -> bytes:
    """The first measure of all conditions: lines along a numeric factor, or bars; error bars are the spread.

    The paper's figures are hollow diamonds. Empty where nothing has run.
    """
    if not any(results.values()):
        return b""
    page = experiment.page
    if page.along:
        return _lines(experiment, results, page.along, page.panels)
    return _bars(experiment, results)


def _lines(experiment: Experiment, results: Results, along: str, panels: str | None) -> bytes:
    name, measure = next(iter(experiment.measures.items()))
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
        grid[0].legend()
    return drawn.content


def _bars(experiment: Experiment, results: Results) -> bytes:
    name, measure = next(iter(experiment.measures.items()))
    columns, rows = experiment.labels(experiment.page.columns), _row_labels(experiment)
    width = 0.8 / len(rows)
    all_heights: list[float] = []
    with picture(max(5.0, 1.1 + 0.42 * len(columns) * (len(rows) + 1)), 3.6) as drawn:
        axes = drawn.canvas.subplots()
        for index, labels in enumerate(rows):
            at = np.arange(len(columns)) + (index - (len(rows) - 1) / 2) * width
            found = [
                list(samples(experiment, results, name, labels | {experiment.page.columns: c}).values())
                for c in columns
            ]
            heights = [float(np.mean(v)) if v else 0.0 for v in found]
            spreads = [float(np.std(v)) if v else 0.0 for v in found]
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
        axes.set_xticks(np.arange(len(columns)), columns)
        axes.set_ylabel(measure.title)
        _scale(axes, all_heights)
        axes.grid(axis="x", visible=False)
        axes.legend(ncols=2)
    return drawn.content


def _scale(axes: Any, heights: Sequence[float]) -> None:
    """From zero up; in powers of ten where the highest would hide the lowest."""
    above = [height for height in heights if height > 0]
    if above and max(above) > 20 * min(above):
        axes.set_yscale("log")
        axes.set_ylim(bottom=0.5 * min(above))
    else:
        axes.set_ylim(bottom=0)


def verdict_lines(verdicts: Sequence[Mapping[str, Any]]) -> list[str]:
    """Verdicts for the terminal, a line each."""
    return [f"{verdict['holds']:>14}  {verdict['claim']}" for verdict in verdicts]
