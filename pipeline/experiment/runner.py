"""Running an experiment: its logs, its maps, its conditions, and its page; what was finished before is found again."""

import json
import os
import re
import shutil
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml

from omninav.pipeline.engine.artifact import Cache
from omninav.pipeline.files import digest_text, write_whole
from omninav.pipeline.graph.graph import Graph
from omninav.pipeline.graph.problems import BadInput, Problem, ProblemsFound, suggest
from omninav.pipeline.report.progress import Progress
from omninav.pipeline.run.run import LIBRARIES, Plan, git_commit, plan, version, without_companions

from .process_pool import Job, work_through
from .repetition import artifact_key, condition_key, finished, known_digests
from .specification import Condition, Experiment, read_experiment, words_of
from .verdicts import Results, key_of

Compose = Callable[[Sequence[str]], dict[str, Any]]
"""Words of the command line -> the plain, complete configuration they describe."""


@dataclass
class ConditionRun:
    """A condition over one drive, or a run beside it, on its way: configuration, folder, results by seed, error."""

    condition: Condition
    drive: str
    variant: str
    words: tuple[str, ...]
    folder: Path
    seeds: tuple[int, ...]
    config: dict[str, Any] = field(default_factory=dict)
    planned: Plan | None = None
    key: str = ""
    results: dict[int, dict[str, Any]] = field(default_factory=dict)
    error: str = ""
    shared: bool = True

    @property
    def name(self) -> str:
        """The condition's labels, and the drive where there are several."""
        return ", ".join(part for part in (self.condition.name, self.drive and f"drive {self.drive}") if part)


@dataclass
class Log:
    """A simulated drive that conditions read: where it lies, and what is stated of it."""

    name: str
    config: dict[str, Any]
    folder: Path

    @property
    def file(self) -> Path:
        """The log itself."""
        return self.folder / "drive.mcap"

    @property
    def facts(self) -> dict[str, Any]:
        """What was stated when it was written."""
        path = self.folder / "facts.json"
        facts: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
        return facts


class JobProgress:
    """How many frames jobs have done, of how many: what each one told last, added up."""

    def __init__(self, jobs: int) -> None:
        self._jobs = jobs
        self._told: dict[str, tuple[int, int | None]] = {}
        self._ended: set[str] = set()

    def heard(self, job: str, word: Mapping[str, Any]) -> None:
        """A job told its `frames` and `of`, as `Heartbeat` does."""
        if "frames" in word:
            self._told[job] = word["frames"], word.get("of")

    def end(self, job: str, well: bool = True) -> None:
        """A job has come to its end: all its frames are done, or it failed and does no more."""
        done, total = self._told.get(job, (0, 0))
        done = total if well and total else done
        self._told[job] = done, done
        self._ended.add(job)

    @property
    def ended(self) -> int:
        """How many jobs have come to their end."""
        return len(self._ended)

    @property
    def done(self) -> int:
        """Frames done in all jobs."""
        return sum(done for done, _ in self._told.values())

    @property
    def total(self) -> int | None:
        """Frames in all jobs; those that have told nothing count as the mean of the others. None: nothing is known."""
        known = [total for done, total in self._told.values() if total]
        silent = self._jobs - len(self._told)
        if any(total is None for _, total in self._told.values()) or (silent and not known):
            return None
        return sum(known) + (silent * max(1, round(sum(known) / len(known))) if silent else 0)


class ExperimentRun:
    """An experiment on its way through its phases: logs, maps, repetitions. `folder` is the same for every attempt."""

    def __init__(
        self,
        experiment: Experiment,
        profile: str,
        compose: Compose,
        words: Sequence[str],
        runs: Path,
        argv: Sequence[str],
        file: str,
    ) -> None:
        self.file = file
        self.experiment, self.profile, self.compose = experiment, profile, compose
        self.folder = (runs / f"{experiment.name}_{profile}").resolve()
        self.argv = list(argv)
        self.cores = experiment.cores or len(os.sched_getaffinity(0))
        self.started = datetime.now()
        self.logs: dict[str, Log] = {}
        self._drives: dict[str, str] = {}
        drives = experiment.drives or {"": ""}
        self.cells = [
            self._cell(condition, drive, experiment.variant, (experiment.set, condition.words, driven), words)
            for condition in experiment.conditions()
            for drive, driven in drives.items()
        ]
        self.beside: list[list[ConditionRun]] = []
        for remark in experiment.remarks:
            row = []
            for label, own in experiment.sweep[remark.over].items():
                condition = Condition({remark.over: str(label)}, str(own or ""))
                for drive, driven in drives.items():
                    parts = (remark.set, condition.words, driven)
                    row.append(self._cell(condition, drive, remark.variant, parts, words, beside=True))
            self.beside.append(row)

    @property
    def groups(self) -> list[tuple[str, ...]]:
        """Stages whose time is measured together."""
        return sorted({measure.stages for measure in self.experiment.measures.values() if measure.stages})

    @property
    def all_cells(self) -> list[ConditionRun]:
        """Conditions and the runs beside them."""
        return [*self.cells, *(cell for row in self.beside for cell in row)]

    @property
    def results(self) -> Results:
        """What has run, by condition and repetition: a number for each seed over each drive."""
        found: dict[tuple[tuple[str, str], ...], dict[int, dict[str, Any]]] = {}
        drives = list(self.experiment.drives) or [""]
        for cell in self.cells:
            first = drives.index(cell.drive) * self.experiment.repetitions
            of_condition = found.setdefault(key_of(cell.condition.labels), {})
            of_condition |= {first + seed: result for seed, result in cell.results.items()}
        return found

    def _cell(
        self,
        condition: Condition,
        drive: str,
        variant: str,
        parts: Sequence[str],
        words: Sequence[str],
        beside: bool = False,
    ) -> ConditionRun:
        own = [word for part in (self.experiment.common, *parts) for word in words_of(part)]
        named = any(word.startswith("variant=") for word in own)  # a condition may be of another variant
        typed = (*([] if named else [f"variant={variant}"]), *own, *words)
        said = " ".join(part for part in (condition.name, drive, variant if beside else "") if part)
        name = re.sub(r"[^A-Za-z0-9.]+", "_", said).strip("_")
        seeds = (0,) if beside else tuple(range(self.experiment.repetitions))
        cell = ConditionRun(
            condition,
            drive,
            variant,
            typed,
            self.folder / "conditions" / name,
            seeds,
            shared=self.experiment.shared and not beside,
        )
        return cell

    def check(self) -> None:
        """Compose and check every condition. Raises `ProblemsFound` before anything has run."""
        problems: list[Problem] = []
        composed: dict[tuple[str, ...], dict[str, Any]] = {}
        cells, name = self.all_cells, f"{self.experiment.name}: checking"
        with Progress(unit="conditions") as progress:
            progress.begin(name, 0, len(cells))
            for number, cell in enumerate(cells, 1):
                try:
                    if cell.words not in composed:
                        composed[cell.words] = self.compose(cell.words)
                    cell.config = dict(without_companions(json.loads(json.dumps(composed[cell.words], default=str))))
                    cell.planned = plan(cell.config)
                except ProblemsFound as found:
                    problems += [Problem(f"{cell.name}: {p.where}", p.what, p.hint) for p in found.problems]
                progress.update(name, number, len(cells))
        problems += self._unknown_stages()
        if problems:
            raise ProblemsFound(dict.fromkeys(problems))

    def _unknown_stages(self) -> list[Problem]:
        """Stages whose time is asked for and that no condition has."""
        graphs = [cell.planned.graph for cell in self.all_cells if cell.planned is not None]
        there = sorted({name for graph in graphs for name in graph.nodes})
        return [
            Problem(
                f"experiment.measures.{measure}", f"no condition has a stage '{stage}'", suggest(stage, there, "stages")
            )
            for measure, asked in self.experiment.measures.items()
            for stage in asked.stages
            if graphs and stage not in there
        ]

    def open_inputs(self) -> None:
        """Open every log and map that the conditions name. Raises `BadInput` where one cannot be read."""
        for cell in self.all_cells:
            assert cell.planned is not None
            known_digests(cell.planned.graph)
            for artifact in cell.planned.artifacts:
                artifact_key(artifact)

    def run(self) -> bool:
        """All phases. Returns whether every job came to its end."""
        write_whole(self.folder / "experiment.yaml", self.file)
        self._state("running")
        self._write_logs()
        self._key()
        self._make_maps()
        self._repeat()
        self._state("complete" if not any(cell.error for cell in self.all_cells) else "failed")
        self.write_page()
        return not any(cell.error for cell in self.all_cells)

    def write_page(self) -> Path:
        """The page as things stand."""
        from .page import write_page

        return write_page(self)

    # logs

    def _write_logs(self) -> None:
        for cell in self.all_cells:
            assert cell.planned is not None
            self._use_log(cell, cell.planned.graph, cell.config, cell.config.get("route"), cell.config.get("day"))
            for artifact in cell.planned.artifacts:
                spec = cell.config["artifacts"][artifact.name]
                if artifact.graph is not None:
                    self._use_log(cell, artifact.graph, spec["graph"], spec.get("route"), spec.get("day"))
        for log in self.logs.values():
            if not log.file.exists():
                shutil.rmtree(log.folder, ignore_errors=True)
        jobs = [
            Job(
                log.name,
                "omninav.pipeline.experiment.repetition:simulate",
                {"config": log.config, "part": str(log.folder) + ".part", "folder": str(log.folder)},
                self.folder / "logs" / f"{log.name.replace(' ', '_')}.log",
            )
            for log in self.logs.values()
            if not log.file.exists()
        ]
        failed = self._through(jobs, "logs")
        for log in self.logs.values():
            if log.name in failed:
                for cell in self.all_cells:
                    if str(log.file) in json.dumps(cell.config):
                        cell.error = f"its log ({log.name}) could not be simulated: {failed[log.name]}"

    def _use_log(self, cell: ConditionRun, graph: Graph, config: dict[str, Any], route: Any, day: Any) -> None:
        """Let the graph's source read a simulated log instead of rendering for itself, where no log is named.

        What the log was made of is no longer among the source's parameters: drives that look alike are one.
        """
        source = graph.source
        if source is None or "world" not in source.parameters or source.parameters.get("log") is not None:
            return
        if "log" not in source.signature.parameters:  # a closed loop: nobody knows where it will drive
            return
        world = cell.config["world"]
        node = config["nodes"][source.name]
        events = node.get("events") or []
        driven = {"world": world, "route": route, "day": day, "events": events}
        identity = json.dumps(driven, sort_keys=True)
        if identity not in self._drives:
            self._drives[identity] = source.stage.inputs_digest() or digest_text(identity)
        digest = self._drives[identity]
        if digest not in self.logs:
            drive = f"{world.get('name', 'world')} {route} day {day}{' with events' if events else ''}"
            name = f"{drive} {digest[:12]}"  # two worlds of one name differ in what else was said of them
            made = self.compose(["variant=simulate"])
            place = Path(str(cell.config.get("cache") or self.folder)).resolve() / "logs"
            folder = place / re.sub("[^A-Za-z0-9]+", "_", name)
            for drives in made["nodes"].values():
                if isinstance(drives, dict) and "world" in drives:
                    drives |= {**driven, "log": f"{folder}.part/drive.mcap"}
            self.logs[digest] = Log(name, made, folder)
        kept = {name: value for name, value in node.items() if name not in driven}
        config["nodes"][source.name] = {**kept, "log": str(self.logs[digest].file)}

    # maps

    def _key(self) -> None:
        """Plan every condition over its log, and find what was finished before."""
        for cell in self.all_cells:
            if cell.error:
                continue
            try:
                cell.planned = plan(cell.config)
                cell.key = condition_key(cell.planned, self.groups)
                place = cell.config.get("cache") if cell.shared else None  # what is timed is timed anew
                cell.results = finished(cell.folder, cell.key, cell.seeds, Cache(Path(place)) if place else None)
            except (ProblemsFound, BadInput) as wrong:
                cell.error = str(wrong)

    def _make_maps(self) -> None:
        """One job for each map that an unfinished condition needs, so that no condition waits for another's."""
        jobs: dict[str, Job] = {}
        needs: dict[str, list[tuple[ConditionRun, str, Path]]] = {}
        for cell in self._unfinished():
            assert cell.planned is not None
            for artifact in cell.planned.artifacts:
                if artifact.graph is None:
                    continue
                name = f"{artifact.name} {artifact_key(artifact)[:12]}"
                folder = self.folder / "maps" / name.replace(" ", "_")
                needs.setdefault(name, []).append((cell, artifact.name, folder / f"{artifact.name}.omap"))
                if not (folder / f"{artifact.name}.omap").exists():
                    given = {"config": cell.config, "name": artifact.name, "folder": str(folder)}
                    jobs.setdefault(
                        name,
                        Job(name, "omninav.pipeline.experiment.repetition:prepare", given, folder.with_suffix(".log")),
                    )
        failed = self._through(list(jobs.values()), "maps")
        for name, users in needs.items():
            for cell, artifact_name, file in users:
                if name in failed:
                    cell.error = f"its {artifact_name} could not be made: {failed[name]}"
                spec = cell.config["artifacts"][artifact_name]
                cell.config = cell.config | {
                    "artifacts": cell.config["artifacts"] | {artifact_name: spec | {"file": str(file), "graph": None}}
                }

    # repetitions

    def _unfinished(self) -> list[ConditionRun]:
        return [cell for cell in self.all_cells if not cell.error and len(cell.results) < len(cell.seeds)]

    def _repeat(self) -> None:
        cells = {str(number): cell for number, cell in enumerate(self._unfinished())}
        jobs = [
            Job(
                number,
                "omninav.pipeline.experiment.repetition:repeat",
                {
                    "config": cell.config,
                    "folder": str(cell.folder),
                    "key": cell.key,
                    "code": cell.planned.graph.digest() if cell.planned is not None else "",
                    "seeds": [seed for seed in cell.seeds if seed not in cell.results],
                    "shared": cell.shared,
                    "groups": self.groups,
                },
                cell.folder / "run.log",
            )
            for number, cell in cells.items()
        ]
        total = sum(len(cell.seeds) for cell in self.all_cells)
        with Progress(unit="repetitions") as progress:

            def show() -> None:
                progress.update(self.experiment.name, sum(len(cell.results) for cell in self.all_cells), total)

            def heard(job: Job, word: Any) -> None:
                if "seed" in word:
                    cell = cells[job.name]
                    cell.results |= finished(cell.folder, cell.key, [word["seed"]])
                    show()

            def ended(job: Job, error: str | None) -> None:
                cell = cells[job.name]
                cell.error = error or ""
                if error:
                    print(f"{cell.name}: {error}", flush=True)
                self.write_page()

            progress.begin(self.experiment.name, sum(len(cell.results) for cell in self.all_cells), total)
            work_through(jobs, self.cores, heard, ended)

    def _through(self, jobs: Sequence[Job], what: str) -> dict[str, str]:
        if not jobs:
            return {}
        frames, name = JobProgress(len(jobs)), f"{self.experiment.name}: {what}"
        with Progress() as progress:

            def show() -> None:
                if frames.done != frames.total or frames.ended == len(jobs):
                    progress.update(name, frames.done, frames.total, f"{frames.ended} of {len(jobs)} {what} done")

            def heard(job: Job, word: Any) -> None:
                frames.heard(job.name, word)
                show()

            def ended(job: Job, error: str | None) -> None:
                frames.end(job.name, not error)
                if error:
                    print(f"{job.name}: {error}", flush=True)
                show()

            progress.say(f"{self.experiment.name}: {len(jobs)} {what} to make")
            progress.begin(name, 0)
            return work_through(jobs, self.cores, heard, ended)

    def _state(self, status: str) -> None:
        manifest = {
            "omninav": version("omninav"),
            "status": status,
            "experiment": self.experiment.name,
            "profile": self.profile,
            "argv": self.argv,
            "cwd": os.getcwd(),
            "started": self.started.isoformat(timespec="seconds"),
            "written": datetime.now().isoformat(timespec="seconds"),
            "git_commit": git_commit(),
            "cores": self.cores,
            "libraries": {name: version(name) for name in LIBRARIES},
        }
        write_whole(self.folder / "experiment.json", json.dumps(manifest, indent=1) + "\n")


def plan_experiment(
    config: Mapping[str, Any], compose: Compose, words: Sequence[str], argv: Sequence[str]
) -> ExperimentRun:
    """The experiment of a composed configuration, checked. Raises `ProblemsFound` where it or a condition is wrong."""
    profile = str(config.get("profile") or "paper")
    experiment = read_experiment(config["experiment"], profile)
    file = yaml.safe_dump(dict(config["experiment"]), sort_keys=False, allow_unicode=True, width=120)
    run = ExperimentRun(experiment, profile, compose, words, Path(str(config.get("runs", "runs"))), argv, file)
    run.check()
    return run
