"""Claims against results: means, intervals of paired differences, shares of runs, and whether each claim holds."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from omninav.pipeline.graph.problems import Problem, suggest
from omninav.pipeline.graph.results import Metrics
from omninav.pipeline.report.metrics import metric_values

from .intervals import MIN_GROUPS, Array, bootstrap_interval, share_interval
from .specification import MARGIN_SHARE, Claim, Experiment, Labels, Measure, Side, comparison_of, value_of

Repetition = tuple[str, int]
"""Scenario ('' where there is none) and seed."""
Results = Mapping[tuple[tuple[str, str], ...], Mapping[Repetition, Mapping[str, Any]]]
"""Labels of a condition (as `key_of` gives them) -> repetition -> result."""
Samples = Mapping[Repetition, float]
"""A measure's value in each repetition."""

ROUNDING = 1e-9
RUNS_SHARE = 0.75
"""Share of the runs that must keep to the limit of a claim about the worst of them: the largest (in quarters) that
twelve runs can show, when all do."""


@dataclass(frozen=True)
class Case:
    """A claim for one condition: our value, what it is compared with, the difference's interval, whether it holds.

    `difference` is ours less the other side; `interval` its 95 % interval over `scenarios` and the seeds in each. Of a
    largest value there is none: `kept` of the `repetitions` keep to the limit, and the interval of that share decides.
    `holds` is None where a condition has no results, and where the repetitions cannot decide. `judged` of `repetitions`
    have a value: steps until converged are those of the ones that converged. `ratio`: the values are ratios of means.
    """

    where: str
    ours: float | None
    other: float | None
    against: str
    difference: float | None
    interval: tuple[float, float] | None
    holds: bool | None
    judged: int = 0
    repetitions: int = 0
    ratio: bool = False
    scenarios: int = 0
    """Independent ones among the judged; 0 in files written before there were six."""
    kept: int | None = None
    """Repetitions that keep to the limit, of a claim about the worst of them; None of other claims."""


@dataclass(frozen=True)
class Verdict:
    """The cases of a claim; it holds where all of them do."""

    cases: tuple[Case, ...]

    @property
    def holds(self) -> bool | None:
        """Tells whether every case holds; None where one could not be judged and none fails."""
        found = [case.holds for case in self.cases]
        if any(held is False for held in found):
            return False
        return None if None in found or not found else True

    @property
    def words(self) -> str:
        """The verdict, with how many runs keep to the limit where it holds without all of them."""
        counted = [case for case in self.cases if case.kept is not None]
        kept, ran = sum(case.kept or 0 for case in counted), sum(case.repetitions for case in counted)
        return in_words(self.holds) + (f" in {kept} of {ran} runs" if self.holds and kept < ran else "")


def in_words(holds: bool | None) -> str:
    """Verdict on a claim or a case in words."""
    return {True: "holds", False: "does not hold", None: "undecided"}[holds]


def headline(verdicts: Iterable[Verdict]) -> str:
    """Verdict on the claims of a page together: it holds where every claim does."""
    found = [verdict.holds for verdict in verdicts]
    if len(set(found)) == 1 and (found[0] is not False or len(found) == 1):
        return in_words(found[0])
    undecided = found.count(None)
    return f"{found.count(True)} of {len(found)} hold" + (f", {undecided} undecided" if undecided else "")


def key_of(labels: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Labels in a form that can be looked up."""
    return tuple(sorted((factor, str(label)) for factor, label in labels.items()))


def samples(experiment: Experiment, results: Results, measure: str, labels: Labels) -> dict[Repetition, float]:
    """A measure's value in each repetition of a condition; those without one are left out."""
    found = {}
    for repetition, result in sorted(results.get(key_of(labels), {}).items()):
        value = value_of(experiment.measures[measure], result)
        if value is not None:
            found[repetition] = value
    return found


def unmeasured(experiment: Experiment, results: Results) -> Iterator[Problem]:
    """A problem for each measure of which no run has a value."""
    runs = [result for of_condition in results.values() for result in of_condition.values() if result["metrics"]]
    known = metric_values(Metrics(runs[0]["metrics"])) if runs else {}
    for name, measure in experiment.measures.items():
        if runs and all(value_of(measure, result) is None for result in runs):
            path = " or ".join(measure.path)
            yield Problem(f"experiment.measures.{name}.path", f"no run has {path}", suggest(path, known, "metrics"))


def over_runs(measure: Measure, values: Iterable[float]) -> float:
    """One value of those of the repetitions: their mean, or the largest or smallest where the measure asks for it."""
    name = {"mean": "mean", "largest": "max", "smallest": "min"}[measure.over_runs]
    return float(getattr(np, name)(np.fromiter(values, dtype=np.float64)))


def judge(experiment: Experiment, results: Results) -> dict[str, Verdict]:
    """A verdict for each claim of the file, by its key."""
    return {key: Verdict(tuple(_cases(experiment, claim, results))) for key, claim in experiment.claims.items()}


def _cases(experiment: Experiment, claim: Claim, results: Results) -> list[Case]:
    """One case for each combination of the labels that the claim leaves open."""
    side = comparison_of(claim)
    conditions = [condition.labels for condition in experiment.conditions() if condition.fits(claim.of)]
    if side == "lowest":
        return [_lowest(experiment, claim, labels, results) for labels in conditions]
    others = [other for other in (getattr(claim, side), claim.ratio_to) if isinstance(other, Mapping)]
    with_itself = [labels for labels in conditions if any(_facing(labels, other) == labels for other in others)]
    return [_case(experiment, claim, side, labels, results) for labels in conditions if labels not in with_itself]


def _case(experiment: Experiment, claim: Claim, side: Side, labels: Labels, results: Results) -> Case:
    other, where, measure = getattr(claim, side), _where(experiment, labels), experiment.measures[claim.measure]
    ours, theirs = samples(experiment, results, claim.measure, labels), None
    if isinstance(other, Mapping):
        facing = _facing(labels, other)
        against = (f"{claim.scale:g} x " if claim.scale != 1.0 else "") + _changed(labels, facing)
        beside = {s: claim.scale * v for s, v in samples(experiment, results, claim.measure, facing).items()}
        return _against_samples(measure, side, where, ours, beside, against, _ran(results, labels, facing))
    against = "the paper's figure" if other == "published" else "the limit"
    limit = experiment.published_value(claim.measure, labels) if other == "published" else float(other)
    limit = None if limit is None else claim.scale * limit
    ran = _ran(results, labels, labels)
    if claim.ratio_to is not None:
        facing = _facing(labels, claim.ratio_to)
        theirs = samples(experiment, results, claim.measure, facing)
        ran = _ran(results, labels, facing)
        where = f"{where} / {_changed(labels, facing)}"
        both = sorted(set(ours) & set(theirs))
        ours, theirs = {each: ours[each] for each in both}, {each: theirs[each] for each in both}
    ratio = theirs is not None
    if not ours or limit is None or (theirs is not None and sum(theirs.values()) == 0.0):
        return Case(where, None if ratio else _mean(measure, ours), limit, against, None, None, None)
    found = over_runs(measure, ours.values()) / (over_runs(measure, theirs.values()) if theirs is not None else 1.0)
    # A ratio has no unit, so the margin of its measure's says nothing of it.
    margin = MARGIN_SHARE * abs(limit) if ratio else measure.margin_beside(limit)
    scenarios = _scenarios(ours)
    interval = kept = None
    if measure.over_runs != "mean":
        kept = sum(_keeps(side, value - limit, margin) for value in ours.values())
        holds = decided_by_share(kept, ran) if scenarios >= MIN_GROUPS else None  # a scenario's runs are alike
    else:
        low, high = bootstrap_interval(_by_scenario(ours), _by_scenario(theirs) if theirs is not None else None)
        interval = low - limit, high - limit
        holds = None if ratio and scenarios < MIN_GROUPS else decided(side, interval, margin, scenarios)
    return Case(where, found, limit, against, found - limit, interval, holds, len(ours), ran, ratio, scenarios, kept)


def _against_samples(
    measure: Measure, side: Side, where: str, ours: Samples, theirs: Samples, against: str, ran: int
) -> Case:
    both = sorted(set(ours) & set(theirs))
    if not both:
        alone, beside = (float(np.mean(list(each.values()))) if each else None for each in (ours, theirs))
        return Case(where, alone, beside, against, None, None, None)
    differences = {each: ours[each] - theirs[each] for each in both}
    interval = bootstrap_interval(_by_scenario(differences))
    mean = float(np.mean(list(differences.values())))
    ours_mean = float(np.mean([ours[each] for each in both]))
    judged, scenarios = len(both), _scenarios(differences)
    holds = decided(side, interval, measure.margin_beside(ours_mean - mean), scenarios)
    return Case(where, ours_mean, ours_mean - mean, against, mean, interval, holds, judged, ran, scenarios=scenarios)


def decided(side: Side, interval: tuple[float, float], margin: float, scenarios: int) -> bool | None:
    """Judges a comparison by the whole interval of the difference: true, false, or None where that leaves it open.

    One scenario says nothing about the next one, nor do equal values of fewer than six.
    """
    low, high = interval
    if scenarios < 2 or (scenarios < MIN_GROUPS and low == high):
        return None
    if _keeps(side, low, margin) and _keeps(side, high, margin):
        return True
    return None if _keeps(side, low, margin) or _keeps(side, high, margin) else False


def decided_by_share(kept: int, ran: int) -> bool | None:
    """Judges by the interval of their share whether enough of the runs keep to a limit."""
    low, high = share_interval(kept, ran)
    return True if low >= RUNS_SHARE else False if high < RUNS_SHARE else None


def _keeps(side: Side, difference: float, margin: float) -> bool:
    """Tells whether a difference is on the side that is claimed; equal is not better."""
    match side:
        case "below":
            return difference < 0.0
        case "above":
            return difference > 0.0
        case "at_least":
            return difference >= -ROUNDING
        case _:
            return difference <= (margin if side == "not_above" else 0.0) + ROUNDING


def _by_scenario(values: Samples) -> list[Array]:
    """The values of each scenario, both in order."""
    names = sorted({scenario for scenario, _ in values})
    return [np.array([values[each] for each in sorted(values) if each[0] == name]) for name in names]


def _scenarios(values: Samples) -> int:
    return len({scenario for scenario, _ in values})


def _lowest(experiment: Experiment, claim: Claim, labels: Labels, results: Results) -> Case:
    """Not above any condition that differs from this one only in the claim's factors; the closest call is shown."""
    varied = claim.among or tuple(factor for factor in experiment.sweep if factor in claim.of)
    where, ours = _where(experiment, labels), samples(experiment, results, claim.measure, labels)
    same = {factor: label for factor, label in labels.items() if factor not in varied}
    cases = []
    for facing in (condition.labels for condition in experiment.conditions() if condition.fits(same)):
        if facing != labels:
            against = ", ".join(facing[factor] for factor in varied)
            theirs = samples(experiment, results, claim.measure, facing)
            ran, measure = _ran(results, labels, facing), experiment.measures[claim.measure]
            cases.append(_against_samples(measure, "not_above", where, ours, theirs, against, ran))
    if not cases:
        return Case(where, _mean(experiment.measures[claim.measure], ours), None, "no other", None, None, None)
    worst = {False: 0, None: 1, True: 2}
    return min(cases, key=lambda case: (worst[case.holds], -(case.difference or 0.0)))


def _facing(labels: Labels, other: Mapping[str, Any]) -> Labels:
    """The condition that has these labels instead."""
    return labels | {factor: str(label) for factor, label in other.items()}


def _changed(labels: Labels, facing: Labels) -> str:
    return ", ".join(f"{factor} {label}" for factor, label in facing.items() if labels[factor] != label)


def _ran(results: Results, labels: Labels, facing: Labels) -> int:
    """Number of repetitions of both conditions that have run."""
    return len(set(results.get(key_of(labels), {})) & set(results.get(key_of(facing), {})))


def _where(experiment: Experiment, labels: Labels) -> str:
    return ", ".join(labels[factor] for factor in experiment.sweep if factor in labels)


def _mean(measure: Measure, values: Samples) -> float | None:
    return over_runs(measure, values.values()) if values else None
