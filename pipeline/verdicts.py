"""Claims against results: means, bootstrap intervals of paired differences, and whether each claim holds."""

import itertools
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from .experiment import Claim, Experiment, Labels, Side, comparison_of, figure_of

Array = npt.NDArray[np.float64]
Results = Mapping[tuple[tuple[str, str], ...], Mapping[int, Mapping[str, Any]]]
"""Labels of a condition (as `key_of` gives them) -> seed -> result."""

RESAMPLES = 4999
CONFIDENCE = 0.95
LEAST = 6
"""Repetitions below which an interval says nothing: no verdict is made from it."""
MARGIN = 0.05
"""Share of the other side by which "no worse" may be worse. More data cannot show that two figures are equal."""


@dataclass(frozen=True)
class Case:
    """A claim for one condition: our mean, what it is compared with, the difference's interval, whether it holds.

    `difference` is ours less the other side; `interval` its 95 % bootstrap interval over the repetitions. `holds` is
    None where a condition has no results, and where the repetitions cannot decide.
    """

    where: str
    ours: float | None
    other: float | None
    against: str
    difference: float | None
    interval: tuple[float, float] | None
    holds: bool | None


@dataclass(frozen=True)
class Verdict:
    """A claim with its cases; it holds where all of them do."""

    claim: str
    measure: str
    paper: str
    cases: tuple[Case, ...]

    @property
    def holds(self) -> bool | None:
        """Whether every case holds; None where one could not be judged and none fails."""
        found = [case.holds for case in self.cases]
        if any(held is False for held in found):
            return False
        return None if None in found or not found else True

    def plain(self) -> dict[str, Any]:
        """As verdicts.json holds it: the figures themselves where there is one case, else one entry for each."""
        cases = [asdict(case) for case in self.cases]
        head = {"claim": self.claim, "measure": self.measure, "paper": self.paper, "holds": self.holds}
        if len(cases) == 1:
            return head | {"ours": cases[0]["ours"], "interval": cases[0]["interval"], "cases": cases}
        return head | {
            "ours": {case["where"]: case["ours"] for case in cases},
            "interval": {case["where"]: case["interval"] for case in cases},
            "cases": cases,
        }


def key_of(labels: Mapping[str, Any]) -> tuple[tuple[str, str], ...]:
    """Labels in a form that can be looked up."""
    return tuple(sorted((factor, str(label)) for factor, label in labels.items()))


def samples(experiment: Experiment, results: Results, measure: str, labels: Labels) -> dict[int, float]:
    """A measure's figure in each repetition of a condition, by seed; those without one are left out."""
    found = {}
    for seed, result in sorted(results.get(key_of(labels), {}).items()):
        figure = figure_of(experiment.measures[measure], result)
        if figure is not None:
            found[seed] = figure
    return found


def bootstrap_interval(values: Array) -> tuple[float, float]:
    """95 % interval of the mean by resampling (percentile bootstrap, 4999 resamples, always the same ones).

    Equal values, or a single one, give an interval of no width.
    """
    if len(values) < 2 or np.ptp(values) == 0.0:
        mean = float(values.mean())
        return mean, mean
    from scipy.stats import bootstrap  # type: ignore[attr-defined]

    found = bootstrap(
        (values,),
        np.mean,
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(found.low), float(found.high)


def judge(experiment: Experiment, results: Results) -> list[Verdict]:
    """A verdict for each claim of the file, in its order."""
    return [
        Verdict(
            claim.says,
            experiment.measures[claim.measure].title,
            claim.paper,
            tuple(_cases(experiment, claim, results)),
        )
        for claim in experiment.claims
    ]


def _cases(experiment: Experiment, claim: Claim, results: Results) -> list[Case]:
    """One case for each combination of the labels that the claim leaves open."""
    side = comparison_of(claim)
    fixed = {factor: str(label) for factor, label in claim.of.items()}
    free = [factor for factor in experiment.sweep if factor not in fixed]
    cases = []
    for rest in itertools.product(*(experiment.labels(factor) for factor in free)):
        labels = fixed | dict(zip(free, rest, strict=True))
        if side == "lowest":
            cases.append(_lowest(experiment, claim, labels, results))
        else:
            cases.append(_case(experiment, claim, side, labels, results))
    return cases


def _case(experiment: Experiment, claim: Claim, side: Side, labels: Labels, results: Results) -> Case:
    where = _where(experiment, labels)
    ours = samples(experiment, results, claim.measure, labels)
    other = getattr(claim, side)
    if isinstance(other, Mapping):
        facing = labels | {factor: str(label) for factor, label in other.items()}
        theirs = samples(experiment, results, claim.measure, facing)
        changed = {factor: label for factor, label in facing.items() if labels[factor] != label}
        against = ", ".join(f"{factor} {label}" for factor, label in changed.items())
        against = f"{claim.times:g} x {against}" if claim.times != 1.0 else against
        return _against_samples(side, where, ours, {s: claim.times * v for s, v in theirs.items()}, against)
    limit = experiment.published_figure(claim.measure, labels) if other == "published" else float(other)
    against = "the paper's figure" if other == "published" else "the limit"
    if not ours or limit is None:
        return Case(where, _mean(ours), limit, against, None, None, None)
    limit *= claim.times
    values = np.array(list(ours.values())) - limit
    mean = float(values.mean())
    return Case(where, mean + limit, limit, against, mean, bootstrap_interval(values), mean <= 1e-9)


def _against_samples(
    side: Side, where: str, ours: Mapping[int, float], theirs: Mapping[int, float], against: str
) -> Case:
    both = sorted(set(ours) & set(theirs))
    if not both:
        return Case(where, _mean(ours), _mean(theirs), against, None, None, None)
    differences = np.array([ours[seed] - theirs[seed] for seed in both])
    low, high = bootstrap_interval(differences)
    mean = float(differences.mean())
    ours_mean = float(np.mean([ours[seed] for seed in both]))
    other = ours_mean - mean
    holds: bool | None
    if side == "at_most":
        holds = mean <= 1e-9
    elif len(both) < LEAST:
        holds = None
    elif side == "not_above":  # better or within the margin; worse; or not decided
        holds = True if high <= MARGIN * abs(other) else False if low > 0.0 else None
    else:
        holds = high < 0.0 if side == "below" else low > 0.0
    return Case(where, ours_mean, other, against, mean, (low, high), holds)


def _lowest(experiment: Experiment, claim: Claim, labels: Labels, results: Results) -> Case:
    """Not above any condition that differs from this one only in the claim's factors; the closest call is shown."""
    varied = claim.among or tuple(factor for factor in experiment.sweep if factor in claim.of)
    where, ours = _where(experiment, labels), samples(experiment, results, claim.measure, labels)
    cases = []
    for combination in itertools.product(*(experiment.labels(factor) for factor in varied)):
        facing = labels | dict(zip(varied, combination, strict=True))
        if facing != labels:
            against = ", ".join(facing[factor] for factor in varied)
            theirs = samples(experiment, results, claim.measure, facing)
            cases.append(_against_samples("not_above", where, ours, theirs, against))
    worst = {False: 0, None: 1, True: 2}
    return min(cases, key=lambda case: (worst[case.holds], -(case.difference or 0.0)))


def _where(experiment: Experiment, labels: Labels) -> str:
    return ", ".join(labels[factor] for factor in experiment.sweep if factor in labels)


def _mean(values: Mapping[int, float]) -> float | None:
    return float(np.mean(list(values.values()))) if values else None
