"""Claims against results: means, bootstrap intervals of paired differences, and whether each claim holds."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from .series import figure_at, pooled_deviation
from .specification import Claim, Experiment, Labels, Side, comparison_of, figure_of, space_of

Array = npt.NDArray[np.float64]
Results = Mapping[tuple[tuple[str, str], ...], Mapping[int, Mapping[str, Any]]]
"""Labels of a condition (as `key_of` gives them) -> seed -> result."""

RESAMPLES = 4999
CONFIDENCE = 0.95
MIN_REPETITIONS = 6
"""With fewer neither an interval nor a mean says what the next repetition would do: no verdict is made from them."""
MARGIN = 0.05
"""Share of the other side by which `not_above` may be above it: no amount of data shows that two figures are equal."""


@dataclass(frozen=True)
class Case:
    """A claim for one condition: our mean, what it is compared with, the difference's interval, whether it holds.

    `difference` is ours less the other side; `interval` its 95 % bootstrap interval over the repetitions. `holds` is
    None where a condition has no results, and where the repetitions cannot decide. `judged` of `repetitions` have a
    figure (steps until converged are those of the ones that converged): with fewer than all a claim may fail and does
    not hold. `ratio`: the figures are ratios of means.
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


def verdict_of(plain: Mapping[str, Any]) -> Verdict:
    """A verdict as verdicts.json holds it (`Verdict.plain`)."""
    cases = [Case(**case | {"interval": case["interval"] and tuple(case["interval"])}) for case in plain["cases"]]
    return Verdict(plain["claim"], plain["measure"], plain["paper"], tuple(cases))


def judged_again(verdict: Verdict) -> Verdict:
    """A verdict of an earlier day by today's rule, as far as its figures tell: few repetitions decide nothing."""
    few = [replace(case, holds=None) if case.judged < MIN_REPETITIONS else case for case in verdict.cases]
    return replace(verdict, cases=tuple(few))


def in_words(holds: bool | None) -> str:
    """What a claim or a case comes to."""
    return {True: "holds", False: "does not hold", None: "undecided"}[holds]


def headline(verdicts: Sequence[Verdict]) -> str:
    """What the claims of a page come to together: it holds where every claim does."""
    found = [verdict.holds for verdict in verdicts]
    if len(set(found)) == 1 and (found[0] is not False or len(found) == 1):
        return in_words(found[0])
    undecided = found.count(None)
    return f"{found.count(True)} of {len(found)} hold" + (f", {undecided} undecided" if undecided else "")


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


def pooled(experiment: Experiment, results: Results, measure: str, labels: Labels) -> float | None:
    """The standard deviation over all frames of all repetitions of a condition, of a measure that is `pooled`."""
    described = experiment.measures[measure]
    for path in described.path:
        place = path.rpartition(".")[0]
        frames = f"{place}.frames" if place else "frames"
        groups = [
            [figure_at(space_of(result), each) for each in (f"{path}.mean", f"{path}.std", frames)]
            for _, result in sorted(results.get(key_of(labels), {}).items())
        ]
        known = [[figure for figure in group if figure is not None] for group in groups]
        whole = [group for group in known if len(group) == 3]
        if whole:
            means, deviations, counts = zip(*whole, strict=True)
            return described.scale * pooled_deviation(means, deviations, counts)
    return None


def bootstrap_interval(values: Array, over: Array | None = None) -> tuple[float, float]:
    """95 % interval of the mean by resampling (percentile bootstrap, 4999 resamples, always the same ones).

    With `over` (N,) that of the ratio of the two means, resampled in pairs. Equal values, or a single one, give an
    interval of no width.
    """
    columns = (values,) if over is None else (values, over)
    if len(values) < 2 or all(np.ptp(column) == 0.0 for column in columns):
        mean = float(values.mean()) if over is None else float(values.mean() / over.mean())
        return mean, mean
    from scipy.stats import bootstrap  # type: ignore[attr-defined]

    def statistic(*drawn: Array, axis: int) -> Array:
        means = [column.mean(axis=axis) for column in drawn]
        return np.asarray(means[0] if over is None else means[0] / means[1])

    found = bootstrap(
        columns,
        statistic,
        n_resamples=RESAMPLES,
        confidence_level=CONFIDENCE,
        method="percentile",
        paired=over is not None,
        vectorized=True,
        rng=np.random.default_rng(0),
    ).confidence_interval
    return float(found.low), float(found.high)


def judge(experiment: Experiment, results: Results) -> list[Verdict]:
    """A verdict for each claim of the file, in its order."""
    return [
        Verdict(
            claim.statement,
            experiment.measures[claim.measure].title,
            claim.paper,
            tuple(_cases(experiment, claim, results)),
        )
        for claim in experiment.claims
    ]


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
    other = getattr(claim, side)
    if isinstance(other, Mapping):
        return _against_condition(experiment, claim, side, labels, other, results)
    where, against = _where(experiment, labels), "the paper's figure" if other == "published" else "the limit"
    limit = experiment.published_figure(claim.measure, labels) if other == "published" else float(other)
    limit = None if limit is None else claim.scale * limit
    ours, over = samples(experiment, results, claim.measure, labels), None
    seeds, ran = sorted(ours), len(results.get(key_of(labels), {}))
    if claim.ratio_to is not None:
        facing = _facing(labels, claim.ratio_to)
        theirs = samples(experiment, results, claim.measure, facing)
        seeds, ran = sorted(set(ours) & set(theirs)), _ran(results, labels, facing)
        over = np.array([theirs[seed] for seed in seeds])
        where = f"{where} / {_changed(labels, facing)}"
    if not seeds or limit is None or (over is not None and over.mean() == 0.0):
        return Case(where, None if over is not None else _mean(ours), limit, against, None, None, None)
    values = np.array([ours[seed] for seed in seeds])
    ours_mean = float(values.mean() if over is None else values.mean() / over.mean())
    low, high = (end - limit for end in bootstrap_interval(values, over))
    holds = _holds(side, ours_mean - limit, (low, high), abs(limit), len(seeds), ran)
    return Case(
        where, ours_mean, limit, against, ours_mean - limit, (low, high), holds, len(seeds), ran, over is not None
    )


def _against_condition(
    experiment: Experiment, claim: Claim, side: Side, labels: Labels, other: Mapping[str, Any], results: Results
) -> Case:
    facing = _facing(labels, other)
    against = _changed(labels, facing)
    against = f"{claim.scale:g} x {against}" if claim.scale != 1.0 else against
    ours = samples(experiment, results, claim.measure, labels)
    theirs = {s: claim.scale * v for s, v in samples(experiment, results, claim.measure, facing).items()}
    return _against_samples(side, _where(experiment, labels), ours, theirs, against, ran=_ran(results, labels, facing))


def _against_samples(
    side: Side, where: str, ours: Mapping[int, float], theirs: Mapping[int, float], against: str, ran: int
) -> Case:
    both = sorted(set(ours) & set(theirs))
    if not both:
        return Case(where, _mean(ours), _mean(theirs), against, None, None, None)
    differences = np.array([ours[seed] - theirs[seed] for seed in both])
    interval = bootstrap_interval(differences)
    mean = float(differences.mean())
    ours_mean = float(np.mean([ours[seed] for seed in both]))
    holds = _holds(side, mean, interval, abs(ours_mean - mean), len(both), ran)
    return Case(where, ours_mean, ours_mean - mean, against, mean, interval, holds, len(both), ran)


def _holds(
    side: Side, difference: float, interval: tuple[float, float], other: float, judged: int, ran: int
) -> bool | None:
    """Whether a comparison comes out true; None where the repetitions do not decide it."""
    low, high = interval
    holds: bool | None
    if judged < MIN_REPETITIONS:
        holds = None
    elif side == "at_most":
        holds = difference <= 1e-9
    elif side == "at_least":
        holds = difference >= -1e-9
    elif side == "not_above":  # better or within the margin; worse; or not decided
        holds = True if high <= MARGIN * other else False if low > 0.0 else None
    elif side == "no_worse":
        holds = low <= 0.0
    else:
        holds = high < 0.0 if side == "below" else low > 0.0
    return None if holds and judged < ran else holds  # a claim about survivors holds for nobody else


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
            cases.append(_against_samples("not_above", where, ours, theirs, against, _ran(results, labels, facing)))
    if not cases:
        return Case(where, _mean(ours), None, "no other", None, None, None)
    worst = {False: 0, None: 1, True: 2}
    return min(cases, key=lambda case: (worst[case.holds], -(case.difference or 0.0)))


def _facing(labels: Labels, other: Mapping[str, Any]) -> Labels:
    """The condition that has these labels instead."""
    return labels | {factor: str(label) for factor, label in other.items()}


def _changed(labels: Labels, facing: Labels) -> str:
    return ", ".join(f"{factor} {label}" for factor, label in facing.items() if labels[factor] != label)


def _ran(results: Results, labels: Labels, facing: Labels) -> int:
    """How many repetitions of both conditions have run."""
    return len(set(results.get(key_of(labels), {})) & set(results.get(key_of(facing), {})))


def _where(experiment: Experiment, labels: Labels) -> str:
    return ", ".join(labels[factor] for factor in experiment.sweep if factor in labels)


def _mean(values: Mapping[int, float]) -> float | None:
    return float(np.mean(list(values.values()))) if values else None
