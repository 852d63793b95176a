"""An experiment as a file: what is varied, what is measured, what the paper claims; read and checked.

Every combination of the sweep's labels is a condition, and each condition is run once for every seed.
"""

import itertools
import math
import re
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from omninav.pipeline.graph.ports import convert, convert_fields
from omninav.pipeline.graph.problems import Problem, ProblemsFound, shown, suggest

from .series import Aggregate, value_at

TYPED = ("common", "set", "scenarios", "development", "sweep")
"""Entries of a file that are overrides, or labels of overrides."""
NAME = re.compile(r"[A-Za-z0-9_-]{1,100}")
"""Pattern of an experiment's name: its pages and its folder are named after it."""
MAX_RUNS = 100_000
"""Conditions of an experiment, and repetitions of each."""
MARGINS = {"cm": 5.0, "m": 0.05, "degrees": 2.0, "%": 1.0}
"""Largest difference that does not matter, by the unit in which a measure's title ends.

Five centimetres and two degrees are about what two good drives along one path differ by, and little for something that
is 0.5 m wide and passes doors of 1 m; 1 % is one step in a hundred.
"""
MARGIN_SHARE = 0.05
"""The same of times, counts, sizes and ratios: a share of the other side."""
Labels = dict[str, str]
"""A condition's label in each factor, or in some of them: `{filter: median, data: first}`."""


@dataclass(frozen=True)
class Measure:
    """A value read from each run's metrics.json (or from `timing.` or `facts.`)."""

    title: str
    path: tuple[str, ...]
    """Paths to look at; the first that exists counts; paths joined by + are added. With `stages` it is
    `p50_ms`, `p95_ms` or `max_ms`."""
    scale: float = 1.0
    """The value is multiplied by it, for another unit."""
    digits: int = 1
    """Decimals that are shown."""
    aggregate: Aggregate = "mean"
    """Rule by which a series (`laps.*.error_m.mean`) becomes one value."""
    window: tuple[float, float] = (0.0, 1.0)
    """The share of the series that counts."""
    stages: tuple[str, ...] = ()
    """Stages whose time together (ms), step by step, is the value."""
    over_runs: Literal["mean", "largest", "smallest"] = "mean"
    """Which value of the repetitions' is shown: with `largest`, that of the worst of them. Claims about a worst value
    count the runs that keep to the limit."""
    margin: float | None = None
    """Largest difference that does not matter, in the measure's unit; None: that of `MARGINS`."""

    def margin_beside(self, other: float) -> float:
        """The largest difference to a value that does not matter."""
        unit = self.title.rstrip(")").rpartition("(")[2].split()[-1:] if self.title.endswith(")") else []
        known = MARGINS.get(unit[0]) if unit else None
        margin = known if self.margin is None else self.margin
        return MARGIN_SHARE * abs(other) if margin is None else margin


Other = float | str | Mapping[str, Any]
"""The other side of a claim's comparison: a number, `published`, or the labels of another condition."""


@dataclass(frozen=True)
class Claim:
    """Something the paper states (or that we expect), as a comparison that comes out true or false.

    It has one case for each condition with the labels of `of`, and makes one comparison, by the whole 95 % interval:
    `at_most`, `at_least`, `below`, `above`, or `not_above` (better, or worse by no more than the measure's margin);
    with all other conditions `lowest`. It is false where the whole interval is on the other side, else undecided.
    """

    statement: str
    measure: str
    of: Mapping[str, Any] = field(default_factory=dict)
    """Labels of the conditions it is about."""
    at_most: Other | None = None
    at_least: Other | None = None
    below: Other | None = None
    above: Other | None = None
    not_above: Other | None = None
    lowest: bool = False
    """Asks that the value is `not_above` that of each other condition."""
    among: tuple[str, ...] = ()
    """Factors in which the other conditions of `lowest` differ; by default those of `of`."""
    scale: float = 1.0
    """The other side is multiplied by it."""
    ratio_to: Mapping[str, Any] | None = None
    """Labels of a condition: the value is then the ratio of the two means, and is compared with a number."""
    paper: str = ""
    """The paper's statement that it judges, in our words, with its value."""
    where: str = ""
    """Place in the paper: section, figure, table, equation. With it the claim is listed among those of `source`."""
    quote: str = ""
    """The paper's own words, where they say more."""
    struck: str = ""
    """Reason for which it does not count among the paper's claims; it is judged and shown all the same."""


@dataclass(frozen=True)
class PageLayout:
    """Layout of the results on the page."""

    columns: str
    """The factor of the table's columns."""
    rows: tuple[str, ...] = ()
    """Factors of its rows."""
    along: str | None = None
    """A numeric factor: plots are lines along it. None: bars."""
    panels: str | None = None
    """The factor that has a panel for each label."""
    drawn: tuple[str, ...] = ()
    """Measures that are plotted; by default the first."""


@dataclass(frozen=True)
class Curve:
    """A plot of how something develops within the runs, over laps, logs, steps or a distance: a line per condition."""

    title: str
    x_label: str
    path: str
    """The path of a series (`laps.*.error_m.mean`)."""
    x_path: str = ""
    """The path of its entries; by default 1, 2, 3 …"""
    scale: float = 1.0
    panels: str | None = None
    """The factor that has a panel for each label."""
    only: Mapping[str, Any] = field(default_factory=dict)
    """Labels that a condition must have to be drawn."""
    reference: Mapping[str, str] = field(default_factory=dict)
    """Label -> path of a series that is equal in all conditions of a panel and drawn once, dashed."""


@dataclass(frozen=True)
class Experiment:
    """Content of an experiment's file. Overrides are written as one would type them, or as a list of such words."""

    name: str
    title: str
    about: str
    variant: str
    sweep: Mapping[str, Mapping[Any, str]]
    """Factor -> label -> overrides."""
    measures: Mapping[str, Measure]
    page: PageLayout
    common: str = ""
    """Overrides of all runs."""
    set: str = ""
    """Overrides of all conditions."""
    repetitions: int = 50
    """Each condition is run with this many seeds in each scenario, 0, 1, 2, … in the order of the scenarios."""
    scenarios: Mapping[str, str] = field(default_factory=dict)
    """Label -> overrides: other data. Each condition is run in each of them, with seeds of its own. Intervals
    resample them first."""
    development: Mapping[str, str] = field(default_factory=dict)
    """Label -> overrides of scenarios on which choices are made. They run where there are no `scenarios`, and are never
    judged."""
    without: tuple[Mapping[str, Any], ...] = ()
    """Labels of conditions that are not run."""
    published: Mapping[str, Any] = field(default_factory=dict)
    """Measure -> labels in the order of the page's rows and column -> the paper's value."""
    source: str = ""
    """The paper that its claims are from: `Porta & Kröse 2004`."""
    claims: Mapping[str, Claim] = field(default_factory=dict)
    """Key -> claim. Results name a claim by its key, so that its sentences may change."""
    curves: tuple[Curve, ...] = ()
    notes: tuple[str, ...] = ()
    best: tuple[str, ...] = ()
    """Measures by which the best condition over the scenarios of development is named: that with the least value of
    the first, among equals of the next."""
    shared: bool = True
    """The repetitions of a condition share what does not depend on the seed, and other experiments its results; false
    where time is measured."""
    cores: int | None = None
    """Jobs at a time; None: one for each core."""
    profiles: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    """Profile -> what it changes in this file."""

    def conditions(self) -> list["Condition"]:
        """Every combination of the sweep's labels but those of `without`, the last factor changing fastest."""
        factors = [
            [(factor, str(label), overrides) for label, overrides in self.sweep[factor].items()]
            for factor in self.sweep
        ]
        found = [
            Condition({factor: label for factor, label, _ in chosen}, " ".join(typed for _, _, typed in chosen))
            for chosen in itertools.product(*factors)
        ]
        return [condition for condition in found if not any(condition.fits(labels) for labels in self.without)]

    @property
    def runs_of_a_condition(self) -> int:
        """Number of repetitions of each condition that count: every seed in every scenario."""
        return self.repetitions * len(self.all_scenarios)

    @property
    def named_scenarios(self) -> Mapping[str, str]:
        """Scenarios that run: those that are judged, else those of development."""
        return self.scenarios or self.development

    @property
    def all_scenarios(self) -> Mapping[str, str]:
        """The same, or a nameless one where there are none."""
        return self.named_scenarios or {"": ""}

    def labels(self, factor: str) -> list[str]:
        """The labels of a factor, in the file's order."""
        return [str(label) for label in self.sweep[factor]]

    def published_value(self, measure: str, labels: Labels) -> float | None:
        """The paper's value of a condition, None where it prints none."""
        found: Any = self.published.get(measure)
        for factor in (*self.page.rows, self.page.columns):
            found = _entry(found, labels[factor]) if isinstance(found, Mapping) else None
        return float(found) if isinstance(found, int | float) else None


@dataclass(frozen=True)
class Condition:
    """One combination of the sweep's labels, with the overrides that make it."""

    labels: Labels
    overrides: str

    @property
    def name(self) -> str:
        """Its labels in one line."""
        return ", ".join(f"{factor} {label}" for factor, label in self.labels.items())

    def fits(self, labels: Mapping[str, Any]) -> bool:
        """Tells whether it has all of these labels."""
        return all(self.labels.get(factor) == str(label) for factor, label in labels.items())


FULL = "full"
"""The profile that an experiment's file describes by itself."""


def read_experiment(plain: Mapping[str, Any], profile: str) -> Experiment:
    """The experiment that a file describes, at the scale of a profile. Raises `ProblemsFound` with all problems.

    A profile changes entries of the file: mappings key by key; claims, the labels of a factor and all else as a whole.
    A file that extends another (its `defaults`) takes a label or a measure of that one out by setting it to null.
    """
    profiles, problems = convert(plain.get("profiles") or {}, dict[str, dict | None], "profiles")  # type: ignore[type-arg]
    if problems:
        raise ProblemsFound(problems)
    if profile not in {FULL, *profiles}:
        hint = suggest(profile, {FULL, *map(str, profiles)}, "profiles", prefix="profile=")
        raise ProblemsFound([Problem("profile", f"this experiment has no profile '{profile}'", hint)])
    scaled = dict(plain)
    for key, value in (profiles.get(profile) or {}).items():
        both = key != "claims" and isinstance(value, Mapping) and isinstance(scaled.get(key), Mapping)
        scaled[key] = {**scaled[key], **value} if both else value
    sweep = scaled.get("sweep") or {}
    if isinstance(sweep, Mapping):
        scaled["sweep"] = {factor: _without_null(labels) for factor, labels in sweep.items()}
    for key in ("measures", "scenarios", "development", "claims"):
        scaled[key] = _without_null(scaled.get(key) or {})
    if isinstance(scaled["claims"], list):
        hint = "claims: {closer: {statement: …, measure: …}}"
        raise ProblemsFound([Problem("experiment.claims", "a list, expected a mapping: a key for each claim", hint)])
    scaled |= {key: _as_typed(scaled[key]) for key in TYPED if key in scaled}
    arguments, problems = convert_fields(scaled, Experiment, "experiment")
    if problems:
        raise ProblemsFound(_hinted(problem) for problem in problems)
    experiment = Experiment(**arguments)
    problems = list(_contradictions(experiment))
    if problems:
        raise ProblemsFound(problems)
    return experiment


def _hinted(problem: Problem) -> Problem:
    place = problem.where.removeprefix("experiment.")
    if problem.hint == f"type {problem.where}=…":
        return Problem(problem.where, problem.what, "write it in the experiment's file")
    if place.partition(".")[0] not in TYPED or problem.hint:
        return problem
    label = place.rpartition(".")[2]
    return Problem(problem.where, problem.what, f"write what one would type: {label}: start=truth seed=1, or a list")


def _as_typed(written: Any) -> Any:
    """Overrides as one would type them, also where a list holds them one by one; within labels too.

    Anything else stays as it is, because its type is checked later.
    """
    if isinstance(written, Mapping) and written:
        return {label: _as_typed(part) for label, part in written.items()}
    if isinstance(written, list) and all(isinstance(word, str) for word in written):
        return shlex.join(written)
    return written


def _without_null(entries: Any) -> Any:
    """A mapping without its entries of null; anything else as it is, because its type is checked later."""
    if not isinstance(entries, Mapping):
        return entries
    return {key: value for key, value in entries.items() if value is not None}


def _contradictions(experiment: Experiment) -> "list[Problem]":
    problems = []
    if not NAME.fullmatch(experiment.name):
        what = f"{shown(experiment.name)}, expected at most 100 letters, digits, '_' and '-': files are named after it"
        problems.append(Problem("experiment.name", what))
    for label in experiment.scenarios.keys() & experiment.development.keys():
        what = f"'{label}' is of development too, which is not judged"
        problems.append(Problem("experiment.scenarios", what, "choose another label"))
    factors = list(experiment.sweep)
    if not 1 <= experiment.repetitions <= MAX_RUNS:
        problems.append(Problem("experiment.repetitions", f"expected at least 1, and at most {MAX_RUNS:,}"))
    conditions = math.prod(len(labels) for labels in experiment.sweep.values())
    if conditions > MAX_RUNS:
        problems.append(Problem("experiment.sweep", f"{conditions:,} conditions, expected at most {MAX_RUNS:,}"))
    page = experiment.page
    named = [("page.rows", f) for f in page.rows] + [("page.columns", page.columns)]
    named += [("page." + k, f) for k, f in (("along", page.along), ("panels", page.panels)) if f]
    named += [(f"curves[{n}].panels", curve.panels) for n, curve in enumerate(experiment.curves) if curve.panels]
    labelled = [(f"without[{n}]", labels) for n, labels in enumerate(experiment.without)]
    labelled += [(f"curves[{n}].only", curve.only) for n, curve in enumerate(experiment.curves)]
    measured = [(f"page.drawn[{n}]", name) for n, name in enumerate(page.drawn)]
    measured += [(f"best[{n}]", name) for n, name in enumerate(experiment.best)]
    for key, claim in experiment.claims.items():
        where = f"claims.{key}"
        if claim.where and not (experiment.source and claim.paper):
            what = "a place in a paper, expected `paper` beside it, and `source` of the experiment"
            problems.append(
                Problem(f"experiment.{where}.where", what, "paper: what it states; source: Porta & Kröse 2004")
            )
        measured.append((f"{where}.measure", claim.measure))
        problems += [Problem(f"experiment.{where}", fault) for fault in _faults(experiment, claim)]
        sides = [getattr(claim, side) for side in SIDES]
        labelled += [(where, side) for side in (claim.of, claim.ratio_to, *sides) if isinstance(side, Mapping)]
    for where, labels in labelled:
        named += [(where, factor) for factor in labels]
        for factor, label in labels.items():
            if factor in factors and str(label) not in experiment.labels(factor):
                problems.append(_unknown(f"{where}.{factor}", str(label), experiment.labels(factor), "labels"))
    problems += [
        _unknown(where, name, experiment.measures, "measures")
        for where, name in measured
        if name not in experiment.measures
    ]
    problems += [_unknown(where, factor, factors, "factors") for where, factor in named if factor not in factors]
    left = [f for f in factors if f not in (*page.rows, page.columns)]
    if left:
        fault = f"{', '.join(left)}: each factor of the sweep is a row or the column of the table"
        problems.append(Problem("experiment.page", fault))
    return list(dict.fromkeys(problems))


def _faults(experiment: Experiment, claim: Claim) -> "list[str]":
    """Lists the faults of a claim as it is written."""
    sides = [side for side in SIDES if getattr(claim, side) is not None]
    faults = []
    if len(sides) + claim.lowest != 1:
        faults.append(f"a claim makes one comparison: {', '.join(SIDES)} or lowest")
    for side in sides:
        other = getattr(claim, side)
        if isinstance(other, str) and other != "published":
            faults.append(f"{side}: {other!r}, expected a number, `published`, or labels of another condition")
        if claim.ratio_to is not None and not isinstance(other, float):
            faults.append(f"{side}: a ratio is compared with a number")
    if claim.ratio_to is not None and claim.lowest:
        faults.append("lowest: a ratio is compared with a number")
    measure = experiment.measures.get(claim.measure)
    with_conditions = claim.lowest or any(isinstance(getattr(claim, side), Mapping) for side in sides)
    if measure is not None and measure.over_runs != "mean" and (with_conditions or claim.ratio_to is not None):
        faults.append(f"{claim.measure} is the {measure.over_runs} of the repetitions, which is compared with a number")
    return faults


def _unknown(where: str, name: str, options: Any, kind: str) -> Problem:
    return Problem(f"experiment.{where}", f"there is no '{name}'", suggest(name, [str(o) for o in options], kind))


def _entry(mapping: Mapping[Any, Any], label: str) -> Any:
    return next((value for key, value in mapping.items() if str(key) == label), None)


def value_of(measure: Measure, result: Mapping[str, Any]) -> float | None:
    """A measure's value in a repetition's result, in the measure's unit; None where it holds none."""
    space = space_of(result)
    if measure.stages:
        space = result["timing"].get("together", {}).get("+".join(measure.stages), {})
    for path in measure.path:
        value = value_at(space, path, measure.aggregate, measure.window)
        if value is not None:
            return value * measure.scale
    return None


def space_of(result: Mapping[str, Any]) -> dict[str, Any]:
    """Results of a repetition that paths lead through: its metrics, `timing` and `facts`."""
    return {**result["metrics"], "timing": result["timing"], "facts": result["facts"]}


Side = Literal["at_most", "at_least", "below", "above", "not_above"]
SIDES: tuple[Side, ...] = ("at_most", "at_least", "below", "above", "not_above")


def comparison_of(claim: Claim) -> Side | Literal["lowest"]:
    """Which comparison a claim makes."""
    return next((side for side in SIDES if getattr(claim, side) is not None), "lowest")
