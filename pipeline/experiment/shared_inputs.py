"""Inputs that several conditions of an experiment read, made once: recordings of computed sources, and artifacts."""

import math
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omninav.pipeline.engine.artifact import read_header
from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.engine.damage import report_damage
from omninav.pipeline.files import Damaged, digest_file, locked, read_json, write_json
from omninav.pipeline.graph.graph import Node
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.recordable import Recordable
from omninav.pipeline.graph.stage import Context
from omninav.pipeline.jobs.job import Job, Send
from omninav.pipeline.jobs.job_progress import Heartbeat
from omninav.pipeline.run.artifacts import Execution, obtain
from omninav.pipeline.run.prepared_run import PreparedRun, prepare_run
from omninav.pipeline.run.run_folder import RunFolder

from .conditions import ConditionRun
from .repetition import BASE_SEED, artifact_key

FACTS = "facts.json"
"""File in a recording's folder with what it is of, what its source stated of it, and the hashes of its files."""


@dataclass
class Recording:
    """A source's computed values, recorded for all runs that read them."""

    name: str
    key: str
    folder: Path
    stage: Recordable
    artifact: str | None
    """The artifact whose graph the source is of; None: the run's own graph."""
    readers: list[tuple[ConditionRun, dict[str, Any], str]] = field(default_factory=list)
    """Runs, each with the nodes of the graph that reads the recording, as it is configured, and its source's name."""

    @property
    def made(self) -> bool:
        """Tells whether it is there, whole."""
        return is_recorded(self.folder, self.key)

    @property
    def facts(self) -> dict[str, Any]:
        """Facts that were stated when it was recorded."""
        return dict(_stated(self.folder).get("facts", {}))

    def job(self, folder: Path) -> Job:
        """The job that records it; its log is in `folder`."""
        given = {
            "config": self.readers[0][0].config,
            "artifact": self.artifact,
            "key": self.key,
            "folder": str(self.folder),
        }
        log = folder / f"{self.folder.name}.log"
        return Job(self.name, f"{__name__}:record", given, log)

    def use(self) -> None:
        """Let all its readers replay it."""
        parameters = self.stage.replay(self.folder)
        changed = {name: value for name, value in parameters.items() if value is not None}
        for _, nodes, source in self.readers:
            nodes[source] = {name: value for name, value in nodes[source].items() if name not in parameters} | changed


def recordings_of(runs: Sequence[ConditionRun], folder: Path) -> list[Recording]:
    """Records what the runs' sources would compute, each once; recordings are in `folder` without a cache."""
    found: dict[str, Recording] = {}
    for run in runs:
        place = Path(str(run.config.get("cache") or folder)).resolve() / "recordings"
        for artifact in (None, *(each.name for each in run.prepared.artifacts if each.graph is not None)):
            node = _source_of(run.prepared, artifact)
            if node is None or not isinstance(node.stage, Recordable):
                continue
            key = node.stage.recording_key()
            if key is None:
                continue
            if key not in found:
                name = f"{node.stage.recording_name()} {key[:12]}"
                own = place / re.sub("[^A-Za-z0-9]+", "_", name)
                found[key] = Recording(name, key, own, node.stage, artifact)
            graph = run.config if artifact is None else run.config["artifacts"][artifact]["graph"]
            found[key].readers.append((run, graph["nodes"], node.name))
    return list(found.values())


def _source_of(prepared: PreparedRun, artifact: str | None) -> Node | None:
    if artifact is None:
        return prepared.graph.source
    graph = next(each.graph for each in prepared.artifacts if each.name == artifact)
    return graph.source if graph is not None else None


def is_recorded(folder: Path, key: str) -> bool:
    """Tells whether a folder holds the whole recording with this key."""
    if not folder.is_dir():
        return False
    stated = _stated(folder)
    files = dict(stated.get("files", {}))
    whole = all((folder / name).is_file() and digest_file(folder / name) == digest for name, digest in files.items())
    if stated.get("key") == key and files and whole:
        return True
    report_damage(f"{folder}: the recording in it is damaged; it is recorded again")
    return False


def _stated(folder: Path) -> dict[str, Any]:
    try:
        return read_json(folder / FACTS)
    except Damaged:
        return {}


def record(given: Mapping[str, Any], send: Send) -> None:
    """Record a source, as a job: that of the plain configuration `config`, or of its `artifact`, into `folder`."""
    node = _source_of(prepare_run(given["config"]), given["artifact"])
    assert node is not None
    assert isinstance(node.stage, Recordable)
    folder = Path(given["folder"])
    part = folder.with_name(f"{folder.name}.part")
    with locked(folder.with_name(f"{folder.name}.lock")):  # another experiment may record the same
        if is_recorded(folder, given["key"]):
            return
        for half_written in (part, folder):
            shutil.rmtree(half_written, ignore_errors=True)
        part.mkdir(parents=True)
        ctx = Context(node.name, folder=part)
        ctx.progress = Heartbeat(send).step
        node.stage.record(ctx, part)
        files = {str(path.relative_to(part)): digest_file(path) for path in sorted(part.rglob("*")) if path.is_file()}
        write_json(part / FACTS, {"key": given["key"], "facts": ctx.facts, "files": files})
        part.rename(folder)


@dataclass
class SharedArtifact:
    """An artifact that is made before the runs that read it, so that none waits for another's."""

    name: str
    folder: Path
    readers: list[tuple[ConditionRun, str]] = field(default_factory=list)
    """Runs, each with its own name for the artifact."""

    @property
    def file(self) -> Path:
        """Its path once it is made."""
        return self.folder / f"{self.readers[0][1]}.omap"

    @property
    def made(self) -> bool:
        """Tells whether it is there, whole."""
        try:
            return self.file.exists() and bool(read_header(self.file))
        except BadInput as damaged:
            report_damage(f"{damaged}; it is made again")
            return False

    def job(self) -> Job:
        """The job that makes it."""
        run, name = self.readers[0]
        given = {"config": run.config, "name": name, "folder": str(self.folder)}
        log = self.folder.with_suffix(".log")
        return Job(self.name, f"{__name__}:make_artifact", given, log)

    def use(self) -> None:
        """Let all its readers load it."""
        for run, name in self.readers:
            artifacts = run.config["artifacts"]
            loaded = artifacts[name] | {"file": str(self.file), "graph": None}
            run.config = run.config | {"artifacts": artifacts | {name: loaded}}


def artifacts_of(runs: Sequence[ConditionRun], folder: Path) -> list[SharedArtifact]:
    """The artifacts that runs make by a graph, each once."""
    found: dict[str, SharedArtifact] = {}
    for run in runs:
        for artifact in run.prepared.artifacts:
            if artifact.graph is None:
                continue
            name = f"{artifact.name} {artifact_key(artifact)[:12]}"
            shared = found.setdefault(name, SharedArtifact(name, folder / "artifacts" / name.replace(" ", "_")))
            shared.readers.append((run, artifact.name))
    return list(found.values())


def make_artifact(given: Mapping[str, Any], send: Send) -> None:
    """Make an artifact, as a job: the one called `name` of the plain configuration `config`, into `folder`."""
    run = RunFolder(Path(given["folder"]))
    with locked(run.folder.with_suffix(".lock")):  # a job whose experiment was killed lives on for a moment
        prepared = prepare_run(given["config"])
        cache = Cache(Path(str(prepared.config["cache"]))) if prepared.config.get("cache") else None
        execution = Execution(run, BASE_SEED, cache, math.inf, Heartbeat(send))
        run.folder.mkdir(parents=True, exist_ok=True)  # nothing else makes it where the cache has the artifact
        for artifact in prepared.artifacts:
            if artifact.name == given["name"]:
                obtain(execution, artifact)
        shutil.rmtree(run.memory, ignore_errors=True)
