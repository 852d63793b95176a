"""An experiment as a file: what is varied, what is measured, what the paper says of it; read and checked.

`conf/experiment/<variant>/<name>.yaml` is written for people: words are what one would type on the command line. Every
combination of the sweep's labels is a condition, and each condition is run once for every seed.
"""

import itertools
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from omninav.pipeline.graph.ports import convert_fields
from omninav.pipeline.graph.problems import Problem, ProblemsFound, suggest

from .series import Take, figure_at

Labels = dict[str, str]
"""A condition's label in each factor, or in some of them: `{features: histogram, tour: TT1}`."""


@dataclass(frozen=True)
class Measure:
    """A figure of each run: what it is called and where it stands in metrics.json (or `timing.`, or `facts.`).

    `of`: the paths to look at, the first that is there counts; several joined by + are added. `times` changes the unit.
    Where a path leads to a series (`laps.*.position_error_m.mean`, `over_steps.position_error_m`), `take` says what is
    taken of it, and `part` of which share of it. `stages`: the time (ms) that these took together, step by step; `of`
    is `p50_ms`, `p95_ms` or `max_ms` then. `pooled`: the standard deviation over all frames of all repetitions; `of`
    names the errors (`after_settling.position_error_m`).
    """

    title: str
    of: tuple[str, ...]
    times: float = 1.0
    digits: int = 1
    take: Take = "mean"
    part: tuple[float, float] = (0.0, 1.0)
    stages: tuple[str, ...] = ()
    pooled: bool = False


Other = float | str | Mapping[str, Any]
"""What a claim's figure is compared with: a number, `published`, or the labels of another condition."""


@dataclass(frozen=True)
class Claim:
    """Something the paper says (or that we expect), as a comparison that comes out true or false.

    One case for each condition that has the labels of `of`. Its figure is compared with a number, with `published`, or
    with the labels of another condition. By the mean alone: `at_most`, `at_least`. By the whole 95 % interval: `below`,
    `above`, `not_above` (better, or worse by less than `MARGIN` of the other side), `no_worse` (the interval includes 0
    or lies below it: weaker). Or with all others: `lowest` (`not_above` each of them, those that differ in the factors
    of `among`, by default of `of`). `times` multiplies the other side. With `ratio_to` (the labels of another
    condition) the figure is the ratio of the two means, and is compared with a number.
    """

    says: str
    measure: str
    of: Mapping[str, Any] = field(default_factory=dict)
    at_most: Other | None = None
    at_least: Other | None = None
    below: Other | None = None
    above: Other | None = None
    not_above: Other | None = None
    no_worse: Other | None = None
    lowest: bool = False
    among: tuple[str, ...] = ()
    times: float = 1.0
    ratio_to: Mapping[str, Any] | None = None
    paper: str = ""


@dataclass(frozen=True)
class PageLayout:
    """How results stand on the page: a table by `rows` and `columns`, and a figure along `along` where it is named.

    `drawn`: the measures that have a figure, by default the first.
    """

    rows: tuple[str, ...]
    columns: str
    along: str | None = None
    panels: str | None = None
    drawn: tuple[str, ...] = ()


@dataclass(frozen=True)
class Curve:
    """A figure of how something goes on within the runs: over laps, logs, steps or a distance, a line per condition.

    `of`: the path of a series (`laps.*.position_error_m.mean`); `at`: the path of where its entries lie, by default 1,
    2, 3 …; `along`: what that is. `only`: labels that a condition must have to be drawn. `beside`: label -> path of a
    series that is alike in all conditions of a panel and drawn once, dashed (odometry alone).
    """

    title: str
    along: str
    of: str
    at: str = ""
    times: float = 1.0
    panels: str | None = None
    only: Mapping[str, Any] = field(default_factory=dict)
    beside: Mapping[str, str] = field(default_factory=dict)


@dataclass(frozen=True)
class Note:
    """Something said on the page from runs of another variant beside the experiment: one for each label of `over`."""

    says: str
    variant: str
    measure: str
    over: str
    set: str = ""
    times: float = 1.0


@dataclass(frozen=True)
class Experiment:
    """What an experiment's file holds.

    `common` (for all runs), `set` (for all conditions) and the words of `sweep` (factor -> label -> words) are what one
    would type. `shared`: whether the repetitions of a condition share what does not depend on the seed (not where time
    is measured). `published`: measure -> labels in the order of the page's rows and column -> the paper's figure.

    `drives`: label -> words. Each condition is run over each of them with every seed, and all count as its repetitions:
    other days, routes or odometry, so that intervals speak of these too. `without`: labels of conditions to leave out.
    """

    name: str
    title: str
    about: str
    variant: str
    sweep: Mapping[str, Mapping[Any, str]]
    measures: Mapping[str, Measure]
    page: PageLayout
    common: str = ""
    set: str = ""
    repetitions: int = 50
    drives: Mapping[str, str] = field(default_factory=dict)
    without: tuple[Mapping[str, Any], ...] = ()
    published: Mapping[str, Any] = field(default_factory=dict)
    claims: tuple[Claim, ...] = ()
    curves: tuple[Curve, ...] = ()
    remarks: tuple[Note, ...] = ()
    notes: tuple[str, ...] = ()
    shared: bool = True
    cores: int | None = None
    profiles: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def conditions(self) -> list["Condition"]:
        """Every combination of the sweep's labels but those of `without`, the last factor changing fastest."""
        factors = [
            [(factor, str(label), words) for label, words in self.sweep[factor].items()] for factor in self.sweep
        ]
        found = [
            Condition({factor: label for factor, label, _ in chosen}, " ".join(words for _, _, words in chosen))
            for chosen in itertools.product(*factors)
        ]
        return [condition for condition in found if not any(condition.fits(labels) for labels in self.without)]

    @property
    def runs_of_a_condition(self) -> int:
        """How often each condition is run: every seed over every drive."""
        return self.repetitions * max(1, len(self.drives))

    def labels(self, factor: str) -> list[str]:
        """The labels of a factor, in the file's order."""
        return [str(label) for label in self.sweep[factor]]

    def published_figure(self, measure: str, labels: Labels) -> float | None:
        """The paper's figure of a condition, None where it prints none."""
        found: Any = self.published.get(measure)
        for factor in (*self.page.rows, self.page.columns):
            found = _entry(found, labels[factor]) if isinstance(found, Mapping) else None
        return float(found) if isinstance(found, int | float) else None


@dataclass(frozen=True)
class Condition:
    """One combination of the sweep's labels, with the words that make it."""

    labels: Labels
    words: str

    @property
    def name(self) -> str:
        """Its labels in one line."""
        return ", ".join(f"{factor} {label}" for factor, label in self.labels.items())

    def fits(self, labels: Mapping[str, Any]) -> bool:
        """Whether it has all of these labels."""
        return all(self.labels.get(factor) == str(label) for factor, label in labels.items())


def read_experiment(plain: Mapping[str, Any], profile: str) -> Experiment:
    """The experiment that a file describes, at the scale of a profile. Raises `ProblemsFound` with all problems.

    A profile changes entries of the file: mappings key by key, the labels of a factor and everything else as a whole.
    A file that stands on another (its `defaults`) takes a label or a measure of that one out by setting it to null.
    """
    profiles = plain.get("profiles") or {}
    if profile not in {"paper", *profiles}:
        hint = suggest(profile, {"paper", *map(str, profiles)}, "profiles", prefix="profile=")
        raise ProblemsFound([Problem("profile", f"this experiment has no profile '{profile}'", hint)])
    scaled = dict(plain)
    for key, value in (profiles.get(profile) or {}).items():
        both = isinstance(value, Mapping) and isinstance(scaled.get(key), Mapping)
        scaled[key] = {**scaled[key], **value} if both else value
    scaled["sweep"] = {factor: _kept(labels) for factor, labels in (scaled.get("sweep") or {}).items()}
    for key in ("measures", "drives"):
        scaled[key] = _kept(scaled.get(key) or {})
    arguments, problems = convert_fields(scaled, Experiment, "experiment")
    if problems:
        raise ProblemsFound(problems)
    experiment = Experiment(**arguments)
    problems = list(_contradictions(experiment))
    if problems:
        raise ProblemsFound(problems)
    return experiment


def _kept(entries: Any) -> Any:
    """A mapping without what is null in it; anything else as it is, for whoever checks its type."""
    if not isinstance(entries, Mapping):
        return entries
    return {key: value for key, value in entries.items() if value is not None}


def words_of(text: str) -> list[str]:
    """Words as a shell would split them: quotes keep a list or a mapping together."""
    return shlex.split(text)


def _contradictions(experiment: Experiment) -> "list[Problem]":
    problems = []
    factors = list(experiment.sweep)
    if experiment.repetitions < 1:
        problems.append(Problem("experiment.repetitions", "expected at least 1"))
    page = experiment.page
    shown = [("page.rows", f) for f in page.rows] + [("page.columns", page.columns)]
    shown += [("page." + k, f) for k, f in (("along", page.along), ("panels", page.panels)) if f]
    shown += [(f"curves[{n}].panels", curve.panels) for n, curve in enumerate(experiment.curves) if curve.panels]
    shown += [(f"remarks[{n}].over", remark.over) for n, remark in enumerate(experiment.remarks)]
    labelled = [(f"without[{n}]", labels) for n, labels in enumerate(experiment.without)]
    labelled += [(f"curves[{n}].only", curve.only) for n, curve in enumerate(experiment.curves)]
    measured = [(f"page.drawn[{n}]", name) for n, name in enumerate(page.drawn)]
    for number, claim in enumerate(experiment.claims):
        where = f"claims[{number}]"
        measured.append((f"{where}.measure", claim.measure))
        problems += [Problem(f"experiment.{where}", said) for said in _unclear(experiment, claim)]
        sides = [getattr(claim, side) for side in SIDES]
        labelled += [(where, side) for side in (claim.of, claim.ratio_to, *sides) if isinstance(side, Mapping)]
    for where, labels in labelled:
        shown += [(where, factor) for factor in labels]
        for factor, label in labels.items():
            if factor in factors and str(label) not in experiment.labels(factor):
                problems.append(_unknown(f"{where}.{factor}", str(label), experiment.labels(factor), "labels"))
    problems += [
        _unknown(where, name, experiment.measures, "measures")
        for where, name in measured
        if name not in experiment.measures
    ]
    problems += [_unknown(where, factor, factors, "factors") for where, factor in shown if factor not in factors]
    left = [f for f in factors if f not in (*page.rows, page.columns)]
    if left:
        said = f"{', '.join(left)}: each factor of the sweep is a row or the column of the table"
        problems.append(Problem("experiment.page", said))
    return list(dict.fromkeys(problems))


def _unclear(experiment: Experiment, claim: Claim) -> "list[str]":
    """What stands against a claim as it is written."""
    sides = [side for side in SIDES if getattr(claim, side) is not None]
    said = []
    if len(sides) + claim.lowest != 1:
        said.append(f"a claim makes one comparison: {', '.join(SIDES)} or lowest")
    for side in sides:
        other = getattr(claim, side)
        if isinstance(other, str) and other != "published":
            said.append(f"{side}: {other!r}, expected a number, `published`, or labels of another condition")
        if claim.ratio_to is not None and not isinstance(other, float):
            said.append(f"{side}: a ratio is compared with a number")
    if claim.ratio_to is not None and claim.lowest:
        said.append("lowest: a ratio is compared with a number")
    if claim.measure in experiment.measures and experiment.measures[claim.measure].pooled:
        said.append(f"{claim.measure} is pooled over the repetitions, which leaves nothing to judge it by")
    return said


def _unknown(where: str, name: str, options: Any, kind: str) -> Problem:
    return Problem(f"experiment.{where}", f"there is no '{name}'", suggest(name, [str(o) for o in options], kind))


def _entry(mapping: Mapping[Any, Any], label: str) -> Any:
    return next((value for key, value in mapping.items() if str(key) == label), None)


def figure_of(measure: Measure, result: Mapping[str, Any]) -> float | None:
    """A measure's figure in a repetition's result, in the measure's unit; None where it holds none."""
    space = space_of(result)
    if measure.stages:
        space = result["timing"].get("together", {}).get("+".join(measure.stages), {})
    for path in measure.of:
        figure = figure_at(space, f"{path}.std" if measure.pooled else path, measure.take, measure.part)
        if figure is not None:
            return figure * measure.times
    return None


def space_of(result: Mapping[str, Any]) -> dict[str, Any]:
    """Where paths lead through a repetition's result: its metrics, and `timing` and `facts` beside them."""
    return {**result["metrics"], "timing": result["timing"], "facts": result["facts"]}


Side = Literal["at_most", "at_least", "below", "above", "not_above", "no_worse"]
SIDES: tuple[Side, ...] = ("at_most", "at_least", "below", "above", "not_above", "no_worse")


def comparison_of(claim: Claim) -> Side | Literal["lowest"]:
    """Which comparison a claim makes."""
    return next((side for side in SIDES if getattr(claim, side) is not None), "lowest")
