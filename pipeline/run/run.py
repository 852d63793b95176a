"""A run: its folder, its manifest, its artifacts, its engine, and the files that are left at the end."""

import importlib.metadata
import json
import logging
import os
import platform
import shutil
import subprocess
import traceback
from collections.abc import Collection, Container, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

import yaml

from omninav.pipeline.engine.artifact import Cache, read_artifact, read_header, write_artifact
from omninav.pipeline.engine.engine import Engine, StageFailed
from omninav.pipeline.engine.prefix import CachedPrefix, cached_front, keep, lineage, seeded
from omninav.pipeline.files import digest_file, digest_text, write_whole
from omninav.pipeline.graph.graph import ARTIFACTS, Graph, build
from omninav.pipeline.graph.problems import BadInput, Problem, ProblemsFound, suggest
from omninav.pipeline.graph.registry import UnknownStage, entries, resolve
from omninav.pipeline.graph.results import Figure, Metrics, Table, merged
from omninav.pipeline.graph.value import VALUE_TYPES, Value

from .metrics_files import read_metrics, write_metrics

LIBRARIES = ("numpy", "scipy", "opencv-python-headless", "numba", "networkx", "hydra-core", "mcap", "rosbags")
log = logging.getLogger("omninav")


@dataclass(frozen=True)
class ArtifactPlan:
    """Where an artifact comes from: a file, or a graph whose output `origin` is taken.

    `graph` is the part of the `whole` that this output depends on.
    """

    name: str
    file: Path | None = None
    graph: Graph | None = None
    origin: str = ""
    variant: str = ""
    whole: Graph | None = None


@dataclass(frozen=True)
class Plan:
    """A configuration that has been checked: the graph, its artifacts, and what is to be saved."""

    config: Mapping[str, Any]
    graph: Graph
    artifacts: tuple[ArtifactPlan, ...]
    saves: Mapping[str, str]

    @property
    def variant(self) -> str:
        """The variant's name."""
        return str(self.config.get("variant"))

    @property
    def seed(self) -> int:
        """The run's seed."""
        return int(self.config.get("seed", 0))


def plan(config: Mapping[str, Any]) -> Plan:
    """Check a plain, resolved configuration. Raises `ProblemsFound` with everything that is wrong with it."""
    problems: list[Problem] = []
    artifacts: list[ArtifactPlan] = []
    types: dict[str, Any] = {}
    config = without_absent(config)
    _load_stages(config)
    for key in ("seed",):
        if not isinstance(config.get(key, 0), int) or isinstance(config.get(key, 0), bool) or config.get(key, 0) < 0:
            problems.append(Problem(key, f"{config.get(key)!r}, expected a whole number >= 0", f"type {key}=0"))
    for name, spec in (config.get("artifacts") or {}).items():
        try:
            made = _plan_artifact(str(name), spec)
        except ProblemsFound as found:
            problems += found.problems
            types[str(name)] = Any
            continue
        artifacts.append(made)
        if made.graph is not None:
            port = made.graph.port(made.origin)
            types[made.name] = port.type if port else Any
        elif made.file is not None:
            types[made.name] = VALUE_TYPES.get(read_header(made.file)["type"], Any)
    graph: Graph | None = None
    try:
        graph = build(config, types)
    except ProblemsFound as found:
        problems += found.problems
    for made in artifacts if graph is not None else ():
        if made.file is not None and graph is not None:
            alike = config["artifacts"][made.name].get("alike") or ()
            problems += unlike(made.name, read_header(made.file)["facts"].get("stages") or {}, graph, alike)
    saves = config.get("saves") or {}
    for name, origin in saves.items() if graph is not None else ():
        port = graph.port(str(origin)) if graph is not None else None
        if port is None:
            outputs = [f"{n.name}.{p}" for n in graph.nodes.values() for p in n.signature.outputs] if graph else []
            problems.append(
                Problem(f"saves.{name}", f"there is no output '{origin}'", suggest(str(origin), outputs, "outputs"))
            )
    if problems or graph is None:
        raise ProblemsFound(dict.fromkeys(problems))
    return Plan(config, graph, tuple(artifacts), saves)


def without_absent(config: Mapping[str, Any]) -> Mapping[str, Any]:
    """A configuration without its artifacts that are `optional` and not given, and without the wires from them.

    One that comes `with` another is given wherever that one is made. A port that cannot do without its wire is then a
    problem like every missing wire.
    """
    specs = config.get("artifacts") or {}
    absent = {
        f"{ARTIFACTS}.{name}"
        for name, spec in specs.items()
        if isinstance(spec, Mapping)
        and spec.get("optional")
        and spec.get("file") is None
        and spec.get("log") is None
        and not _is_made(specs.get(spec.get("with")))
    }
    return _without(config, absent)


def without_companions(config: Mapping[str, Any]) -> Mapping[str, Any]:
    """A configuration without the artifacts that come `with` others: they are for pictures, which not all runs need."""
    specs = config.get("artifacts") or {}
    beside = {f"{ARTIFACTS}.{name}" for name, spec in specs.items() if isinstance(spec, Mapping) and spec.get("with")}
    return _without(config, beside)


def _without(config: Mapping[str, Any], absent: Collection[str]) -> Mapping[str, Any]:
    if not absent:
        return config
    specs = config.get("artifacts") or {}
    kept = {name: spec for name, spec in specs.items() if f"{ARTIFACTS}.{name}" not in absent}
    wires = {
        node: {port: wire for port, wire in ports.items() if _origin(wire) not in absent}
        if isinstance(ports, Mapping)
        else ports
        for node, ports in (config.get("wires") or {}).items()
    }
    return {**config, "artifacts": kept, "wires": wires}


def _is_made(spec: Any) -> bool:
    return isinstance(spec, Mapping) and spec.get("variant") is not None and spec.get("file") is None


def _origin(wire: Any) -> Any:
    return wire.get("from") if isinstance(wire, Mapping) else wire


def _load_stages(config: Mapping[str, Any]) -> None:
    """Import the stages' modules, so that the value types which a map file may hold are known."""
    for spec in (config.get("nodes") or {}).values():
        if isinstance(spec, Mapping) and isinstance(spec.get("_target_"), str):
            with suppress(UnknownStage):  # said by `build`
                resolve(spec["_target_"])


def _plan_artifact(name: str, spec: Any) -> ArtifactPlan:
    where = f"artifacts.{name}"
    if not isinstance(spec, Mapping):
        raise ProblemsFound([Problem(where, "expected a mapping with `variant` or `file`")])
    if spec.get("file") is not None:
        file = Path(str(spec["file"]))
        try:
            read_header(file)
        except BadInput as error:
            raise ProblemsFound(
                [Problem(name, str(error), f"type {name}=FILE.omap, or tour=LOG to make one")]
            ) from None
        return ArtifactPlan(name, file=file)
    if spec.get("graph") is None:
        hint = f"type tour=LOG to learn one with '{spec.get('variant')}', or {name}=FILE.omap to load one"
        raise ProblemsFound([Problem(name, f"this variant needs a {name}, and none is given", hint)])
    graph = build(spec["graph"], prefix=f"{where}.", shared=spec.get("share") or ())
    origin = str(spec.get("from") or (spec["graph"].get("saves") or {}).get(name, ""))
    if graph.port(origin) is None:
        outputs = [f"{n.name}.{p}" for n in graph.nodes.values() for p in n.signature.outputs]
        raise ProblemsFound(
            [Problem(f"{where}.from", f"there is no output '{origin}'", suggest(origin, outputs, "outputs"))]
        )
    return ArtifactPlan(name, None, graph.leading_to([origin]), origin, str(spec.get("variant")), graph)


def stages_of(graph: Graph) -> dict[str, Any]:
    """Class and parameters of every node but the source, as plain data: what a file says of the graph that made it."""
    found = {}
    for node in graph.nodes.values():
        if not node.signature.is_source:
            parameters = {name: getattr(node.stage, name) for name in node.signature.parameters}
            found[node.name] = {"_target_": node.target, **json.loads(json.dumps(parameters, default=str))}
    return found


def unlike(name: str, made_by: Mapping[str, Any], graph: Graph, alike: Sequence[str]) -> Iterator[Problem]:
    """Where an artifact's file was made by other stages than this graph has, among the nodes that must be alike.

    `made_by` is what `stages_of` gave then. What it does not know (an older file) is not compared.
    """
    present = stages_of(graph)
    for node in alike:
        then, now = made_by.get(node), present.get(node)
        if then is None or now is None:
            continue
        again = "or leave map=FILE away, and it is learned anew"
        before, after = (spec["_target_"].replace(":", ".").rpartition(".")[2] for spec in (then, now))
        if before != after:
            what = f"it was made with {before} as '{node}', and this run has {after}"
            same = next((entry for entry in entries() if entry.target == then["_target_"]), None)
            use = f"type {same.name.replace('.', '=', 1)}" if same else f"give that stage: {then['_target_']}"
            yield Problem(name, what, f"{use}, {again}")
            continue
        for key in [key for key in then if key in now and key != "_target_" and then[key] != now[key]]:
            what = f"it was made with nodes.{node}.{key}={then[key]}, and this run has {now[key]}"
            yield Problem(name, what, f"type nodes.{node}.{key}={then[key]}, {again}")


@dataclass
class Run:
    """A run folder with its manifest, which is written at the start and completed at the end."""

    folder: Path
    manifest: dict[str, Any] = field(default_factory=dict)

    def save(self) -> None:
        """Write the manifest as it stands."""
        write_whole(self.folder / "manifest.json", json.dumps(self.manifest, indent=1, default=str) + "\n")

    @property
    def memory(self) -> Path:
        """Where checkpoints and spools lie."""
        return self.folder / "checkpoints"


def start(planned: Plan, argv: Sequence[str], folder: Path | None = None) -> Run:
    """Make the run's folder with config, graph and manifest. `folder` is given by a sweep, else made from the date.

    The latter appears under its name when all that a resume needs is in it: a run that can be seen can be gone on with.
    """
    config = planned.config
    inputs = input_digests(planned)
    root, named = Path(str(config.get("runs", "runs"))), f"{datetime.now():%Y-%m-%d_%H-%M-%S}_{planned.variant}"
    beginning = root / f".{named}.{os.getpid()}.part" if folder is None else folder
    beginning.mkdir(parents=True, exist_ok=True)
    run = Run(beginning)
    run.manifest = {
        "omninav": version("omninav"),
        "status": "running",
        "variant": planned.variant,
        "argv": list(argv),
        "cwd": os.getcwd(),
        "started": datetime.now().isoformat(timespec="seconds"),
        "git_commit": git_commit(),
        "graph": planned.graph.digest(),
        "inputs": inputs,
        "seed": planned.seed,
        "python": platform.python_version(),
        "libraries": {name: version(name) for name in LIBRARIES},
    }
    write_whole(beginning / "config.yaml", yaml.safe_dump(dict(config), sort_keys=False, allow_unicode=True, width=120))
    from omninav.pipeline.report.graph_svg import svg  # drawing is not needed to start the command line
    from omninav.pipeline.report.mermaid import mermaid

    write_whole(beginning / "graph.svg", svg(planned.graph))
    write_whole(beginning / "graph.mmd", mermaid(planned.graph))
    run.save()
    if folder is None:
        run.folder = _named(beginning, root, named)
        _point_latest(run.folder)
    return run


def execute(run: Run, planned: Plan, progress: Any = None) -> Metrics:
    """Run a planned configuration in its folder, from its start or from where it was left, and return its metrics.

    Raises `StageFailed` or `BadInput`; by then the manifest says so and the traceback is in `run.log`.
    """
    with _logged(run):
        try:
            return _execute(run, planned, progress)
        except KeyboardInterrupt:
            _fail(run, "interrupted", "stopped by the user")
            raise
        except Exception as error:
            _fail(
                run,
                "failed",
                str(error) if isinstance(error, StageFailed | BadInput) else f"{type(error).__name__}: {error}",
            )
            raise


def _execute(run: Run, planned: Plan, progress: Any) -> Metrics:
    config, seed = planned.config, planned.seed
    cache = Cache(Path(str(config["cache"]))) if config.get("cache") else None
    every_s = float(config.get("checkpoint_s", 5.0))
    artifacts: dict[str, Value] = {}
    made: dict[str, Any] = {}
    for artifact in planned.artifacts:
        beside = _of_one_run(artifact, planned.artifacts)
        artifacts[artifact.name], made[artifact.name] = obtain(run, artifact, seed, cache, every_s, progress, beside)
    run.manifest["artifacts"] = made
    run.save()
    identity = _identity(planned.graph, seed, *(fact["sha256"] for fact in made.values()))
    wanted = sorted(set(planned.saves.values()))
    with cached_front(planned.graph, cache, seed) as front:
        engine = Engine(
            planned.graph,
            artifacts,
            seed,
            run.folder,
            run.memory,
            wanted,
            identity,
            every_s,
            usable(front),
            _stepper(progress, planned.variant),
        )
        last = engine.run()
        keep_front(engine, front, cache, seed)
    for name, origin in planned.saves.items():
        value = last[origin]
        if isinstance(value, Value):
            file = run.folder / f"{name}.omap"
            write_artifact(file, value, _provenance(planned.graph.leading_to([origin]), engine, planned.variant))
            saved = {"file": file.name, "bytes": file.stat().st_size, "sha256": digest_file(file)}
            run.manifest.setdefault("saved", {})[name] = saved
    return _finish(run, planned, engine, front)


def _of_one_run(artifact: ArtifactPlan, artifacts: Sequence[ArtifactPlan]) -> list[ArtifactPlan]:
    """The other artifacts that are outputs of the same graph: one run makes them all."""
    if artifact.whole is None:
        return []
    same = artifact.whole.digest()
    others = [other for other in artifacts if other is not artifact and other.whole is not None]
    return [other for other in others if other.whole is not None and other.whole.digest() == same]


def obtain(
    run: Run,
    artifact: ArtifactPlan,
    seed: int,
    cache: Cache | None,
    every_s: float,
    progress: Any,
    beside: Sequence[ArtifactPlan] = (),
) -> tuple[Value, dict[str, Any]]:
    """The artifact's value, from its file, the cache or its graph's run, with what the manifest says of it.

    Where its graph has to run, what else that gives (`beside`) is put into the cache too.
    """
    target = run.folder / f"{artifact.name}.omap"
    if artifact.file is not None:
        value = read_artifact(artifact.file)
        shutil.copyfile(artifact.file, target)
        loaded = {"file": str(artifact.file), "sha256": digest_file(target), "said": "loaded from a file"}
        return value, {**loaded, **read_header(artifact.file)["facts"]}
    graph = artifact.graph
    assert graph is not None
    place = cache or Cache(run.memory / "artifacts")
    key = _key(artifact)
    with place.lock(key):
        found = next((path for k in (key, seeded(key, seed)) if (path := place.path(k, ".omap")).exists()), None)
        said = "found: the same graph over the same log had made it before"
        if found is None:
            said = "made: code, parameters or log are new to the cache"
            for each, value, header, drew in _make(run, [artifact, *beside], seed, cache, every_s, progress):
                own = _key(each)
                path = place.path(seeded(own, seed) if drew else own, ".omap")
                write_artifact(path, value, header)
                found = found or path  # the first is the one that is wanted
        assert found is not None
    value = read_artifact(found)
    shutil.copyfile(found, target)
    facts = read_header(found)["facts"]
    return value, {
        "variant": artifact.variant,
        "from": artifact.origin,
        "sha256": digest_file(target),
        "said": said,
        **facts,
    }


def _key(artifact: ArtifactPlan) -> str:
    assert artifact.graph is not None
    return digest_text("artifact", artifact.graph.digest(), artifact.origin, *digests_of(artifact.graph).values())


def _make(
    run: Run, wanted: Sequence[ArtifactPlan], seed: int, cache: Cache | None, every_s: float, progress: Any
) -> Iterator[tuple[ArtifactPlan, Value, dict[str, Any], bool]]:
    """Run the graph of some artifacts; of each that it gave: value, header, and whether random numbers decided it."""
    artifact, origins = wanted[0], [each.origin for each in wanted]
    graph = artifact.graph if len(wanted) == 1 or artifact.whole is None else artifact.whole.leading_to(origins)
    assert graph is not None
    memory = run.memory / artifact.name
    with cached_front(graph, cache, seed) as front:
        identity = _identity(graph, seed)
        engine = Engine(
            graph,
            {},
            seed,
            None,
            memory,
            origins,
            identity,
            every_s,
            usable(front),
            _stepper(progress, artifact.variant),
        )
        values = engine.run()
        keep_front(engine, front, cache, seed)
    if not isinstance(values[artifact.origin], Value):
        raise BadInput(
            f"'{artifact.variant}' ran to its end and gave no {artifact.name}: was there anything usable in its log?"
        )
    for each in wanted:
        value = values[each.origin]
        if isinstance(value, Value) and each.graph is not None:
            drew = any(engine.calls[name].ctx.drew for name in each.graph.nodes)
            yield each, value, _provenance(each.graph, engine, each.variant), drew


def _provenance(graph: Graph, engine: Engine, variant: str) -> dict[str, Any]:
    """How an artifact was made, for its file's header: what was dropped and stated, the variant, and its stages."""
    return {**notes_of(engine, graph.nodes), "variant": variant, "stages": stages_of(graph)}


def usable(front: CachedPrefix | None) -> CachedPrefix | None:
    """A front that is found or may be recorded; None where it is too large to keep."""
    return front if front is not None and front.key else None


def keep_front(engine: Engine, front: CachedPrefix | None, cache: Cache | None, seed: int) -> None:
    """Put the front that an engine recorded into the cache, where it was not found there."""
    if cache is not None and front is not None and front.key and front.replay is None:
        spool = engine.spools["front"]
        spool.flush()
        names = sorted(lineage(engine.graph, front.nodes))
        keep(front, cache, seed, spool.path, {name: engine.calls[name].ctx.notes() for name in names})


def notes_of(engine: Engine, only: Container[str] | None = None) -> dict[str, Any]:
    """What the stages, or only these, counted and stated, as the manifest holds it."""
    dropped: dict[str, Any] = {}
    facts: dict[str, Any] = {}
    for name, call in engine.calls.items():
        if only is not None and name not in only:
            continue
        for kind, number in call.ctx.counts.items():
            dropped[kind if "." in kind else f"{name}.{kind}"] = {
                "count": number,
                "first": call.ctx.details.get(kind, ""),
            }
        facts |= call.ctx.facts
    return {"dropped": dropped, "facts": facts}


def _finish(run: Run, planned: Plan, engine: Engine, front: CachedPrefix | None) -> Metrics:
    from omninav.pipeline.report.run_page import write_report

    metrics, figures, tables = results_of(engine)
    notes = notes_of(engine)
    timing = stage_times(engine)
    write_metrics(run.folder, metrics)
    write_whole(run.folder / "timing.json", json.dumps(timing, indent=1) + "\n")
    run.manifest |= {
        "ended": datetime.now().isoformat(timespec="seconds"),
        "ticks": engine.ticks,
        "dropped": notes["dropped"],
        "facts": {
            **{k: v for a in run.manifest["artifacts"].values() for k, v in _map_facts(a).items()},
            **notes["facts"],
        },
        "front": front.said
        if front is not None
        else "not cached: this graph has no front that follows from its log alone",
    }
    for kind, entry in notes["dropped"].items():
        log.warning("%s: %s%s", kind, entry["count"], f" (first: {entry['first']})" if entry["first"] else "")
    graph_svg, config_yaml = (run.folder / "graph.svg").read_text(), (run.folder / "config.yaml").read_text()
    done = {**run.manifest, "status": "complete"}
    write_report(run.folder, done, metrics, timing, graph_svg, figures, tables, config_yaml)
    run.manifest = done
    run.save()
    for spool in engine.spools.values():
        spool.close()
    shutil.rmtree(run.memory, ignore_errors=True)
    return metrics


def results_of(engine: Engine) -> tuple[Metrics, list[Figure], list[Table]]:
    """What the stages of a graph that has run gave as results: metrics merged into one, figures, tables."""
    metrics: list[Metrics] = []
    figures: list[Figure] = []
    tables: list[Table] = []
    for node in engine.graph.nodes.values():
        for port in node.signature.outputs:
            origin = f"{node.name}.{port}"
            for value in _flat(engine.values.get(f"{origin}#held", engine.values.get(origin))):
                if isinstance(value, Metrics):
                    metrics.append(value)
                elif isinstance(value, Figure):
                    figures.append(value)
                elif isinstance(value, Table):
                    tables.append(value)
    return merged(metrics), figures, tables


def _map_facts(artifact: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{key} (map)": value for key, value in (artifact.get("facts") or {}).items()}


def _flat(value: Any) -> Iterator[Any]:
    if isinstance(value, tuple | list):
        for item in value:
            yield from _flat(item)
    elif value is not None:
        yield value


def stage_times(engine: Engine, groups: Sequence[Sequence[str]] = ()) -> dict[str, Any]:
    """Median, 95th percentile and maximum per stage in milliseconds, and the loop's ticks per second.

    `step` is the same of what all stages but the source took together, tick by tick; `together` that of each group of
    stages, its names joined by `+`, where every one of them has run.
    """
    import numpy as np

    times = {name: np.asarray(call.times) * 1e3 for name, call in engine.calls.items()}
    ran = {name: took for name, took in times.items() if np.isfinite(took).any()}
    ticking = [node for node in engine.graph.of_lifetime("tick") if node.name in ran]
    behind = [node.name for node in ticking if not node.signature.is_source]
    stages = {
        name: {"lifetime": engine.calls[name].node.lifetime, "calls": int(np.isfinite(took).sum())} | _spread_ms(took)
        for name, took in ran.items()
    }
    per_tick = sum(float(np.nanmean(ran[node.name])) for node in ticking)
    return {
        "ticks": engine.ticks,
        "ticks_per_second": 1e3 / per_tick if per_tick else None,
        "step": _spread_ms(np.nansum([ran[name] for name in behind], axis=0)) if behind else None,
        "together": {
            "+".join(group): _spread_ms(np.nansum([ran[name] for name in group], axis=0))
            for group in groups
            if set(group) <= set(behind)
        },
        "stages": stages,
    }


def _spread_ms(times: Any) -> dict[str, float]:
    import numpy as np

    p50, p95 = np.nanpercentile(times, [50, 95])
    return {"p50_ms": float(p50), "p95_ms": float(p95), "max_ms": float(np.nanmax(times))}


def status(folder: Path) -> str | None:
    """What a run folder's manifest says of the run (`running`, `complete`, `failed`, …); None where there is none."""
    file = folder / "manifest.json"
    return str(json.loads(file.read_text()).get("status")) if file.is_file() else None


def resume(folder: Path, progress: Any = None) -> tuple[Run, Metrics]:
    """Go on with a run that was stopped, from its last checkpoint, to the bytes it would have given unbroken."""
    manifest_file, config_file = folder / "manifest.json", folder / "config.yaml"
    if not manifest_file.is_file() or not config_file.is_file():
        raise BadInput(f"{folder}: not a run folder (no manifest.json and config.yaml); `ls runs` shows what there is")
    run = Run(folder.resolve(), json.loads(manifest_file.read_text()))
    for half_written in folder.glob("*.part"):  # by the process that was killed; it is written anew
        half_written.unlink()
    if run.manifest["status"] == "complete":
        shutil.rmtree(run.memory, ignore_errors=True)
        return run, read_metrics(folder)
    if Path(run.manifest["cwd"]).is_dir():
        os.chdir(run.manifest["cwd"])  # its paths are relative to where it was started
    planned = plan(yaml.safe_load(config_file.read_text()))
    inputs = input_digests(planned)
    changed = [name for name, digest in inputs.items() if run.manifest["inputs"].get(name) != digest]
    if changed:
        raise BadInput(f"{folder}: {', '.join(changed)} changed since the run was started; start a new run")
    run.manifest["status"] = "running"
    run.manifest.pop("error", None)
    run.save()
    return run, execute(run, planned, progress)


def input_digests(planned: Plan) -> dict[str, str]:
    """The content hash of every file that the run reads, by node. Raises `BadInput` where one cannot be read."""
    digests = digests_of(planned.graph)
    for artifact in planned.artifacts:
        if artifact.graph is not None:
            digests |= {f"{artifact.name}.{name}": digest for name, digest in digests_of(artifact.graph).items()}
        elif artifact.file is not None:
            digests[artifact.name] = digest_file(artifact.file)
    return digests


def digests_of(graph: Graph) -> dict[str, str]:
    """The content hash of the files that each node of a graph reads, where it reads any."""
    found = {node.name: node.stage.inputs_digest() for node in graph.nodes.values()}
    return {name: digest for name, digest in found.items() if digest is not None}


def _identity(graph: Graph, seed: int, *more: str) -> str:
    return digest_text(graph.digest(), str(seed), *digests_of(graph).values(), *more)


def _stepper(progress: Any, name: str) -> Any:
    if progress is None:
        return lambda done, total: None
    return lambda done, total: progress.update(name, done, total)


def _fail(run: Run, status: str, what: str) -> None:
    run.manifest |= {"status": status, "error": what, "ended": datetime.now().isoformat(timespec="seconds")}
    run.save()
    log.error("%s\n%s", what, traceback.format_exc())


@contextmanager
def _logged(run: Run) -> Iterator[None]:
    handler = logging.FileHandler(run.folder / "run.log", encoding="utf-8")
    handler.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(message)s"))
    log.addHandler(handler)
    log.setLevel(logging.INFO)
    log.propagate = False
    log.disabled = False  # Hydra's logging set-up silences loggers that were there before it
    try:
        log.info("omninav %s", " ".join(run.manifest["argv"][1:]) or "(the embedded default)")
        yield
        log.info("complete: %s ticks", run.manifest.get("ticks"))
    finally:
        log.removeHandler(handler)
        handler.close()


def _named(folder: Path, root: Path, name: str) -> Path:
    """The folder under a name that no other has (two runs may start in the same second)."""
    for number in range(1, 1000):
        target = root / (name if number == 1 else f"{name}_{number}")
        try:
            return folder.rename(target)
        except OSError as taken:  # by a folder with something in it
            if not target.exists():
                raise BadInput(f"{target}: {taken.strerror}; give another folder: runs=FOLDER") from None
    raise BadInput(f"{root}: more than 1000 runs named {name}")


def _point_latest(folder: Path) -> None:
    link = folder.parent / "latest"
    part = folder.parent / f".latest.{os.getpid()}"
    try:
        part.unlink(missing_ok=True)
        part.symlink_to(folder.name)
        os.replace(part, link)
    except OSError:  # a file system without links, or a folder of that name: the run does not need it
        part.unlink(missing_ok=True)


def version(distribution: str) -> str:
    """The installed version of a distribution, or that there is none."""
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return "not installed"


def git_commit() -> str | None:
    """The commit of omninav's own checkout, with a mark where files differ from it; None where there is none."""
    here = Path(__file__).resolve().parent
    try:
        asked = subprocess.run(
            ["git", "describe", "--always", "--dirty", "--abbrev=40"],
            cwd=here,
            capture_output=True,
            text=True,
            timeout=5,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return asked.stdout.strip() or None if asked.returncode == 0 else None
