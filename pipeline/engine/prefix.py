"""The prefix of a graph: what follows from the logs alone (prepared data), kept for the next run.

A node is in the prefix when it is the source of a recorded log, or gets all its inputs from the prefix or from before
the loop, without delays. What other nodes read of the prefix is its frontier; it is written tick by tick under the hash
of stages, parameters, wires and logs. The seed is part of the key only where a stage of the prefix, or one before the
loop that it follows from, drew random numbers.
"""

import shutil
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass

from omninav.pipeline.files import digest_text
from omninav.pipeline.graph.graph import ARTIFACTS, Graph
from omninav.pipeline.graph.stage import Source

from .cache import Cache, seeded
from .code_version import graph_digest
from .disk_sequence import DiskSequence
from .engine import Engine, PrefixReplay

SEQUENCE = "prefix"
"""The name of the sequence to which an engine writes a prefix that is not in the cache yet."""


@dataclass(frozen=True)
class CachedPrefix:
    """The prefix of a graph and its place in the cache. `replay` is None where it is still to be computed."""

    nodes: frozenset[str] = frozenset()
    frontier: tuple[str, ...] = ()
    key: str = ""
    """Cache key; '' where there is nothing to keep, or too much."""
    reason: str = "not cached: nothing in this graph follows from its log alone"
    """Why it was found or not."""
    replay: PrefixReplay | None = None

    def recorded(self) -> dict[str, Sequence[str]]:
        """Outputs that an engine has to record so that it can be kept: for `Engine(recorded=…)`."""
        return {SEQUENCE: self.frontier} if self.key and self.replay is None else {}


def prefix_nodes(graph: Graph, artifacts: bool = False, without: Collection[str] = ()) -> frozenset[str]:
    """The names of the prefix's nodes; empty where the source reads outputs of the graph (a closed loop)
    or is not repeatable.

    `artifacts`: count artifacts as inputs too, for the prefix that is shared by runs that differ only in their seed.
    `without`: nodes to leave out (those that `following` finds behind draws of random numbers).
    """
    source = graph.source
    if source is None or source.name in without or graph.inputs_of(source.name):
        return frozenset()
    if isinstance(source.stage, Source) and not source.stage.repeatable:
        return frozenset()
    prefix = {source.name}
    before = {node.name for node in graph.of_lifetime("before")} - set(without)
    for node in graph.of_lifetime("tick"):
        wires = graph.inputs_of(node.name)
        ready = all(
            not w.delay
            and (
                w.from_node in prefix
                or (artifacts and w.from_node == ARTIFACTS)
                or (w.from_node in before and (artifacts or not _draws_on_artifacts(graph, w.from_node)))
            )
            for w in wires
        )
        if wires and ready and node.name not in without:
            prefix.add(node.name)
    return frozenset(prefix)


def frontier_of(graph: Graph, nodes: frozenset[str], wanted: Collection[str] = ()) -> list[str]:
    """Outputs of a prefix that other nodes read, that are `wanted` or reported, and the source's tick."""
    read = {wire.origin for wire in graph.wires if wire.from_node in nodes and wire.to_node not in nodes}
    read |= {origin for origin in wanted if origin.partition(".")[0] in nodes} | graph.reported(nodes)
    return sorted(read | ({f"{graph.source.name}.tick"} if graph.source else set()))


def _draws_on_artifacts(graph: Graph, name: str) -> bool:
    return any(wire.from_node == ARTIFACTS for wire in graph.leading_to([name]).wires)


def lineage(graph: Graph, nodes: frozenset[str]) -> frozenset[str]:
    """The nodes of a prefix and those before the loop that they follow from."""
    return frozenset(graph.leading_to(nodes).nodes)


def following(graph: Graph, names: Collection[str]) -> frozenset[str]:
    """These nodes and all that follows from them without delays."""
    found = set(names)
    for name in graph.nodes:  # in running order: what a node reads undelayed comes before it
        if any(wire.from_node in found for wire in graph.inputs_of(name)):
            found.add(name)
    return frozenset(found)


def prefix_key(graph: Graph, nodes: frozenset[str]) -> str:
    """The hash of everything but the seed that decides what the prefix gives."""
    closure = lineage(graph, nodes)
    digests = [f"{name}:{graph.nodes[name].stage.inputs_digest()}" for name in sorted(closure)]
    return digest_text("prefix", graph_digest(graph, closure), *digests)


@contextmanager
def cached_prefix(graph: Graph, cache: Cache | None, seed: int, wanted: Collection[str] = ()) -> Iterator[CachedPrefix]:
    """The prefix of a graph, found in the cache or to be recorded, without nodes where there is none to keep.

    Other runs that need the same one wait. `wanted`: outputs that the graph's run needs.
    """
    nodes = prefix_nodes(graph)
    if cache is None or not nodes or graph.source is None:
        yield CachedPrefix()
        return
    frontier = tuple(frontier_of(graph, nodes, wanted))
    bulky = next((origin for origin in frontier if graph.is_marked(origin, "bulky")), None)
    if bulky is not None:
        readers = ", ".join(name for name in graph.readers_of(bulky) if name not in nodes)
        yield CachedPrefix(nodes, frontier, "", f"not cached: {bulky} is too large to keep and is read by {readers}")
        return
    key = digest_text(prefix_key(graph, nodes), *frontier)
    with ExitStack() as held:
        held.enter_context(cache.lock(key))
        for candidate in (key, seeded(key, seed)):
            replay = _found(cache, candidate, nodes)
            if replay is not None:
                held.close()
                names = ", ".join(sorted(nodes))
                reason = f"found: {names} of this log with these parameters were computed before"
                yield CachedPrefix(nodes, frontier, key, reason, replay)
                return
        reason = "not found: code, parameters or log are new, or it never ran to its end"
        yield CachedPrefix(nodes, frontier, key, reason)


def _found(cache: Cache, key: str, nodes: frozenset[str]) -> PrefixReplay | None:
    found = cache.find(key, ".prefix")
    return None if found is None else PrefixReplay(nodes, DiskSequence(found[0], append=False), found[1], {})


def keep_prefix(engine: Engine, prefix: CachedPrefix, cache: Cache | None) -> None:
    """Put the prefix that an engine has recorded into the cache, where it was not found there."""
    if cache is None or not prefix.recorded():
        return
    sequence = engine.sequences[SEQUENCE]
    sequence.flush()
    notes = {name: engine.calls[name].ctx.notes() for name in sorted(lineage(engine.graph, prefix.nodes))}
    used_rng = any(note["drew"] for note in notes.values())
    key = seeded(prefix.key, engine.options.seed) if used_rng else prefix.key
    with cache.unless_full(), cache.keep(key, ".prefix", notes) as part:
        shutil.copyfile(sequence.path, part)
