"""An experiment as one page: verdicts, the paper's figures next to ours, failures, and how to reproduce it."""

import base64
import json
import math
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from omninav.pipeline.files import write_whole
from omninav.pipeline.report.quantities import title, unit
from omninav.pipeline.report.rendering import render

from .conditions import ConditionRun
from .plots import plots_of, row_labels
from .specification import DEVELOPMENT, Experiment, Measure, figure_of
from .verdicts import MIN_SCENARIOS, Case, Results, Verdict, in_words, judge, key_of, over_runs, pooled, samples

STYLES = {"holds": "held", "does not hold": "broken", "undecided": "quiet"}
"""The CSS class of a verdict."""


@dataclass(frozen=True)
class PageContent:
    """An experiment as far as it has run."""

    experiment: Experiment
    profile: str
    argv: Sequence[str]
    conditions: Sequence[ConditionRun]
    references: Sequence[Sequence[ConditionRun]]
    """The runs of each of the file's `reference_runs`."""
    recordings: Sequence[tuple[str, Mapping[str, Any]]]
    """Names of recordings, and what was stated of them."""
    made_with: str
    """Version and commit."""

    @property
    def all_runs(self) -> list[ConditionRun]:
        """Conditions and reference runs."""
        return [*self.conditions, *(run for several in self.references for run in several)]


def write_page(content: PageContent, results: Results, development: Results, folder: Path) -> Path:
    """Write `<name>.md`, `<name>.html`, its plots and `verdicts.json` into the experiment's folder.

    All of it follows from the results as they stand; conditions that failed or are still to run are named. Those of
    `development` stand beside the others in the tables, and nothing else is made of them.
    """
    experiment, conditions = content.experiment, content.conditions
    verdicts = judge(experiment, results)
    plain = [verdict.plain() for verdict in verdicts]
    write_whole(folder / "verdicts.json", json.dumps(plain, indent=1, ensure_ascii=False) + "\n")
    plots = plots_of(experiment, results)
    for plot in plots:
        write_whole(folder / plot.file, plot.content)
    common = [word for word in conditions[0].overrides if all(word in run.overrides for run in conditions)]
    rows = [_condition(run, common) for run in conditions]
    values: dict[str, Any] = {
        "experiment": experiment,
        "profile": content.profile,
        "command": shlex.join(content.argv),
        "verdicts": [_verdict(experiment, verdict) for verdict in verdicts],
        "tables": [_table(experiment, results, development, name) for name in experiment.measures],
        "reference_runs": [reference_text(content, number) for number in range(len(experiment.reference_runs))],
        "recordings": [(name, _facts(facts)) for name, facts in content.recordings],
        "conditions": rows,
        "context_columns": list(dict.fromkeys(name for row in rows for name in row["context"])),
        "common_overrides": common,
        "made_with": content.made_with,
        "styles": STYLES,
        "tiles": _tiles(content, verdicts),
        "failures": [(run.name, run.error) for run in content.all_runs if run.error],
        "missing": sum(len(run.missing) for run in content.all_runs if not run.error),
        "repetitions": experiment.runs_of_a_condition,
        "seeds": experiment.repetitions,
        "min_scenarios": MIN_SCENARIOS,
        "plots": plots,
    }
    write_whole(folder / f"{experiment.name}.md", render("experiment.md", **values))
    values["plots"] = [
        replace(plot, file=f"data:image/png;base64,{base64.b64encode(plot.content).decode()}") for plot in plots
    ]
    path = folder / f"{experiment.name}.html"
    write_whole(path, render("experiment.html", **values))
    return path


def number(value: float | None, digits: int) -> str:
    """A figure with a measure's digits, more where it would look like 0 and is not; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    text = f"{value:.{digits}f}"
    return f"{value:.1g}" if value and not float(text) else text


def made_with(version: str, commit: str | None) -> str:
    """Version and commit at which a page was made: in 12 digits, and whether it had changes."""
    known, dirty, _ = (commit or "").partition("-dirty")
    at = f", commit {known[:12]}" + (" with changes that are not committed" if dirty else "") if known else ""
    return f"Made with omninav {version}{at}"


def summary(measure: Measure, values: Sequence[float]) -> str:
    """Mean ± standard deviation, or the figure that the measure judges; a dash where there is nothing."""
    digits = measure.digits
    if not values or len(values) == 1 or measure.over_runs != "mean":
        return number(over_runs(measure, values) if values else None, digits)
    mean, spread = float(np.mean(values)), float(np.std(values))
    spread = spread if spread > 1e-9 * abs(mean) else 0.0  # equal figures, but for rounding
    return f"{number(mean, digits)} ± {number(spread, digits)}"


def beyond_the_mean(measure: Measure, values: Sequence[float], ran: int) -> list[str]:
    """Note under a mean: the median where it differs, and how many of those that ran have a figure at all."""
    shown, median = (
        (number(of, measure.digits) for of in (over_runs(measure, values), float(np.median(values))))
        if values
        else ("", "")
    )
    parts = [f"median {median}"] if shown != median else []
    return [*parts, f"{len(values)} of {ran}"] if len(values) < ran else parts


def _verdict(experiment: Experiment, verdict: Verdict) -> dict[str, Any]:
    measure = next(m for m in experiment.measures.values() if m.title == verdict.measure)
    rows = [_case(case, measure) for case in verdict.cases]
    return {
        "claim": verdict.claim,
        "paper": verdict.paper,
        "measure": measure.title,
        "holds": in_words(verdict.holds),
        "rows": rows,
    }


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
        "holds": in_words(case.holds),
    }


def _table(experiment: Experiment, results: Results, development: Results, name: str) -> dict[str, Any]:
    measure, page = experiment.measures[name], experiment.page
    columns = experiment.labels(page.columns)
    printed = bool(experiment.published.get(name))
    rows = []
    for labels in row_labels(experiment):
        cells = []
        for column in columns:
            here = labels | {page.columns: column}
            ran = len(results.get(key_of(here), {}))
            found = list(samples(experiment, results, name, here).values())
            more = beyond_the_mean(measure, found, ran)
            chosen_on = list(samples(experiment, development, name, here).values())
            if chosen_on and not measure.pooled:
                more.append(f"development {number(over_runs(measure, chosen_on), measure.digits)}")
            if measure.pooled:
                whole = pooled(experiment, results, name, here)
                found, more = [] if whole is None else [whole], []
            cells.append(
                {
                    "ours": summary(measure, found),
                    "more": ", ".join(more),
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


def reference_text(content: PageContent, index: int) -> str:
    """A sentence with the figures of its reference runs, but those of development."""
    reference = content.experiment.reference_runs[index]
    measure = Measure("", (reference.measure,), reference.scale)
    parts = []
    for label in content.experiment.labels(reference.over):
        runs = [run for run in content.references[index] if run.condition.labels[reference.over] == label]
        counted = [run for run in runs if run.scenario != DEVELOPMENT]
        found = [figure_of(measure, result) for run in counted for result in run.results.values()]
        known = [figure for figure in found if figure is not None]
        parts.append(f"{label} {number(float(np.mean(known)), 1) if known else 'not run'}")
    return reference.text.replace("{}", "; ".join(parts))


def _facts(facts: Mapping[str, Any]) -> str:
    return ", ".join(_in_words(key, value) for key, value in facts.items())


def _in_words(name: str, value: Any) -> str:
    return f"{title(name).lower()} {value} {unit(name)}".rstrip()


def _tiles(content: PageContent, verdicts: Sequence[Verdict]) -> list[dict[str, str]]:
    """Tiles: how many claims hold, and how much has run."""
    done = sum(len(run.results) for run in content.conditions)
    total = sum(len(run.seeds) for run in content.conditions)
    holding = sum(verdict.holds is True for verdict in verdicts)
    undecided = sum(verdict.holds is None for verdict in verdicts)
    name = "claims hold" + (f", {undecided} undecided" if undecided else "")
    claims = [{"value": str(holding), "of": f"of {len(verdicts)}", "name": name}]
    return [
        *(claims if verdicts else []),
        {"value": str(len(content.experiment.conditions())), "of": "", "name": "conditions"},
        {"value": str(done), "of": f"of {total}", "name": "repetitions done"},
        {"value": content.profile, "of": "", "name": "profile"},
    ]


def _condition(run: ConditionRun, common: Sequence[str]) -> dict[str, Any]:
    first: Mapping[str, Any] = next(iter(run.results.values()), {})
    return {
        "name": run.name,
        "overrides": shlex.join(word for word in run.overrides if word not in common),
        "done": f"{len(run.results)}/{len(run.seeds)}",
        "context": first.get("context", {}),
    }
