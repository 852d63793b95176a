"""The order of nodes is that of networkx."""

import networkx as nx
import numpy as np
import pytest

from omninav.pipeline.graph.ordering import Following


@pytest.mark.parametrize("seed", range(20))
def test_what_follows_and_the_order_are_those_of_networkx(seed: int) -> None:
    rng = np.random.default_rng(seed)
    names = [f"n{number}" for number in rng.permutation(12)]
    pairs = [(names[a], names[b]) for a, b in np.sort(rng.integers(0, 12, (14, 2))).tolist() if a != b]
    graph, theirs = Following(sorted(names)), nx.DiGraph(pairs)
    theirs.add_nodes_from(names)
    for pair in pairs:
        graph.add(*pair)
    assert graph.circle() is None
    assert [*graph.ordered(lambda name: int(name[1:]))] == [
        *nx.lexicographical_topological_sort(theirs, key=lambda name: int(name[1:]))
    ]
    for name in names:
        assert graph.after(name) == nx.descendants(theirs, name)
    first, later = pairs[0]
    for back in nx.descendants(theirs, later) | {later}:
        graph.add(back, first)
        circle = graph.circle()
        assert circle is not None
        assert {(back, first), (first, later)} & {*zip(circle, [*circle[1:], circle[0]], strict=True)}
        graph.remove(back, first)
    assert graph.circle() is None
