"""An experiment as a file: what is varied, what is measured, what the paper says of it; read and checked.

`conf/experiment/<variant>/<name>.yaml` is written for people: words are what one would type on the command line. Every
combination of the sweep's labels is a condition, and each condition is run once for every seed.
"""

import itertools
import shlex
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from .ports import convert_fields
from .problems import Problem, ProblemsFound, suggest

Labels = dict[str, str]
"""A condition's label in each factor, or in some of them: `{features: histogram, tour: TT1}`."""


@dataclass(frozen=True)
class Measure:
    """A figure of each run: what it is called and where it stands in metrics.json (or `timing.`, or `facts.`).

    `of`: the paths to look at, the first that is there counts; several joined by + are added. `times` changes the unit.
    """

    title: str
    of: tuple[str, ...]
    times: float = 1.0
    digits: int = 1


@dataclass(frozen=True)
class Claim:
    """Something the paper says (or that we expect), as a comparison that comes out true or false.

    One case for each condition that has the labels of `of`. Its figure is compared with: `at_most` (a number,
    `published`, or the labels of another condition), `below`, `above` or `not_above` (the labels of another condition),
    or all others (`lowest`: `not_above` each of them, those that differ in the factors of `among`, by default of `of`).
    `not_above` allows `MARGIN` of the other side. `times` multiplies the other side.
    """

    says: str
    measure: str
    of: Mapping[str, Any] = field(default_factory=dict)
    at_most: float | str | Mapping[str, Any] | None = None
    below: Mapping[str, Any] | None = None
    above: Mapping[str, Any] | None = None
    not_above: Mapping[str, Any] | None = None
    lowest: bool = False
    among: tuple[str, ...] = ()
    times: float = 1.0
    paper: str = ""


@dataclass(frozen=True)
class Arrangement:
    """How results stand on the page: a table by `rows` and `columns`, and a figure along `along` where it is named."""

    rows: tuple[str, ...]
    columns: str
    along: str | None = None
    panels: str | None = None


@dataclass(frozen=True)
class Remark:
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
    """

    name: str
    title: str
    about: str
    variant: str
    sweep: Mapping[str, Mapping[Any, str]]
    measures: Mapping[str, Measure]
    page: Arrangement
    common: str = ""
    set: str = ""
    repetitions: int = 50
    published: Mapping[str, Any] = field(default_factory=dict)
    claims: tuple[Claim, ...] = ()
    remarks: tuple[Remark, ...] = ()
    notes: tuple[str, ...] = ()
    shared: bool = True
    cores: int | None = None
    profiles: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)

    def conditions(self) -> list["Condition"]:
        """Every combination of the sweep's labels, the last factor changing fastest."""
        factors = [
            [(factor, str(label), words) for label, words in self.sweep[factor].items()] for factor in self.sweep
        ]
        return [
            Condition({factor: label for factor, label, _ in chosen}, " ".join(words for _, _, words in chosen))
            for chosen in itertools.product(*factors)
        ]

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
    scaled["measures"] = _kept(scaled.get("measures") or {})
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
    shown = [("page.rows", f) for f in experiment.page.rows] + [("page.columns", experiment.page.columns)]
    shown += [("page." + k, f) for k, f in (("along", experiment.page.along), ("panels", experiment.page.panels)) if f]
    for number, claim in enumerate(experiment.claims):
        where = f"claims[{number}]"
        if claim.measure not in experiment.measures:
            problems.append(_unknown(f"{where}.measure", claim.measure, experiment.measures, "measures"))
        if _comparisons(claim) != 1:
            said = "a claim makes one comparison: at_most, below, above, not_above or lowest"
            problems.append(Problem(f"experiment.{where}", said))
        for side in (claim.of, claim.at_most, claim.below, claim.above, claim.not_above):
            for factor, label in side.items() if isinstance(side, Mapping) else ():
                if factor in experiment.sweep and str(label) not in experiment.labels(factor):
                    problems.append(_unknown(f"{where}.{factor}", str(label), experiment.labels(factor), "labels"))
                shown.append((where, factor))
    shown += [(f"remarks[{n}].over", remark.over) for n, remark in enumerate(experiment.remarks)]
    problems += [_unknown(where, factor, factors, "factors") for where, factor in shown if factor not in factors]
    left = [f for f in factors if f not in (*experiment.page.rows, experiment.page.columns)]
    if left:
        said = f"{', '.join(left)}: each factor of the sweep is a row or the column of the table"
        problems.append(Problem("experiment.page", said))
    return list(dict.fromkeys(problems))


def _unknown(where: str, name: str, options: Any, kind: str) -> Problem:
    return Problem(f"experiment.{where}", f"there is no '{name}'", suggest(name, [str(o) for o in options], kind))


def _comparisons(claim: Claim) -> int:
    return sum(side is not None for side in (claim.at_most, claim.below, claim.above, claim.not_above)) + claim.lowest


def _entry(mapping: Mapping[Any, Any], label: str) -> Any:
    return next((value for key, value in mapping.items() if str(key) == label), None)


def figure_of(measure: Measure, result: Mapping[str, Any]) -> float | None:
    """A measure's figure in a repetition's result, in the measure's unit; None where it holds none."""
    space = {**result["metrics"], "timing": result["timing"], "facts": result["facts"]}
    for path in measure.of:
        parts = [_at(space, part.strip()) for part in path.split("+")]
        numbers = [part for part in parts if isinstance(part, int | float)]
        if len(numbers) == len(parts):
            return float(sum(numbers)) * measure.times
    return None


def _at(result: Any, path: str) -> Any:
    for part in path.split("."):
        result = result.get(part) if isinstance(result, Mapping) else None
    return result


Side = Literal["at_most", "below", "above", "not_above", "lowest"]


def comparison_of(claim: Claim) -> Side:
    """Which comparison a claim makes."""
    for side in ("at_most", "below", "above", "not_above"):
        if getattr(claim, side) is not None:
            return side
    return "lowest"
