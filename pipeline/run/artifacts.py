"""Artifacts: loaded from their files, found in the cache, or made by running their graphs."""

import os
import shutil
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any, Protocol

from omninav.pipeline.engine.artifact import artifact_digest, read_artifact, read_header, write_artifact
from omninav.pipeline.engine.cache import Cache, seeded
from omninav.pipeline.engine.chunks import IN_MEMORY
from omninav.pipeline.engine.code_version import graph_digest
from omninav.pipeline.engine.engine import Engine, EngineOptions
from omninav.pipeline.engine.prefix import cached_prefix, keep_prefix
from omninav.pipeline.files import digest_text, whole_file
from omninav.pipeline.graph.graph import Graph
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.stage import Source
from omninav.pipeline.graph.value import Value

from .prepared_run import PreparedArtifact, digests_of, stages_of
from .run_folder import RunFolder
from .run_results import notes_of


class ProgressDisplay(Protocol):
    """Shows the progress of a run."""

    def update(self, name: str, done: int, total: int | None = None) -> None:
        """`done` ticks of `total` have gone through the graph `name`."""

    def say(self, words: str) -> None:
        """A stage of it does or waits for something, in words."""


@dataclass(frozen=True)
class Execution:
    """Options with which a run's graphs are run."""

    run: RunFolder
    seed: int
    cache: Cache | None = None
    checkpoint_s: float = 5.0
    display: ProgressDisplay | None = None
    validate: bool = False

    def options(self, name: str, memory: Path, identity: str, folder: Path | None = None) -> EngineOptions:
        """The engine's options for the graph that is shown as `name`."""
        options = EngineOptions(self.seed, folder, memory, identity, self.checkpoint_s, validate=self.validate)
        if self.display is None:
            return options
        return replace(options, on_tick=partial(self.display.update, name), on_status=self.display.say)


def identity(graph: Graph, seed: int, *more: str) -> str:
    """The hash by which a checkpoint knows the run that it belongs to."""
    return digest_text(graph_digest(graph), str(seed), *digests_of(graph).values(), *more)


def companions(artifact: PreparedArtifact, artifacts: Sequence[PreparedArtifact]) -> list[PreparedArtifact]:
    """The other artifacts that are outputs of the same graph: one run makes them all."""
    others = (other for other in artifacts if other is not artifact)
    return [other for other in others if other.whole is not None and other.whole is artifact.whole]


def obtain(
    execution: Execution, artifact: PreparedArtifact, together: Sequence[PreparedArtifact] = ()
) -> tuple[Value, dict[str, Any]]:
    """The artifact's value, from its file, the cache or its graph's run, with what the manifest records of it.

    Where its graph has to run, what else that gives (`together`) is put into the cache too.
    """
    run, seed = execution.run, execution.seed
    target = run.folder / f"{artifact.name}.omap"
    if artifact.file is not None:
        value = read_artifact(artifact.file)
        _copy(artifact.file, target)
        loaded = {"file": str(artifact.file), "sha256": artifact_digest(target), "reason": "loaded from a file"}
        return value, {**loaded, **read_header(artifact.file)["facts"]}
    cache = execution.cache or Cache(run.memory / "artifacts")
    key = _key(artifact)
    with cache.lock(key):
        found = found_value(cache, key, ".omap", seed)
        if found is not None:
            file, value, _ = found
            maker = read_header(file)["facts"].get("variant", artifact.variant)
            reason = f"found: made before by {maker}, the same graph over the same log"
        else:
            own, every = Cache(run.memory / "artifacts"), list(_make(execution, [artifact, *together]))
            kept: tuple[Path, Value] | None = None
            with cache.unless_full():
                kept = _into(cache, seed, every)
            file, value = kept or _into(own, seed, every)
            reason = "made: code, parameters or log are new to the cache"
        _copy(file, target)
    made = {"variant": artifact.variant, "output": artifact.origin, "sha256": artifact_digest(target), "reason": reason}
    return value, {**read_header(target)["facts"], **made}


def found_value(cache: Cache, key: str, suffix: str, seed: int) -> tuple[Path, Value, Any] | None:
    """A value's file in the cache, the value and its notes; None where there is none, or no valid one."""
    for candidate in (key, seeded(key, seed)):
        found = cache.find(candidate, suffix)
        if found is not None:
            try:
                return found[0], read_artifact(found[0]), found[1]
            except BadInput as unfit:
                cache.discard(candidate, suffix, str(unfit))
    return None


def _into(
    cache: Cache, seed: int, made: Iterable[tuple[PreparedArtifact, Value, dict[str, Any], bool]]
) -> tuple[Path, Value]:
    """Put artifacts into the cache. The first is the one that is wanted; it is read as the next run will read it."""
    files = []
    for artifact, value, header, used_rng in made:
        key = seeded(_key(artifact), seed) if used_rng else _key(artifact)
        with cache.keep(key, ".omap") as part:
            write_artifact(part, value, header)
        files.append(cache.path(key, ".omap"))
    return files[0], read_artifact(files[0])


def _copy(file: Path, target: Path) -> None:
    """Copy a file, or link it where it is one of those that stay on disk: no program of ours changes it in place."""
    with whole_file(target) as part:
        if file.stat().st_size > IN_MEMORY:
            with suppress(OSError):  # another disk, or a file system without links
                os.link(file.resolve(), part)
        if not part.exists():
            shutil.copyfile(file, part)


def _key(artifact: PreparedArtifact) -> str:
    assert artifact.graph is not None
    return digest_text("artifact", graph_digest(artifact.graph), artifact.origin, *digests_of(artifact.graph).values())


def _make(
    execution: Execution, wanted: Sequence[PreparedArtifact]
) -> Iterator[tuple[PreparedArtifact, Value, dict[str, Any], bool]]:
    """Run the graph of some artifacts; of each that it gave: value, header, and whether random numbers decided it."""
    artifact, origins = wanted[0], [each.origin for each in wanted]
    graph = artifact.graph if len(wanted) == 1 or artifact.whole is None else artifact.whole.leading_to(origins)
    assert graph is not None
    memory = execution.run.memory / artifact.name
    options = execution.options(artifact.variant, memory, identity(graph, execution.seed))
    with cached_prefix(graph, execution.cache, execution.seed, origins) as prefix:
        engine = Engine(graph, {}, options, wanted=origins, replay=prefix.replay, recorded=prefix.recorded())
        values = engine.run()
        keep_prefix(engine, prefix, execution.cache)
    if not isinstance(values[artifact.origin], Value):
        raise BadInput(
            f"'{artifact.variant}' ran to its end and gave no {artifact.name}: was there anything usable in its log, "
            "and does the step of each stage of yours return its outputs?"
        )
    for each in wanted:
        value = values[each.origin]
        if isinstance(value, Value) and each.graph is not None:
            used_rng = any(engine.calls[name].ctx.used_rng for name in each.graph.nodes)
            yield each, value, provenance(each.graph, engine, each.variant), used_rng


def provenance(graph: Graph, engine: Engine, variant: str) -> dict[str, Any]:
    """Provenance of an artifact for its file's header: what was dropped and stated, the variant, and its stages.

    Of a source that gives other ticks in every run only the facts: what it counted is of that run, and the same ticks
    from a record make the same file.
    """
    source, notes = graph.source, notes_of(engine, graph.nodes)
    if source is not None and isinstance(source.stage, Source) and not source.stage.repeatable:
        others = notes_of(engine, graph.nodes.keys() - {source.name})
        notes = others | {"facts": others["facts"] | engine.calls[source.name].ctx.facts}
    return {**notes, "variant": variant, "stages": stages_of(graph)}
