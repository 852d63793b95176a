"""Values that take long to make before the loop: kept in the cache, by the content of all that they follow from."""

from collections.abc import Iterator, Mapping
from contextlib import ExitStack, contextmanager

from omninav.pipeline.engine.artifact import write_artifact
from omninav.pipeline.engine.cache import Cache, seeded
from omninav.pipeline.engine.code_version import graph_digest
from omninav.pipeline.engine.engine import Engine
from omninav.pipeline.files import digest_text
from omninav.pipeline.graph.graph import ARTIFACTS, Graph
from omninav.pipeline.graph.value import Value

from .artifacts import found_value
from .prepared_run import digests_of

SUFFIX = ".value"


@contextmanager
def costly_values(engine: Engine, cache: Cache | None, artifacts: Mapping[str, str], seed: int) -> Iterator[None]:
    """Around `engine.begin`: what it would take long to make is found in the cache, and what it makes is put there.

    `artifacts`: the content hash of each artifact. Other runs that need the same value wait until it is there.
    """
    if cache is None:
        yield
        return
    with ExitStack() as held:
        made = {}
        for origin in sorted(_costly(engine.graph)):
            key = _key(engine.graph, origin, artifacts)
            held.enter_context(cache.lock(key))
            found = found_value(cache, key, SUFFIX, seed)
            if found is None:
                made[origin] = key
            else:
                engine.give(origin, found[1], found[2])
        yield
        for origin, key in made.items():
            value, ctx = engine.values.get(origin), engine.calls[origin.partition(".")[0]].ctx
            if isinstance(value, Value):
                own = seeded(key, seed) if ctx.used_rng else key
                with cache.unless_full(), cache.keep(own, SUFFIX, ctx.notes()) as part:
                    write_artifact(part, value)


def _costly(graph: Graph) -> Iterator[str]:
    """The outputs before the loop that take long to make, of nodes that give nothing else."""
    for node in graph.of_lifetime("before"):
        if len(node.origins) == 1 and graph.is_marked(node.origins[0], "costly"):
            yield node.origins[0]


def _key(graph: Graph, origin: str, artifacts: Mapping[str, str]) -> str:
    part = graph.leading_to([origin])
    read = {wire.from_port for wire in part.wires if wire.from_node == ARTIFACTS}
    contents = [f"{name} {artifacts[name]}" for name in sorted(read)]
    return digest_text("value", graph_digest(part), origin, *digests_of(part).values(), *contents)
