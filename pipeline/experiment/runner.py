"""Running an experiment: recordings, artifacts, repetitions and the page; what was finished before is found again."""

import math
import os
import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml

from omninav.pipeline.engine.code_version import LIBRARIES, git_commit, version
from omninav.pipeline.files import write_json, write_whole
from omninav.pipeline.graph.problems import counted
from omninav.pipeline.jobs.executors import ExecutorSettings, read_executor
from omninav.pipeline.jobs.job import Job, Outcome
from omninav.pipeline.jobs.job_progress import JobProgress
from omninav.pipeline.jobs.throttle import Throttle
from omninav.pipeline.jobs.worker_pool import WorkerPool
from omninav.pipeline.report.metrics import title, unit
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.run.run_folder import RunFolder

from .conditions import (
    Compose,
    ConditionRun,
    check,
    condition_runs,
    find_results,
    results_by_condition,
    timed_groups,
)
from .page import write_page
from .repetition import finished
from .result import ConditionRow, ExperimentResult, summary_of
from .shared_inputs import Recording, artifacts_of, recordings_of
from .specification import FULL, Experiment, read_experiment
from .verdicts import Verdict, judge, unmeasured

STATE = "experiment.json"
"""File in an experiment's folder that states how it was started, and how far it is."""


@dataclass
class ExperimentRun:
    """An experiment on its way: `folder` is the same for every attempt, so that one continues where another stopped."""

    experiment: Experiment
    profile: str
    file: str
    """The experiment as YAML."""
    folder: Path
    argv: Sequence[str]
    conditions: list[ConditionRun]
    executor: ExecutorSettings = field(default_factory=ExecutorSettings)
    recordings: list[Recording] = field(default_factory=list)
    started: datetime = field(default_factory=datetime.now)
    state: dict[str, Any] = field(default_factory=dict)
    """Content of its file `STATE`."""

    def run(self) -> bool:
        """All phases. Returns whether every job came to its end. Raises `BadInput` where another process runs it."""
        with RunFolder(self.folder).owned(), WorkerPool(self.executor, self.folder) as workers:
            write_whole(self.folder / "experiment.yaml", self.file)
            self._write_state("running")
            self._record(workers)
            find_results(self.experiment, self.conditions)
            self._make_artifacts(workers)
            self._repeat(workers)
            well = not any(run.error for run in self.conditions)
            self._write_state("complete" if well else "failed")
            self.write_page()
            return well

    def verdicts(self) -> dict[str, Verdict]:
        """The verdict on each claim, by its key."""
        return judge(self.experiment, results_by_condition(self.conditions))

    def write_page(self) -> Path:
        """The page so far."""
        return write_page(self.experiment, self.result(), self.folder)

    def result(self) -> ExperimentResult:
        """The results so far. Those of development are in the tables, and nothing else is made of them."""
        experiment, conditions = self.experiment, self.conditions
        results, beside = results_by_condition(conditions), results_by_condition(conditions, development=True)
        verdicts, cells, curves = summary_of(experiment, results, beside)
        common = [word for word in conditions[0].overrides if all(word in run.overrides for run in conditions)]
        return ExperimentResult(
            name=experiment.name,
            command=shlex.join(self.argv),
            profile=self.profile,
            made_with=self._made_with(),
            repeated=_repeated(experiment),
            verdicts=verdicts,
            cells=cells,
            curves=curves,
            recordings={each.name: _facts(each.facts) for each in self.recordings},
            conditions=tuple(_condition(run, common) for run in conditions),
            failures={run.name: run.error for run in self.conditions if run.error},
            missing=sum(len(run.missing) for run in self.conditions if not run.error),
            # Where this machine keeps what it made is no part of the experiment.
            common_overrides=tuple(word for word in common if not word.startswith("cache=")),
        )

    def _record(self, workers: WorkerPool) -> None:
        self.recordings = recordings_of(self.conditions, self.folder)
        jobs = [each.job(self.folder / "recordings") for each in self.recordings if not each.made]
        failed = self._run_jobs(workers, jobs, "recording")
        for each in self.recordings:
            if each.name in failed:
                for run, *_ in each.readers:
                    run.error = f"{each.name} could not be recorded: {failed[each.name]}"
            else:
                each.use()

    def _make_artifacts(self, workers: WorkerPool) -> None:
        artifacts = artifacts_of([run for run in self.conditions if run.unfinished], self.folder)
        failed = self._run_jobs(workers, [each.job() for each in artifacts if not each.made], "artifact")
        for each in artifacts:
            if each.name in failed:
                for run, name in each.readers:
                    run.error = f"its {name} could not be made: {failed[each.name]}"
            each.use()

    def _repeat(self, workers: WorkerPool) -> None:
        runs = [run for run in self.conditions if run.unfinished]
        parts = max(1, workers.number // max(1, len(runs)))  # a condition's seeds share more in one job than in several
        jobs = {job.name: (job, run) for run in runs for job in self._repetitions(run, parts)}
        total = sum(len(run.seeds) for run in self.conditions)

        def done() -> int:
            return sum(len(run.results) for run in self.conditions)

        throttle = Throttle()
        with Progress(unit="repetitions") as progress:

            def on_message(job: Job, message: Any) -> None:
                if "seed" in message:
                    run = jobs[job.name][1]
                    run.results |= finished(run.folder, run.key, [message["seed"]])
                    if done() == 1:
                        for problem in unmeasured(self.experiment, results_by_condition(self.conditions)):
                            print(f"so far: {problem.where}: {problem.what}; {problem.hint}", flush=True)
                    progress.update(self.experiment.name, done(), total)

            def on_end(job: Job, outcome: Outcome) -> None:
                run = jobs[job.name][1]
                if outcome.error:
                    run.error = outcome.error
                    print(f"{run.name}: {outcome.error}", flush=True)
                throttle(self.write_page)

            progress.begin(self.experiment.name, done(), total)
            workers.run([job for job, _ in jobs.values()], on_message, on_end)

    def _repetitions(self, run: ConditionRun, parts: int) -> list[Job]:
        """The jobs of a condition: its seeds, in some parts."""
        size = math.ceil(len(run.missing) / parts)
        chunks = [run.missing[begin : begin + size] for begin in range(0, len(run.missing), size)]
        found = []
        for seeds in chunks:
            several = f"_{seeds[0]}" if len(chunks) > 1 else ""
            given = {
                "config": run.config,
                "folder": str(run.folder),
                "part": f"seeds{several}",
                "key": run.key,
                "code": run.prepared.digest,
                "seeds": seeds,
                "shared": self.experiment.shared,
                "groups": timed_groups(self.experiment),
            }
            function, log = "omninav.pipeline.experiment.repetition:repeat", run.folder / f"run{several}.log"
            found.append(Job(f"{run.folder.name}{several}", function, given, log))
        return found

    def _run_jobs(self, workers: WorkerPool, jobs: Sequence[Job], what: str) -> dict[str, str]:
        """Run jobs whose frames are counted. Returns the errors by the jobs' names."""
        if not jobs:
            return {}
        frames, name = JobProgress(len(jobs)), f"{self.experiment.name}: {what}s"
        with Progress() as progress:

            def show() -> None:
                if frames.done != frames.total or frames.ended == len(jobs):
                    note = f"{frames.ended} of {counted(len(jobs), what)} done"
                    progress.update(name, frames.done, frames.total, note)

            def on_message(job: Job, message: Any) -> None:
                frames.on_message(job.name, message)
                show()

            def on_end(job: Job, outcome: Outcome) -> None:
                frames.end(job.name, not outcome.error)
                if outcome.error:
                    print(f"{job.name}: {outcome.error}", flush=True)
                show()

            progress.say(f"{self.experiment.name}: {counted(len(jobs), what)} to make")
            progress.begin(name, 0)
            ended = workers.run(jobs, on_message, on_end)
            return {name: outcome.error for name, outcome in ended.items() if outcome.error}

    def _write_state(self, status: str) -> None:
        self.state = {
            "omninav": version("omninav"),
            "status": status,
            "experiment": self.experiment.name,
            "profile": self.profile,
            "argv": list(self.argv),
            "cwd": os.getcwd(),
            "started": self.started.isoformat(timespec="seconds"),
            "written": datetime.now().isoformat(timespec="seconds"),
            "git_commit": git_commit(),
            "engine": self.executor.name,
            "workers": self.executor.workers,
            "libraries": {name: version(name) for name in LIBRARIES},
        }
        write_json(self.folder / STATE, self.state)

    def _made_with(self) -> str:
        """The version and commit that experiment.json states: in 12 digits, and whether it had changes."""
        known, dirty, _ = (self.state.get("git_commit") or "").partition("-dirty")
        at = f", commit {known[:12]}" + (" with changes that are not committed" if dirty else "") if known else ""
        return f"Made with omninav {self.state['omninav']}{at}" if self.state else ""


def _repeated(experiment: Experiment) -> str:
    runs, seeds = experiment.runs_of_a_condition, experiment.repetitions
    scenarios = experiment.named_scenarios
    named = "seed 0" if runs == 1 else f"seeds 0 to {runs - 1}"
    several = (
        f", {seeds} in each of {counted(len(scenarios), 'scenario')} ({', '.join(scenarios)})" if scenarios else ""
    )
    return f"{runs} repetitions of each condition with {named}{several}"


def _facts(facts: Mapping[str, Any]) -> str:
    return ", ".join(f"{title(name).lower()} {value} {unit(name)}".rstrip() for name, value in facts.items())


def _condition(run: ConditionRun, common: Sequence[str]) -> ConditionRow:
    first: Mapping[str, Any] = next(iter(run.results.values()), {})
    own = shlex.join(word for word in run.overrides if word not in common)
    return ConditionRow(run.name, f"{len(run.results)}/{len(run.seeds)}", first.get("context", {}), own)


def prepare_experiment(
    config: Mapping[str, Any], compose: Compose, overrides: Sequence[str], argv: Sequence[str]
) -> ExperimentRun:
    """The experiment of a composed configuration, checked. Raises `ProblemsFound` where it or a condition is wrong.

    `overrides`: what was typed for all of its conditions.
    """
    profile = str(config.get("profile") or FULL)
    experiment = read_experiment(config["experiment"], profile)
    file = yaml.safe_dump(dict(config["experiment"]), sort_keys=False, allow_unicode=True, width=120)
    executor = read_executor(config.get("executor"))
    if experiment.cores is not None:
        executor = replace(executor, workers=experiment.cores)
    folder = (Path(str(config.get("runs", "runs"))) / f"{experiment.name}_{profile}").resolve()
    conditions = condition_runs(experiment, folder, overrides)
    run = ExperimentRun(experiment, profile, file, folder, argv, conditions, executor)
    check(experiment, conditions, compose)
    return run
