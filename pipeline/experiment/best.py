"""The best condition of an experiment over the scenarios of development: by a rule that is written before it runs."""

import math

from .page import number
from .specification import Condition, Experiment
from .verdicts import Results, key_of, over_runs, samples


def best_condition(experiment: Experiment, results: Results) -> tuple[Condition, str] | None:
    """The condition with the least value of the first of `best`, among equals of the next, and its values in words.

    None where nothing has run. A condition of which a run has no value is worse than all others.
    """
    ran = [condition for condition in experiment.conditions() if results.get(key_of(condition.labels))]
    if not experiment.best or not ran:
        return None
    ranked = {each.name: [_value(experiment, results, name, each) for name in experiment.best] for each in ran}
    first = min(ran, key=lambda condition: ranked[condition.name])
    values = zip(experiment.best, ranked[first.name], strict=True)
    measures = experiment.measures
    return first, ", ".join(f"{measures[n].title} {number(value, measures[n].digits)}" for n, value in values)


def _value(experiment: Experiment, results: Results, measure: str, condition: Condition) -> float:
    found = samples(experiment, results, measure, condition.labels)
    whole = len(found) == len(results[key_of(condition.labels)])
    return over_runs(experiment.measures[measure], found.values()) if whole and found else math.inf
