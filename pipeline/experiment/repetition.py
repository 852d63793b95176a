"""One condition of an experiment, run once for every seed: what does not depend on the seed is computed once.

The first repetition records what follows from the inputs alone, and the others read it.
"""

import copy
import json
import math
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from omninav.pipeline.engine.artifact import artifact_digest
from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.engine.code_version import graph_digest, module_version
from omninav.pipeline.engine.damage import report_damage
from omninav.pipeline.engine.disk_sequence import DiskSequence
from omninav.pipeline.engine.engine import Engine, EngineOptions, PrefixReplay
from omninav.pipeline.engine.prefix import (
    CachedPrefix,
    cached_prefix,
    following,
    frontier_of,
    keep_prefix,
    prefix_nodes,
)
from omninav.pipeline.files import Damaged, digest_text, locked, read_json, write_json
from omninav.pipeline.graph.graph import Graph, Node
from omninav.pipeline.graph.problems import BadInput
from omninav.pipeline.graph.results import Metrics
from omninav.pipeline.graph.value import Value
from omninav.pipeline.jobs.job import Send
from omninav.pipeline.jobs.job_progress import Heartbeat
from omninav.pipeline.report.metrics import metric_values
from omninav.pipeline.run.artifacts import Execution, obtain
from omninav.pipeline.run.prepared_run import PreparedArtifact, PreparedRun, prepare_run
from omninav.pipeline.run.run_folder import RunFolder
from omninav.pipeline.run.run_results import notes_of, results_of
from omninav.pipeline.run.timing import stage_times

SHARED = "shared"
"""The sequence that the first repetition writes for the others."""
BASE_SEED = 0
"""Seed of artifacts and whatever else the repetitions share."""


def measured(graph: Graph) -> Graph:
    """The part of a graph that its metrics depend on: repetitions need no plots."""
    origins = [
        f"{node.name}.{port.name}"
        for node in graph.nodes.values()
        for port in node.signature.outputs.values()
        if port.type is Metrics
    ]
    return graph.leading_to(origins)


def condition_key(prepared: PreparedRun, groups: Sequence[Sequence[str]] = ()) -> str:
    """The hash of everything but the seed that decides a condition's results. Its inputs must be there.

    `groups`: stages whose time together is among them.
    """
    graph = measured(prepared.graph)
    parts = [
        module_version(__name__),
        graph_digest(graph),
        *known_digests(graph),
        *("+".join(group) for group in groups),
    ]
    for artifact in prepared.artifacts:
        parts += [artifact.name, artifact_key(artifact)]
    return digest_text("condition", *parts)


def artifact_key(artifact: PreparedArtifact) -> str:
    """The hash of everything that decides an artifact's content. Its inputs must be there."""
    if artifact.graph is None:
        assert artifact.file is not None
        return artifact_digest(artifact.file)
    return digest_text("artifact", graph_digest(artifact.graph), artifact.origin, *known_digests(artifact.graph))


_DIGESTS: dict[str, str] = {}


def known_digests(graph: Graph) -> list[str]:
    """The content hashes of the files that a graph reads. Opening a long one takes seconds, so each is opened once."""
    found = []
    for node in graph.nodes.values():
        key = f"{node.target} {json.dumps(node.parameters, sort_keys=True, default=str)}"
        if key not in _DIGESTS:
            _DIGESTS[key] = node.stage.inputs_digest() or ""
        found.append(_DIGESTS[key])
    return [digest for digest in found if digest]


def finished(folder: Path, key: str, seeds: Sequence[int], cache: Cache | None = None) -> dict[int, dict[str, Any]]:
    """The results of a condition by seed: those in its folder that belong to this key, and those in the cache.

    Through the cache experiments share the conditions that they have in common. A file in the folder that is damaged,
    or belongs to another key, is replaced by what the cache has.
    """
    found = {}
    for seed in seeds:
        own, *others = _results(folder, key, seed, cache)
        for path in (own, *others):
            result = _read(path)
            if result.get("key") == key and result.get("seed") == seed:
                found[seed] = result
                if path != own and own.exists():
                    write_json(own, result)
                break
    return found


def _read(path: Path) -> dict[str, Any]:
    try:
        return read_json(path) if path.exists() else {}
    except Damaged as damaged:
        report_damage(f"{damaged}; it is taken from the cache, or runs again")
        return {}


def _results(folder: Path, key: str, seed: int, cache: Cache | None) -> list[Path]:
    """Path of a repetition's result."""
    kept = [] if cache is None else [cache.path(digest_text("repetition", key, str(seed)), ".json")]
    return [folder / f"seed_{seed}.json", *kept]


def repeat(given: Mapping[str, Any], send: Send) -> None:
    """Run a condition for some seeds, as a job; each one's result is a file, and its seed is sent when it is there.

    Without `shared` nothing but artifacts comes from the cache or from the repetition before, so that all is timed.

    `given`: `config` (plain; its artifacts are files by now), `folder` of the condition, `part` (a name of its own
    for this job), `key`, `code`, `seeds`, `shared`, `groups` (of stages whose time together is measured). Seeds whose
    results an earlier attempt left are not run again. Raises `BadInput` where the code has changed since the experiment
    was started.
    """
    part = Path(given["folder"]) / str(given["part"])
    with locked(part.with_name(f".{part.name}.lock")):  # a job whose experiment was killed lives on for a moment
        shutil.rmtree(part, ignore_errors=True)
        _repeat(given, RunFolder(part), send)
        shutil.rmtree(part, ignore_errors=True)


def _repeat(given: Mapping[str, Any], run: RunFolder, send: Send) -> None:
    folder = Path(given["folder"])
    prepared = prepare_run(given["config"])
    if prepared.digest != given["code"]:
        raise BadInput("the code has changed while the experiment ran; type the same command again")
    cache = Cache(Path(str(prepared.config["cache"]))) if prepared.config.get("cache") else None
    graph = measured(prepared.graph)
    known = finished(folder, given["key"], given["seeds"], cache if given["shared"] else None)
    for seed in known:
        send({"seed": seed})
    seeds = [seed for seed in given["seeds"] if seed not in known]
    if not seeds:
        return
    run.folder.mkdir(parents=True)
    execution = Execution(run, BASE_SEED, cache, math.inf, Heartbeat(send))
    artifacts: dict[str, Value] = {}
    facts: dict[str, Any] = {}
    for artifact in prepared.artifacts:
        artifacts[artifact.name], made = obtain(execution, artifact)
        facts[artifact.name] = made
        (run.folder / f"{artifact.name}.omap").unlink(missing_ok=True)  # the cache keeps it
    shared: PrefixReplay | None = None
    for number, seed in enumerate(seeds):
        place = run.memory / f"seed_{seed}"
        record = bool(given["shared"]) and shared is None and number + 1 < len(seeds)
        engine, recorded = run_repetition(
            graph, artifacts, seed, place, cache if given["shared"] else None, shared, record, send
        )
        shared = recorded or shared
        metrics = results_of(engine)[0]
        result = {"key": given["key"], "seed": seed, "metrics": metrics.values}
        stated = (each for each in metric_values(metrics).values() if each.metric.by_path)
        result["context"] = {each.head: each.text for each in stated if each.metric.spec.context}
        result["timing"] = stage_times(engine, given.get("groups") or ())
        result |= notes_of(engine)
        result["artifacts"] = facts
        for sequence in engine.sequences.values():
            sequence.close()
        if recorded is None:
            shutil.rmtree(place, ignore_errors=True)
        for path in _results(folder, given["key"], seed, cache if given["shared"] else None):
            write_json(path, result)
        send({"seed": seed})


def run_repetition(
    graph: Graph,
    artifacts: Mapping[str, Value],
    seed: int,
    place: Path,
    cache: Cache | None,
    shared: PrefixReplay | None,
    record: bool,
    send: Send,
) -> tuple[Engine, PrefixReplay | None]:
    """One repetition; with `record` also the prefix that the others may share. What grows in place is its own."""
    artifacts = {name: copy.deepcopy(value) if value.in_place else value for name, value in artifacts.items()}
    options = EngineOptions(seed, place, place, checkpoint_s=math.inf, on_tick=Heartbeat(send).step)
    if shared is not None:
        engine = Engine(graph, artifacts, options, replay=shared)
        engine.run()
        return engine, None
    with cached_prefix(graph, cache, seed) as prefix:
        wanted = _recordable(graph, prefix) if record else []
        recorded = prefix.recorded() | ({SHARED: wanted} if wanted else {})
        engine = Engine(graph, artifacts, options, replay=prefix.replay, recorded=recorded)
        engine.run()
        keep_prefix(engine, prefix, cache)
    # Only now is it known which stages draw random numbers: they and what follows from them are run every time.
    # What grows in place has grown by now: it starts again too.
    used_rng = [name for name, call in engine.calls.items() if call.ctx.used_rng]
    seeded = following(graph, [*used_rng, *(node.name for node in graph.of_lifetime("before") if _grows(node))])
    nodes = prefix_nodes(graph, artifacts=True, without=seeded)
    if not nodes or not set(frontier_of(graph, nodes)) <= set(wanted):
        return engine, None
    before = [node.name for node in graph.of_lifetime("before") if node.name not in seeded]
    notes = {name: engine.calls[name].ctx.notes() for name in sorted(nodes | set(before))}
    engine.sequences.pop(SHARED).flush()
    given = {origin: value for origin, value in engine.values.items() if origin.partition(".")[0] in before}
    ticks = DiskSequence(place / f"{SHARED}.sequence", append=False)
    return engine, PrefixReplay(nodes | frozenset(before), ticks, notes, given)


def _grows(node: Node) -> bool:
    return any(getattr(port.type, "in_place", False) for port in node.signature.outputs.values())


def _recordable(graph: Graph, known: CachedPrefix) -> list[str]:
    """Names that may have to be shared: all that nodes read of the prefix, but what is too large to keep over a log.

    Of the part that comes from the cache there is only its frontier.
    """
    nodes = prefix_nodes(graph, artifacts=True)
    inside = known.nodes if known.replay is not None else frozenset()
    read = {wire.origin for wire in graph.wires if wire.from_node in nodes - inside} | graph.reported(nodes - inside)
    small = {origin for origin in read if not graph.is_marked(origin, "bulky")}
    tick = {f"{graph.source.name}.tick"} if graph.source is not None else set()
    return sorted(small | tick | set(known.frontier if inside else ()))
