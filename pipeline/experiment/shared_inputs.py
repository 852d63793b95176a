"""What several conditions of an experiment read, made once: recordings of sources that compute, and artifacts."""

import json
import math
import re
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.graph import Node
from omninav.pipeline.graph.recordable import Recordable
from omninav.pipeline.graph.stage import Context
from omninav.pipeline.run.artifacts import Execution, obtain
from omninav.pipeline.run.plan import Plan, plan
from omninav.pipeline.run.run_folder import Run

from .conditions import ConditionRun
from .job_progress import Heartbeat
from .process_pool import Job, Send
from .repetition import BASE_SEED, artifact_key

FACTS = "facts.json"
"""In a recording's folder: what its source stated of it."""


@dataclass
class Recording:
    """What a source computes, recorded for all runs that read it."""

    name: str
    folder: Path
    stage: Recordable
    artifact: str | None
    """The artifact whose graph the source is of; None: the run's own graph."""
    readers: list[tuple[ConditionRun, str | None]] = field(default_factory=list)
    """Runs, each with the artifact whose graph reads the recording."""

    @property
    def made(self) -> bool:
        """Whether it is there: a folder appears as a whole."""
        return self.folder.exists()

    @property
    def facts(self) -> dict[str, Any]:
        """What was stated when it was recorded."""
        path = self.folder / FACTS
        facts: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
        return facts

    def job(self, folder: Path) -> Job:
        """The job that records it; its log lies in `folder`."""
        given = {"config": self.readers[0][0].config, "artifact": self.artifact, "folder": str(self.folder)}
        return Job(self.name, f"{__name__}:record", given, folder / f"{self.folder.name}.log")

    def use(self) -> None:
        """Let all its readers replay it."""
        parameters = self.stage.replay(self.folder)
        for run, artifact in self.readers:
            config = run.config if artifact is None else run.config["artifacts"][artifact]["graph"]
            assert run.planned is not None
            node = _source_of(run.planned, artifact)
            assert node is not None
            kept = {name: value for name, value in config["nodes"][node.name].items() if name not in parameters}
            changed = {name: value for name, value in parameters.items() if value is not None}
            config["nodes"][node.name] = kept | changed


def recordings_of(runs: Sequence[ConditionRun], folder: Path) -> list[Recording]:
    """What the runs' sources would compute, each once; `folder` is where recordings lie without a cache."""
    found: dict[str, Recording] = {}
    for run in runs:
        assert run.planned is not None
        place = Path(str(run.config.get("cache") or folder)).resolve() / "recordings"
        for artifact in (None, *(each.name for each in run.planned.artifacts if each.graph is not None)):
            node = _source_of(run.planned, artifact)
            if node is None or not isinstance(node.stage, Recordable):
                continue
            key = node.stage.recording_key()
            if key is None:
                continue
            if key not in found:
                name = f"{node.stage.recording_name()} {key[:12]}"
                own = place / re.sub("[^A-Za-z0-9]+", "_", name)
                found[key] = Recording(name, own, node.stage, artifact)
            found[key].readers.append((run, artifact))
    return list(found.values())


def _source_of(planned: Plan, artifact: str | None) -> Node | None:
    if artifact is None:
        return planned.graph.source
    graph = next(each.graph for each in planned.artifacts if each.name == artifact)
    return graph.source if graph is not None else None


def record(given: Mapping[str, Any], send: Send) -> None:
    """Record a source, as a job: that of the plain configuration `config`, or of its `artifact`, into `folder`."""
    node = _source_of(plan(given["config"]), given["artifact"])
    assert node is not None
    assert isinstance(node.stage, Recordable)
    folder = Path(given["folder"])
    part = folder.with_name(f"{folder.name}.part")
    shutil.rmtree(part, ignore_errors=True)
    part.mkdir(parents=True)
    ctx = Context(node.name, folder=part)
    ctx.progress = Heartbeat(send).step
    node.stage.record(ctx, part)
    write_whole(part / FACTS, json.dumps(ctx.facts, indent=1, sort_keys=True) + "\n")
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
        """Where it lies once it is made."""
        return self.folder / f"{self.readers[0][1]}.omap"

    def job(self) -> Job:
        """The job that makes it."""
        run, name = self.readers[0]
        given = {"config": run.config, "name": name, "folder": str(self.folder)}
        return Job(self.name, f"{__name__}:make_artifact", given, self.folder.with_suffix(".log"))

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
        assert run.planned is not None
        for artifact in run.planned.artifacts:
            if artifact.graph is None:
                continue
            name = f"{artifact.name} {artifact_key(artifact)[:12]}"
            shared = found.setdefault(name, SharedArtifact(name, folder / "artifacts" / name.replace(" ", "_")))
            shared.readers.append((run, artifact.name))
    return list(found.values())


def make_artifact(given: Mapping[str, Any], send: Send) -> None:
    """Make an artifact, as a job: the one called `name` of the plain configuration `config`, into `folder`."""
    planned = plan(given["config"])
    cache = Cache(Path(str(planned.config["cache"]))) if planned.config.get("cache") else None
    run = Run(Path(given["folder"]))
    execution = Execution(run, BASE_SEED, cache, math.inf, Heartbeat(send))
    run.folder.mkdir(parents=True, exist_ok=True)  # nothing else makes it where the cache has the artifact
    for artifact in planned.artifacts:
        if artifact.name == given["name"]:
            obtain(execution, artifact)
    shutil.rmtree(run.memory, ignore_errors=True)
