"""A run, prepared and checked: the graph, where its artifacts come from, and what is to be saved."""

import json
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omninav.pipeline.engine.artifact import OWN_PACKAGE, artifact_digest, check_artifact, type_and_facts
from omninav.pipeline.engine.code_version import graph_digest
from omninav.pipeline.graph.builder import build
from omninav.pipeline.graph.graph import ARTIFACTS, Graph, Node
from omninav.pipeline.graph.ports import convert, type_name
from omninav.pipeline.graph.problems import BadInput, Problem, ProblemsFound, suggest
from omninav.pipeline.graph.registry import UnknownStage, entries, resolve

from .artifact_specification import ArtifactSpecification, read_specifications, without_absent
from .inputs import refuse_missing
from .plot_selection import PLOTS, with_plots


@dataclass(frozen=True)
class PreparedArtifact:
    """Origin of an artifact: a file, or a graph whose output `origin` is taken, and the type of its value.

    `graph` is the part of the `whole` that this output depends on.
    """

    name: str
    file: Path | None = None
    graph: Graph | None = None
    origin: str = ""
    variant: str = ""
    whole: Graph | None = None
    type: Any = Any
    made_by: Mapping[str, Any] = field(default_factory=dict)
    """The stages that made its file, as `stages_of` gives them."""


@dataclass(frozen=True)
class PreparedRun:
    """A checked configuration: the graph, its artifacts, and what is to be saved."""

    config: Mapping[str, Any]
    graph: Graph
    artifacts: tuple[PreparedArtifact, ...]
    saves: Mapping[str, str]
    record: tuple[str, ...] = ()
    """Outputs (`node.port`) whose value of every tick is kept in the run's folder."""

    @property
    def variant(self) -> str:
        """The variant's name."""
        return str(self.config.get("variant"))

    @property
    def seed(self) -> int:
        """The run's seed."""
        return int(self.config.get("seed", 0))

    @property
    def digest(self) -> str:
        """A hash over the graph's code, parameters and wires."""
        return graph_digest(self.graph)


Prepare = Callable[[Mapping[str, Any]], PreparedRun]
"""Prepares a run of a plain, resolved configuration."""


def prepare_run(config: Mapping[str, Any]) -> PreparedRun:
    """Check a plain, resolved configuration. Raises `ProblemsFound` with everything that is wrong with it."""
    problems: list[Problem] = []
    artifacts: list[PreparedArtifact] = []
    types: dict[str, Any] = {}
    config = without_absent(config)
    specs = read_specifications(config)
    load_stages(config)
    seed = config.get("seed", 0)
    if not isinstance(seed, int) or isinstance(seed, bool) or seed < 0:
        whole = int(seed) if isinstance(seed, float) and seed >= 0 and seed.is_integer() else 0
        problems.append(Problem("seed", f"{seed!r}, expected a whole number >= 0", f"type seed={whole}"))
    for name, spec in specs.items():
        try:
            alike = (one.whole for one in artifacts if one.whole is not None and specs[one.name].graph == spec.graph)
            made = _prepare_artifact(name, spec, next(alike, None))
        except ProblemsFound as found:
            problems += found.problems
            types[name] = Any
            continue
        artifacts.append(made)
        types[name] = made.type
    graph: Graph | None = None
    try:
        graph = build(config, types)
    except ProblemsFound as found:
        problems += found.problems
        for made in artifacts:
            problems = _of_one_file(problems, made, specs[made.name])
    saves = config.get("saves") or {}
    plots = config.get("plots", PLOTS[0])
    if plots not in PLOTS:
        problems.append(Problem("plots", f"{plots!r:.40}, expected {', '.join(PLOTS)}", f"type plots={PLOTS[0]}"))
    if graph is not None:
        for made in artifacts:
            problems += mismatches(made.name, made.made_by, graph, specs[made.name].must_match)
        for name, origin in saves.items():
            if graph.port(str(origin)) is None:
                problems.append(_no_output(f"saves.{name}", str(origin), graph))
        problems += _unrecordable(graph, config.get("record") or ())
    if problems or graph is None:
        raise ProblemsFound(_once([*_unreadable_inputs(graph), *problems]))
    record = tuple(dict.fromkeys(config.get("record") or ()))
    graph = with_plots(graph, plots, [str(origin).partition(".")[0] for origin in (*saves.values(), *record)])
    read = {origin for wire in graph.wires for origin in wire.origins}
    artifacts = [made for made in artifacts if f"{ARTIFACTS}.{made.name}" in read or specs[made.name].required]
    artifacts.sort(key=lambda made: not specs[made.name].required)  # what comes with another one follows it
    return PreparedRun(config, graph, tuple(artifacts), saves, record)


def _of_one_file(problems: list[Problem], made: PreparedArtifact, spec: ArtifactSpecification) -> list[Problem]:
    """Problems, those of all inputs that cannot take an artifact's file as one: another variant has made it."""
    of_it = [each for each in problems if each.what.startswith(f"{ARTIFACTS}.{made.name} is of type ")]
    if made.file is None or len(of_it) < 2:
        return problems
    what = f"{made.file} holds {type_name(made.type)}, which {len(of_it)} inputs of this variant cannot take"
    maker = made.variant.removesuffix(f"_{made.name}")
    hint = f"variant={maker} has made it; type that variant, or {_how_to_get(made.name, spec)}"
    return [*(each for each in problems if each not in of_it), Problem(made.name, what, hint)]


def _unreadable_inputs(graph: Graph | None) -> Iterator[Problem]:
    """Problems of inputs that a graph with other problems cannot read: a misspelled name is reported first."""
    try:
        if graph is not None and graph.source is not None:
            graph.source.stage.inputs_digest()
    except BadInput as error:
        where, _, what = str(error).partition(": ")
        yield Problem(where, what)


def _once(problems: Sequence[Problem]) -> Iterable[Problem]:
    """Each problem once: a setting that this graph shares with those of its artifacts is wrong in all of them."""
    found: dict[tuple[str, str], Problem] = {}
    for problem in sorted(problems, key=lambda problem: problem.where.startswith(f"{ARTIFACTS}.")):
        found.setdefault((re.sub(rf"^{ARTIFACTS}\.[^.]+\.", "", problem.where), problem.what), problem)
    return found.values()


def _unrecordable(graph: Graph, origins: Any) -> Iterator[Problem]:
    origins, problems = convert(origins, tuple[str, ...], "record")
    yield from problems
    for origin in () if problems else origins:
        if graph.port(origin) is None or graph.nodes[origin.partition(".")[0]].lifetime != "tick":
            outputs = [output for node in graph.of_lifetime("tick") for output in node.origins]
            yield Problem("record", f"there is no output '{origin}' in the loop", suggest(origin, outputs, "outputs"))
        elif graph.is_marked(origin, "in_place"):
            yield Problem("record", f"'{origin}' is updated in place, and kept at the end only", "leave it out")


def _no_output(where: str, origin: str, graph: Graph) -> Problem:
    outputs = [output for node in graph.nodes.values() for output in node.origins]
    return Problem(where, f"there is no output '{origin}'", suggest(origin, outputs, "outputs"))


def load_stages(config: Mapping[str, Any]) -> None:
    """Import the stages' modules, so that the value types which a file may hold are known."""
    nodes = config.get("nodes")
    for spec in nodes.values() if isinstance(nodes, Mapping) else ():
        if isinstance(spec, Mapping) and isinstance(spec.get("_target_"), str):
            with suppress(UnknownStage):  # reported by `build`
                resolve(spec["_target_"])


def _prepare_artifact(name: str, spec: ArtifactSpecification, graph: Graph | None) -> PreparedArtifact:
    """Origin of an artifact. `graph`: that makes it, where another has it: so its log is opened once."""
    if spec.file is not None:
        file = Path(spec.file)
        try:
            kind, facts = type_and_facts(file)
        except BadInput as error:
            hint = _how_to_get(name, spec)
            if file.is_file() and file.suffix != ".omap" and spec.made_from:
                hint = f"if it is what a {name} is made from, type {spec.made_from[0]}={spec.file}; else {hint}"
            raise ProblemsFound([Problem(name, str(error), hint)]) from None
        maker, stages = str(facts.get("variant", "")), facts.get("stages", {})
        return PreparedArtifact(name, file, variant=maker, type=kind, made_by=stages)
    if spec.graph is None:
        what = f"this variant needs a {name}, and none is given"
        raise ProblemsFound([Problem(name, what, _how_to_get(name, spec))])
    where = f"artifacts.{name}"
    graph = graph or build(spec.graph, prefix=f"{where}.", shared=spec.inherit)
    origin = spec.output or str((spec.graph.get("saves") or {}).get(name, ""))
    port = graph.port(origin)
    if port is None:
        raise ProblemsFound([_no_output(f"{where}.output", origin, graph)])
    return PreparedArtifact(name, None, graph.leading_to([origin]), origin, str(spec.variant), graph, port.type)


def _how_to_get(name: str, spec: ArtifactSpecification) -> str:
    give = " ".join(f"{setting}=…" for setting in spec.made_from)
    if spec.together_with is not None:
        both = f"; or {give} in place of {spec.together_with}=FILE, which makes both" if give else ""
        return f"type {name}=FILE.omap too, which was saved beside {spec.together_with}=FILE{both}"
    make = f"type {give} to make one, or " if give else "type "
    return f"{make}{name}=FILE.omap to load one"


def stages_of(graph: Graph) -> dict[str, Any]:
    """Class and parameters of every node but the source, as plain data: how a file describes the graph that made it."""
    found = {}
    for node in graph.nodes.values():
        if not node.signature.is_source:
            parameters = {name: getattr(node.stage, name) for name in node.signature.parameters}
            found[node.name] = {"_target_": node.target, **json.loads(json.dumps(parameters, default=str))}
    return found


def mismatches(name: str, made_by: Mapping[str, Any], graph: Graph, must_match: Sequence[str]) -> Iterator[Problem]:
    """Reports an artifact's file that was made by other stages than this graph has, among the nodes that must match.

    `made_by` is what `stages_of` gave then. A node that it does not know is not compared.
    """
    present = stages_of(graph)
    for node in must_match:
        then, now = made_by.get(node), present.get(node)
        if now is None or not isinstance(then, Mapping) or not isinstance(then.get("_target_"), str):
            continue
        again = f"or leave {name}=FILE out, and it is made again"
        if not _is_known(then["_target_"]):
            what = f"it was made with an older omninav ({then['_target_']:.80} as '{node}')"
            yield Problem(name, what, f"leave {name}=FILE out, and it is made again")
            continue
        before, after = (spec["_target_"].replace(":", ".").rpartition(".")[2] for spec in (then, now))
        if before != after:
            what = f"it was made with {before} as '{node}', and this run has {after}"
            same = next((entry for entry in entries() if entry.target == then["_target_"]), None)
            use = f"type {same.name.replace('.', '=', 1)}" if same else f"give that stage: {then['_target_']}"
            yield Problem(name, what, f"{use}, {again}")
            continue
        for key in [key for key in then if key in now and key != "_target_" and then[key] != now[key]]:
            what = f"it was made with nodes.{node}.{key}={then[key]!s:.80}, and this run has {now[key]}"
            yield Problem(name, what, f"type nodes.{node}.{key}={then[key]}, {again}")


def _is_known(target: str) -> bool:
    """Tells if a stage that a file names still exists. For a file's sake nothing outside this package is imported."""
    if not target.startswith(f"{OWN_PACKAGE}."):
        return True
    try:
        resolve(target)
    except UnknownStage:
        return False
    return True


def input_digests(prepared: PreparedRun) -> dict[str, str]:
    """The content hash of every file that the run reads, by node. Raises `BadInput` where one cannot be read."""
    digests = digests_of(prepared.graph)
    for artifact in prepared.artifacts:
        if artifact.graph is not None:
            digests |= {f"{artifact.name}.{name}": digest for name, digest in digests_of(artifact.graph).items()}
        elif artifact.file is not None:
            digests[artifact.name] = artifact_digest(artifact.file)
    return digests


def same_inputs(prepared: PreparedRun, digests: Mapping[str, str]) -> list[str]:
    """Sentences on artifacts that are made from the very input that the run goes through; `digests` as above."""
    specs, own = read_specifications(prepared.config), prepared.graph.source
    found = []
    for artifact in prepared.artifacts:
        other = None if artifact.graph is None else artifact.graph.source
        spec = specs[artifact.name]
        if own is None or other is None or spec.together_with is not None:
            continue
        if digests.get(f"{artifact.name}.{other.name}", "") == digests.get(own.name) and _choice(own) == _choice(other):
            give = "".join(f"; give another {setting}=…" for setting in spec.made_from[:1])
            found.append(f"{artifact.name}: it is made from the input of this run, so figures are too good{give}")
    return found


def _choice(source: Node) -> dict[str, Any]:
    """The numbers that choose what is used of a source's input."""
    values = {name: getattr(source.stage, name) for name in source.signature.parameters}
    return {name: value for name, value in values.items() if isinstance(value, int | float)}


def check_inputs(prepared: PreparedRun) -> None:
    """Open every file that the run reads, and read its artifacts.

    Raises `ProblemsFound` where an input is not given, and `BadInput` where one cannot be used.
    """
    refuse_missing(prepared.config)
    input_digests(prepared)
    for artifact in prepared.artifacts:
        if artifact.file is not None:
            check_artifact(artifact.file)


def digests_of(graph: Graph) -> dict[str, str]:
    """The content hash of the files that each node of a graph reads, where it reads any."""
    found = {node.name: node.stage.inputs_digest() for node in graph.nodes.values()}
    return {name: digest for name, digest in found.items() if digest is not None}
