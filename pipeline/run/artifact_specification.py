"""The block `artifacts` of a configuration, typed and checked: where each artifact comes from."""

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

from omninav.pipeline.graph.graph import ARTIFACTS
from omninav.pipeline.graph.ports import convert_fields
from omninav.pipeline.graph.problems import Problem, ProblemsFound, suggest


@dataclass(frozen=True)
class ArtifactSpecification:
    """Origin of an artifact: a file, or an output of a graph that makes it."""

    file: str | None = None
    """The file it is loaded from; none: it is made, where it can be."""
    choices: dict[str, str] | None = None
    """Options that choose the graph which makes it: `graph` of conf/graph, none: this variant's own; and options of
    other groups in it. None: it is not made, only loaded. Where it is not `required` it is made if it is asked for."""
    output: str = ""
    """The output (`node.port`) of that graph that is taken; none: what that graph saves under the artifact's name."""
    set: dict[str, Any] = field(default_factory=dict)
    """Settings of that graph that differ from this run's; all others are this run's."""
    inherit: tuple[str, ...] = ()
    """Nodes of that graph that are this graph's, with their parameters."""
    nodes: dict[str, Any] = field(default_factory=dict)
    """Changes to nodes of that graph, and nodes that it gains: name -> parameters."""
    wires: dict[str, Any] = field(default_factory=dict)
    """Wires that it gains: node -> ports."""
    must_match: tuple[str, ...] = ()
    """Nodes that must be in this graph what they were in the one that made the file."""
    together_with: str | None = None
    """The artifact whose graph gives this one too, in the same run: that one describes the graph, and this one what
    else is in it (`inherit`, `nodes`, `wires`)."""
    required: bool = True
    """Whether nothing can run without it; else the wires from it are left out where it is neither given nor made."""
    for_plots: bool = False
    """Whether only plots read it: experiments do without."""
    variant: str | None = None
    """The name of that graph: this variant's and the artifact's. Found by composing, not written."""
    made_from: tuple[str, ...] = ()
    """Settings that have to be given for it to be made. Found by composing, not written."""
    graph: dict[str, Any] | None = None
    """Nodes, wires and saves of the graph that makes it. Found by composing, not written."""


def read_specifications(config: Mapping[str, Any]) -> dict[str, ArtifactSpecification]:
    """The artifacts of a plain configuration. Raises `ProblemsFound` with everything that is wrong with the block."""
    block = config.get("artifacts") or {}
    if not isinstance(block, Mapping):
        raise ProblemsFound([Problem("artifacts", "expected a mapping from names to where they come from")])
    found: dict[str, ArtifactSpecification] = {}
    problems: list[Problem] = []
    for name, given in block.items():
        where = f"artifacts.{name}"
        if not isinstance(given, Mapping):
            hint = f"write {where}: {{choices: {{graph: …}}}} or {{file: …}}"
            problems.append(Problem(where, "expected a mapping", hint))
            continue
        arguments, wrong = convert_fields(given, ArtifactSpecification, where)
        problems += wrong
        if not wrong:
            found[str(name)] = ArtifactSpecification(**arguments)
    for name, spec in found.items():
        where = f"artifacts.{name}"
        others = [str(other) for other in block if other != name]
        if spec.together_with is not None and spec.together_with not in others:
            hint = suggest(spec.together_with, others, "artifacts")
            problems.append(Problem(f"{where}.together_with", f"there is no artifact '{spec.together_with}'", hint))
        nodes = [str(node) for node, content in (config.get("nodes") or {}).items() if content is not None]
        for key, names in (("inherit", spec.inherit), ("must_match", spec.must_match)):
            for node in names:
                if node not in nodes:
                    hint = suggest(node, nodes, "nodes")
                    problems.append(Problem(f"{where}.{key}", f"there is no node '{node}'", hint))
    if problems:
        raise ProblemsFound(problems)
    return found


def without_absent(config: Mapping[str, Any]) -> Mapping[str, Any]:
    """A configuration without the artifacts that are not required and neither given nor made, and their wires.

    A port that cannot do without its wire is then a problem like every missing wire.
    """
    specs = read_specifications(config)
    absent = []
    for name, spec in specs.items():
        loaded = spec.together_with is not None and specs[spec.together_with].file is not None
        if not spec.required and spec.file is None and (spec.graph is None or loaded):
            absent.append(name)
    return without_artifacts(config, absent)


def without_plotted(config: Mapping[str, Any]) -> Mapping[str, Any]:
    """A configuration without the artifacts that only plots read."""
    return without_artifacts(config, [name for name, spec in read_specifications(config).items() if spec.for_plots])


def without_artifacts(config: Mapping[str, Any], names: Collection[str]) -> Mapping[str, Any]:
    """A configuration without some artifacts and the wires from them."""
    if not names:
        return config
    origins = {f"{ARTIFACTS}.{name}" for name in names}
    wires = {
        node: _without(ports, origins) if isinstance(ports, Mapping) else ports
        for node, ports in (config.get("wires") or {}).items()
    }
    kept = {name: spec for name, spec in config["artifacts"].items() if name not in names}
    return {**config, "artifacts": kept, "wires": wires}


def _without(ports: Mapping[str, Any], origins: Collection[Any]) -> dict[str, Any]:
    return {
        port: wire
        for port, wire in ports.items()
        if (wire.get("from") if isinstance(wire, Mapping) else wire) not in origins
    }
