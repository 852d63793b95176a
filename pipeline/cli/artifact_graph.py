"""The graph that makes an artifact of a variant: chosen by the variant, composed by Hydra as every configuration is.

A variant's block `artifacts` describes how each is made. With `learn=NAME` that graph is a configuration of its own,
run over a log of its own; where the artifact is made on the way, `composition` composes it in the same words.
"""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any

from omegaconf import OmegaConf

from omninav.pipeline.graph.parameters import BadStage
from omninav.pipeline.graph.problems import Problem, ProblemsFound, suggest
from omninav.pipeline.graph.registry import UnknownStage, resolve
from omninav.pipeline.graph.signature import signature

from .arguments import value_text
from .composition_cache import parsed
from .config_groups import LEARN, node_option, option_content

MAKING = ("choices", "nodes", "wires")
"""Keys of an artifact's specification that change the graph which makes it."""


def words_of_graph(variant: str, choices: Mapping[str, str]) -> list[str]:
    """The words that choose the graph: one of `conf/graph`, or else the variant's own, and options of other groups."""
    graph = choices.get("graph")
    first = ["~variant", f"+graph={graph}"] if graph else [f"variant={choices.get('variant', variant)}"]
    rest = ((group, option) for group, option in choices.items() if group not in ("graph", "variant"))
    return [*first, *(f"{group}={option}" for group, option in rest)]


def learned(words: Sequence[str]) -> str | None:
    """The artifact that words ask for (`learn=NAME`), None where they ask for none."""
    names = [word.partition("=")[2] for word in words if word.startswith(f"{LEARN}=")]
    return names[-1] if names and "," not in names[-1] else None


def words_of_variant(words: Sequence[str], groups: Collection[str]) -> list[str]:
    """Those of the words that choose one option, but for `learn`: what they give describes how the artifact is made."""
    one = [word for word in parsed(words) if word.key_or_group in groups and not word.is_sweep_override()]
    return [str(word.input_line) for word in one if word.key_or_group != LEARN]


def words_of_artifact(name: str, variant: Any, words: Sequence[str]) -> list[str]:
    """The words that describe the graph of an artifact, as a run of its own, followed by those that were typed.

    `variant` is the configuration that the options among `words` describe. Raises `ProblemsFound` where it says
    nowhere how the artifact is made.
    """
    artifacts: Any = OmegaConf.to_container(variant.artifacts, resolve=False)
    makers = [key for key, spec in artifacts.items() if spec is not None and spec.get("choices") is not None]
    if name not in makers:
        what = f"variant={variant.variant} has no '{name}' to learn"
        raise ProblemsFound([Problem(LEARN, what, suggest(name, makers, "artifacts", f"{LEARN}=") if makers else "")])
    spec = artifacts[name]
    beside = {
        key: other
        for key, other in artifacts.items()
        if other is not None and other.get("together_with") == name and {*MAKING} & {*other}
    }
    specs = (spec, *beside.values())
    keyed = [(word.key_or_group, str(word.input_line)) for word in parsed(words)]
    typed = [(key, text) for key, text in keyed if not _makes_artifact(key, text)]
    set_by_hand = {key for key, _ in typed} - {"variant"}
    swapped = {key: node_option(key, text.partition("=")[2]) for key, text in typed}
    chosen = variant.hydra.runtime.choices
    inherited = [node for each in specs for node in each.get("inherit") or ()]
    shared = {node: variant.nodes[node] for node in inherited if is_repeatable(variant.nodes[node])}
    options = {node: str(chosen[node]) for node in shared if chosen.get(node)}
    groups = words_of_graph(str(variant.variant), {**options, **spec["choices"]})
    return [
        *(word for word in groups if word.lstrip("+~").partition("=")[0] not in set_by_hand),
        *(f"++nodes.{name}={value_text(OmegaConf.to_container(node, resolve=False))}" for name, node in shared.items()),
        *(change for each in specs for change in _changes(name, each, swapped)),
        *(f"++saves.{key}={each['output']}" for key, each in {name: spec, **beside}.items() if each.get("output")),
        *(text for key, text in typed if key not in (LEARN, "variant")),
    ]


def _makes_artifact(group: str, word: str) -> bool:
    """Tells whether an option belongs to the variant alone, since it describes how an artifact is made."""
    specs = (option_content(group, word.partition("=")[2]).get("artifacts") or {}).values()
    return any({*MAKING} & {*spec} for spec in specs)


def _changes(name: str, spec: Mapping[str, Any], swapped: Mapping[str, Any]) -> Iterator[str]:
    """The words that change nodes and wires; but for what is stated for a stage in whose place another was typed."""
    for block in ("nodes", "wires"):
        for node, change in (spec.get(block) or {}).items():
            if block == "wires" or not unfit_changes(name, {node: change}, swapped):
                yield f"++{block}.{node}={value_text(change)}"


def unfit_changes(name: str, changes: Mapping[str, Any], nodes: Mapping[str, Any]) -> list[Problem]:
    """Parameters that a variant states for nodes of its artifact's graph, and that the stages in their place lack."""
    found = []
    for node in (one for one, change in changes.items() if nodes.get(one) and "_target_" not in (change or ())):
        try:
            cls = resolve(str(nodes[node].get("_target_")))
            known = signature(cls).parameters
        except (UnknownStage, BadStage):  # reported by `build`
            continue
        for key in (key for key in changes[node] or () if key not in known):
            where = f"artifacts.{name}.nodes.{node}"
            hint = f"{suggest(key, known, 'parameters')}; type '~{where}' to take out those of the variant's own stage"
            found.append(Problem(f"{where}.{key}", f"{cls.__name__} has no parameter '{key}'", hint))
    return found


def is_repeatable(node: Any) -> bool:
    """Tells whether a node may be in an artifact's graph too: all may but sources that give their ticks once."""
    if not isinstance(node, Mapping):  # reported by `build`
        return False
    try:
        return bool(getattr(resolve(str(node.get("_target_"))), "repeatable", True))
    except UnknownStage:  # reported by `build`
        return True
