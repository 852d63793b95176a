"""The conditions of an experiment as runs: their configurations, checked, and the results that they have."""

import json
import re
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.graph.problems import BadInput, Problem, ProblemsFound, suggest
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.run.artifact_specification import without_plotted
from omninav.pipeline.run.prepared_run import PreparedRun, prepare_run

from .repetition import artifact_key, condition_key, finished, known_digests
from .specification import Condition, Experiment
from .verdicts import Results, key_of

Compose = Callable[[Sequence[str]], dict[str, Any]]
"""Overrides -> the plain, complete configuration that they describe."""


@dataclass
class ConditionRun:
    """A condition in one scenario: what is run for every seed, and what has been found so far."""

    condition: Condition
    scenario: str
    overrides: tuple[str, ...]
    folder: Path
    seeds: tuple[int, ...]
    config: dict[str, Any] = field(default_factory=dict)
    prepared: PreparedRun = field(init=False, repr=False)
    """The run that `check` has made of the configuration."""
    key: str = ""
    """The hash of everything but the seed that decides the results."""
    results: dict[int, dict[str, Any]] = field(default_factory=dict)
    """Results by seed."""
    development: bool = False
    """Tells whether its scenario is a development one, on which choices were made."""
    error: str = ""

    @property
    def name(self) -> str:
        """The condition's labels, and the scenario where there are several."""
        return ", ".join(part for part in (self.condition.name, self.scenario and f"scenario {self.scenario}") if part)

    @property
    def missing(self) -> list[int]:
        """The seeds that have no result yet."""
        return [seed for seed in self.seeds if seed not in self.results]

    @property
    def unfinished(self) -> bool:
        """Tells whether it can and must still be run."""
        return not self.error and bool(self.missing)


def condition_runs(experiment: Experiment, folder: Path, overrides: Sequence[str]) -> list[ConditionRun]:
    """A run for each condition in each scenario. `overrides`: what was typed after the experiment's name."""
    number = experiment.repetitions
    # Each scenario has seeds of its own, so that draws of stages differ, too.
    seeds = [tuple(range(begin, begin + number)) for begin in range(0, experiment.runs_of_a_condition, number)]
    runs = []
    for condition in experiment.conditions():
        for of_scenario, (scenario, its_words) in zip(seeds, experiment.all_scenarios.items(), strict=True):
            parts = experiment.common, experiment.set, condition.overrides, its_words
            own = [word for part in parts for word in shlex.split(part)]
            named = any(word.startswith("variant=") for word in own)  # a condition may be of another variant
            typed = (*([] if named else [f"variant={experiment.variant}"]), *own, *overrides)
            place = folder / "conditions" / re.sub(r"[^A-Za-z0-9.]+", "_", f"{condition.name} {scenario}").strip("_")
            development = scenario in experiment.development
            runs.append(ConditionRun(condition, scenario, typed, place, of_scenario, development=development))
    return runs


def check(experiment: Experiment, runs: Sequence[ConditionRun], compose: Compose) -> None:
    """Compose and check every run. Raises `ProblemsFound` with everything that is wrong with any of them."""
    problems: list[Problem] = []
    stages: set[str] = set()
    composed: dict[tuple[str, ...], dict[str, Any]] = {}
    name = f"{experiment.name}: checking"
    with Progress(unit="configurations") as progress:  # one for each condition in each scenario
        progress.begin(name, 0, len(runs))
        for number, run in enumerate(runs, 1):
            try:
                if run.overrides not in composed:
                    composed[run.overrides] = compose(run.overrides)
                plain = json.loads(json.dumps(composed[run.overrides], default=str))
                run.config = dict(without_plotted(plain))
                run.prepared = prepare_run(run.config)
                stages.update(run.prepared.graph.nodes)
            except ProblemsFound as found:
                problems += [Problem(f"{run.name}: {p.where}", p.what, p.hint) for p in found.problems]
            progress.update(name, number, len(runs))
    problems += [
        Problem(f"experiment.measures.{name}", f"no condition has a stage '{stage}'", suggest(stage, stages, "stages"))
        for name, measure in experiment.measures.items()
        for stage in measure.stages
        if stages and stage not in stages
    ]
    if problems:
        raise ProblemsFound(dict.fromkeys(problems))


def open_inputs(runs: Sequence[ConditionRun]) -> None:
    """Open every file that the runs read. Raises `BadInput` where one cannot be read."""
    for run in runs:
        known_digests(run.prepared.graph)
        for artifact in run.prepared.artifacts:
            artifact_key(artifact)


def timed_groups(experiment: Experiment) -> list[tuple[str, ...]]:
    """Stages whose time is measured together."""
    return sorted({measure.stages for measure in experiment.measures.values() if measure.stages})


def find_results(experiment: Experiment, runs: Sequence[ConditionRun]) -> None:
    """Prepare every run again, with the recordings that it reads by now, and find the results of earlier attempts."""
    for run in runs:
        if run.error:
            continue
        try:
            run.prepared = prepare_run(run.config)
            run.key = condition_key(run.prepared, timed_groups(experiment))
            place = run.config.get("cache") if experiment.shared else None  # what is timed is timed again
            run.results = finished(run.folder, run.key, run.seeds, Cache(Path(place)) if place else None)
        except (ProblemsFound, BadInput) as wrong:
            run.error = str(wrong)


def results_by_condition(runs: Sequence[ConditionRun], development: bool = False) -> Results:
    """Returns the runs by condition, scenario and seed: of the scenarios that count, or of those of development.

    A repetition of a condition that failed has a result without values.
    """
    found: dict[tuple[tuple[str, str], ...], dict[tuple[str, int], dict[str, Any]]] = {}
    for run in runs:
        if run.development is development:
            of_condition = found.setdefault(key_of(run.condition.labels), {})
            of_condition |= {(run.scenario, seed): result for seed, result in run.results.items()}
            if run.error:
                of_condition |= {
                    (run.scenario, seed): {"metrics": {}, "timing": {}, "facts": {}} for seed in run.missing
                }
    return found
