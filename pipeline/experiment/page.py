"""An experiment as one page: verdicts, the paper's values next to ours, failures, and how to reproduce it."""

import base64
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from omninav.pipeline.files import write_whole
from omninav.pipeline.report.rendering import render

from .intervals import share_interval
from .plots import PagePlot, plots_of
from .result import SUFFIX, Cell, ExperimentResult, result_text, rows_of
from .specification import Claim, Experiment, Measure
from .verdicts import RUNS_SHARE, Case, Verdict, in_words

STYLES = {"holds": "held", "does not hold": "broken", "undecided": "quiet"}
"""The CSS class of a verdict."""


def write_page(experiment: Experiment, result: ExperimentResult, folder: Path) -> Path:
    """Write `<name>.md`, `<name>.html`, its plots and `<name>.result.json` into the experiment's folder.

    All of it follows from the result alone; conditions that failed or are still to run are named.
    """
    write_whole(folder / f"{experiment.name}{SUFFIX}", result_text(result))
    plots = plots_of(experiment, result)
    for file, written in markdown_page(experiment, result, plots).items():
        write_whole(folder / file, written)
    path = folder / f"{experiment.name}.html"
    inside = [replace(p, file=f"data:image/png;base64,{base64.b64encode(p.content).decode()}") for p in plots]
    write_whole(path, render("experiment.html", **_values(experiment, result, inside)))
    return path


def markdown_page(
    experiment: Experiment, result: ExperimentResult, plots: Sequence[PagePlot]
) -> dict[str, str | bytes]:
    """The page as Markdown, and its plots, by the names of their files."""
    page = render("experiment.md", **_values(experiment, result, plots))
    return {f"{experiment.name}.md": page, **{plot.file: plot.content for plot in plots}}


def _values(experiment: Experiment, result: ExperimentResult, plots: Sequence[PagePlot]) -> dict[str, Any]:
    """Returns the values that the templates read."""
    verdicts = result.judged(experiment)
    return {
        "experiment": experiment,
        "result": result,
        "verdicts": [_verdict(experiment, experiment.claims[key], verdict) for key, verdict in verdicts.items()],
        "tables": [measure_table(experiment, result, name) for name in experiment.measures if name in result.cells],
        "context_columns": list(dict.fromkeys(name for row in result.conditions for name in row.context)),
        "styles": STYLES,
        "tiles": _tiles(experiment, result, list(verdicts.values())),
        "repetitions": result.repeated.partition(" ")[0],
        "plots": plots,
    }


def number(value: float | None, digits: int) -> str:
    """A value with a measure's digits, more where it would look like 0 and is not; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    return f"{value:.1g}" if 0.0 < abs(value) <= 0.5 * 10.0**-digits else f"{value:.{digits}f}"


def summary(measure: Measure, cell: Cell) -> str:
    """Mean ± standard deviation, or the value that the measure judges; a dash where there is nothing."""
    mean = number(cell.figure, measure.digits)
    return mean if cell.spread is None else f"{mean} ± {number(cell.spread, measure.digits)}"


def beyond_the_mean(measure: Measure, cell: Cell) -> list[str]:
    """Note under a mean: the median where it differs, and how many of those that ran have a value at all."""
    digits = measure.digits
    parts = []
    if cell.median is not None and number(cell.median, digits) != number(cell.figure, digits):
        parts.append(f"median {number(cell.median, digits)}")
    if cell.found < cell.ran:
        parts.append(f"{cell.found} of {cell.ran}")
    if cell.development is not None:
        parts.append(f"development {number(cell.development, digits)}")
    return parts


def _verdict(experiment: Experiment, claim: Claim, verdict: Verdict) -> dict[str, Any]:
    measure = experiment.measures[claim.measure]
    said = " ".join(part for part in (claim.paper, claim.where and f"({claim.where})") if part)
    return {
        "claim": claim.statement,
        "paper": (f"{said}: “{claim.quote}”" if said and claim.quote else said or claim.quote)
        + (f" Struck: {claim.struck}." if claim.struck else ""),
        "measure": measure.title,
        "holds": in_words(verdict.holds),
        "words": verdict.words,
        "rows": [_case(case, measure) for case in verdict.cases],
    }


def _case(case: Case, measure: Measure) -> dict[str, str]:
    digits = max(2, measure.digits) if case.ratio else measure.digits
    difference = interval = ""
    if case.kept is not None:
        share = ", ".join(f"{end:.2f}" for end in share_interval(case.kept, case.repetitions))
        difference, interval = f"{case.kept} of {case.repetitions} runs", f"[{share}], {RUNS_SHARE:g} asked"
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
        "holds": in_words(case.holds),
        "words": Verdict((case,)).words,
    }


def measure_table(experiment: Experiment, result: ExperimentResult, name: str) -> dict[str, Any]:
    """A measure's table: the page's rows and columns, with the paper's values beside ours."""
    measure, page = experiment.measures[name], experiment.page
    columns = experiment.labels(page.columns)
    rows = []
    for labels in rows_of(experiment):
        cells = []
        for column in columns:
            cell = result.cell(name, (*labels.values(), column))
            paper = experiment.published_value(name, labels | {page.columns: column})
            ours, more = summary(measure, cell), ", ".join(beyond_the_mean(measure, cell))
            cells.append({"ours": ours, "more": more, "paper": number(paper, measure.digits)})
        rows.append({"head": list(labels.values()) or ["all"], "cells": cells})
    return {
        "title": measure.title,
        "heads": list(page.rows) or [""],
        "columns": columns,
        "rows": rows,
        "printed": bool(experiment.published.get(name)),
    }


def _tiles(experiment: Experiment, result: ExperimentResult, verdicts: Sequence[Verdict]) -> list[dict[str, str]]:
    """Tiles: how many claims hold, and how much has run."""
    done, total = (sum(int(row.done.split("/")[part]) for row in result.conditions) for part in (0, 1))
    holding = sum(verdict.holds is True for verdict in verdicts)
    undecided = sum(verdict.holds is None for verdict in verdicts)
    name = "claims hold" + (f", {undecided} undecided" if undecided else "")
    claims = [{"value": str(holding), "of": f"of {len(verdicts)}", "name": name}]
    return [
        *(claims if verdicts else []),
        {"value": str(len(experiment.conditions())), "of": "", "name": "conditions"},
        {"value": str(done), "of": f"of {total}", "name": "repetitions done"},
        {"value": result.profile, "of": "", "name": "profile"},
    ]
