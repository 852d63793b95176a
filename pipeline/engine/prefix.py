"""The front of a graph: what follows from the logs alone (unwarped, featured images), kept for the next run.

A node is in the front when it is the source of a recorded log, or gets all its inputs from the front or from before the
loop, without delays. What other nodes read of the front is its boundary; it is spooled tick by tick under the hash of
stages, parameters, wires and logs. The seed is part of the key only where a stage of the front, or one before the loop
that it follows from, drew random numbers.
"""

import shutil
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from omninav.pipeline.files import digest_file, digest_text, whole_file, write_whole
from omninav.pipeline.graph.graph import ARTIFACTS, Graph

from .artifact import Cache
from .codec import BadEncoding, decode, encode, seal, unseal
from .disk_sequence import DiskSequence


@dataclass
class CachedPrefix:
    """The front of a graph in a cache. `replay` is None where it is still to be computed.

    `said` tells in words why it was found or not.
    """

    nodes: frozenset[str]
    boundary: tuple[str, ...]
    key: str
    said: str
    replay: Sequence[Mapping[str, Any]] | None = None
    notes: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    before: Mapping[str, Any] = field(default_factory=dict)


def front_nodes(graph: Graph, artifacts: bool = False, without: Collection[str] = ()) -> frozenset[str]:
    """The names of the front's nodes; empty where the source listens to the graph (a simulator in a closed loop).

    With `artifacts`, what follows from the logs and the artifacts: the front that runs share which differ in their
    seed only. `without` these nodes (those `following` from draws of random numbers).
    """
    source = graph.source
    if source is None or source.name in without or graph.inputs_of(source.name):
        return frozenset()
    front = {source.name}
    before = {node.name for node in graph.of_lifetime("before")} - set(without)
    for node in graph.of_lifetime("tick"):
        wires = graph.inputs_of(node.name)
        ready = all(
            not w.delay
            and (
                w.from_node in front
                or (artifacts and w.from_node == ARTIFACTS)
                or (w.from_node in before and (artifacts or not _draws_on_artifacts(graph, w.from_node)))
            )
            for w in wires
        )
        if wires and ready and node.name not in without:
            front.add(node.name)
    return frozenset(front)


def front_boundary(graph: Graph, nodes: frozenset[str]) -> list[str]:
    """What other nodes read of the front, and the source's tick."""
    read = {wire.origin for wire in graph.wires if wire.from_node in nodes and wire.to_node not in nodes}
    return sorted(read | ({f"{graph.source.name}.tick"} if graph.source else set()))


def _draws_on_artifacts(graph: Graph, name: str) -> bool:
    return any(
        wire.from_node == ARTIFACTS or _draws_on_artifacts(graph, wire.from_node) for wire in graph.inputs_of(name)
    )


def lineage(graph: Graph, nodes: frozenset[str]) -> frozenset[str]:
    """The nodes of a front and those before the loop that they follow from."""
    before = {node.name for node in graph.of_lifetime("before")}
    closure, waiting = set(nodes), list(nodes)
    while waiting:
        for wire in graph.inputs_of(waiting.pop()):
            if wire.from_node in before and wire.from_node not in closure:
                closure.add(wire.from_node)
                waiting.append(wire.from_node)
    return frozenset(closure)


def following(graph: Graph, names: Collection[str]) -> frozenset[str]:
    """These nodes and all that follows from them without delays."""
    found = set(names)
    for name in graph.nodes:  # in running order: what a node reads undelayed stands before it
        if any(wire.from_node in found for wire in graph.inputs_of(name)):
            found.add(name)
    return frozenset(found)


def front_key(graph: Graph, nodes: frozenset[str]) -> str:
    """The hash of everything but the seed that decides what the front gives."""
    closure = lineage(graph, nodes)
    digests = [f"{name}:{graph.nodes[name].stage.inputs_digest()}" for name in sorted(closure)]
    return digest_text("front", graph.digest(closure), *digests)


@contextmanager
def cached_front(graph: Graph, cache: Cache | None, seed: int) -> Iterator[CachedPrefix | None]:
    """The front of a graph, found in the cache or to be recorded. Others who want the same one wait meanwhile."""
    nodes = front_nodes(graph)
    if cache is None or not nodes or graph.source is None:
        yield None
        return
    readers = [wire for wire in graph.wires if wire.from_node in nodes and wire.to_node not in nodes]
    boundary = front_boundary(graph, nodes)
    bulky = [origin for origin in boundary if getattr(getattr(graph.port(origin), "type", None), "bulky", False)]
    if bulky:
        who = ", ".join(sorted({wire.to_node for wire in readers if wire.origin == bulky[0]}))
        yield CachedPrefix(
            nodes, tuple(boundary), "", f"not cached: {bulky[0]} is too large to keep and is read by {who}", replay=None
        )
        return
    key = digest_text(front_key(graph, nodes), *boundary)
    with ExitStack() as held:
        held.enter_context(cache.lock(key))
        for candidate in (key, seeded(key, seed)):
            path = cache.path(candidate, ".front")
            if path.exists():
                try:
                    notes = decode(unseal(cache.path(candidate, ".notes").read_bytes(), str(path)))
                    if digest_file(path) == notes["digest"]:
                        spool = DiskSequence(path)
                        held.close()
                        said = (
                            f"found: {', '.join(sorted(nodes))} of this log with these parameters were computed before"
                        )
                        yield CachedPrefix(nodes, tuple(boundary), key, said, spool, notes["nodes"])
                        return
                except (BadEncoding, FileNotFoundError):
                    path.unlink(missing_ok=True)  # half a result is no result: it is made again
        yield CachedPrefix(
            nodes, tuple(boundary), key, "not found: code, parameters or log are new, or it never ran to its end"
        )


def seeded(key: str, seed: int) -> str:
    """The key of a result that depends on the seed."""
    return digest_text(key, f"seed {seed}")


def keep(front: CachedPrefix, cache: Cache, seed: int, spool: Path, notes: Mapping[str, Mapping[str, Any]]) -> None:
    """Put a recorded front into the cache. `notes` are those of its `lineage`: counts, facts, and who drew."""
    drew = any(note["drew"] for note in notes.values())
    key = seeded(front.key, seed) if drew else front.key
    with whole_file(cache.path(key, ".front")) as part:
        shutil.copyfile(spool, part)
        digest = digest_file(part)
    write_whole(cache.path(key, ".notes"), seal(encode({"digest": digest, "nodes": dict(notes)})))
