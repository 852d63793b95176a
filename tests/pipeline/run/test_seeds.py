"""What depends on the seed is never taken from a run with another seed: neither from the cache nor shared."""

from pathlib import Path

import pytest

from omninav.pipeline import Value
from omninav.pipeline.engine.cache import Cache
from omninav.pipeline.engine.prefix import following
from omninav.pipeline.experiment.repetition import run_repetition
from omninav.pipeline.graph.builder import build
from omninav.pipeline.graph.graph import Graph
from omninav.pipeline.run.run_results import results_of
from toys import Ledger, graph_of_toys

SEEDS = (0, 1, 2)
BEFORE = {"start": "Constant", "dice": "Dice", "twice": "Scale"}
STAGES = {"source": "Count", **BEFORE, "scale": "Scale", "sum": "Add", "all": "Collected"}
ADDED = {"direct": "dice.number", "through a node before the loop": "twice.number", "none": "start.number"}


def graph(added: str) -> Graph:
    """The sum of a frame's number, which comes by way of `scale`, and of one from before the loop."""
    wires = {
        "twice": {"number": "dice.number"},
        "scale": {"number": "source.number"},
        "sum": {"number": "scale.number", "other": ADDED[added]},
        "all": {"numbers": {"from": "sum.number", "collect": True}},
    }
    return build(graph_of_toys(STAGES, wires)).leading_to(["all.metrics"])


def repetitions(
    graph: Graph, place: Path, cache: Cache | None, sharing: bool, **artifacts: Value
) -> tuple[list, list[int]]:
    """What each seed gave, and how often each one computed `scale`."""
    shared, given, computed = None, [], []
    for seed in SEEDS:
        folder = place / f"seed_{seed}"
        folder.mkdir(parents=True)
        engine, recorded = run_repetition(
            graph, artifacts, seed, folder, cache, shared, sharing and shared is None, lambda words: None
        )
        shared = recorded or shared
        given.append(results_of(engine)[0].values["numbers"]["all"])
        computed.append(len(engine.calls["scale"].times))
    return given, computed


@pytest.mark.parametrize("sharing", [False, True])
@pytest.mark.parametrize("cached", [False, True])
@pytest.mark.parametrize("added", ADDED)
def test_repetitions_give_the_same_whether_they_share_and_cache_or_not(
    tmp_path: Path, added: str, cached: bool, sharing: bool
):
    alone, _ = repetitions(graph(added), tmp_path / "alone", None, False)
    cache = Cache(tmp_path / "cache") if cached else None
    assert repetitions(graph(added), tmp_path / "first", cache, sharing)[0] == alone
    assert repetitions(graph(added), tmp_path / "again", cache, sharing)[0] == alone
    assert len({tuple(numbers) for numbers in alone}) == (1 if added == "none" else len(SEEDS))


@pytest.mark.parametrize("added", ADDED)
def test_what_does_not_depend_on_the_seed_is_still_computed_once(tmp_path: Path, added: str):
    assert repetitions(graph(added), tmp_path, None, True)[1] == [10, 0, 0]


def test_a_prefix_that_follows_from_a_draw_before_the_loop_is_found_again_for_its_own_seed(tmp_path: Path):
    cache = Cache(tmp_path / "cache")
    drawn = graph("through a node before the loop")
    assert repetitions(drawn, tmp_path / "first", cache, False)[1] == [10, 10, 10]
    assert repetitions(drawn, tmp_path / "again", cache, False)[1] == [0, 0, 0]


def test_what_follows_from_a_node_is_found_through_nodes_before_the_loop_and_in_it():
    assert following(graph("through a node before the loop"), ["dice"]) == {"dice", "twice", "sum", "all"}


@pytest.mark.parametrize("start", ["new.ledger", "artifacts.ledger"])
def test_what_grows_in_place_starts_anew_for_each_seed(tmp_path: Path, start: str):
    wire = {"from": "enter.ledger", "delay": 1, "initial": start}
    nodes = {"source": "Count", "new": "NewLedger", "scale": "Scale", "noise": "Noise", "enter": "Enter"}
    wires = {
        "scale": {"number": "source.number"},
        "noise": {"number": "scale.number"},
        "enter": {"number": "noise.number", "ledger": wire},
        "look": {"ledger": wire},
        "all": {"numbers": {"from": "look.number", "collect": True}},
    }
    config = graph_of_toys({**nodes, "look": "Look", "all": "Collected"}, wires)
    grown = build(config, {"ledger": Ledger}).leading_to(["all.metrics"])
    sizes, _ = repetitions(grown, tmp_path, None, True, ledger=Ledger([]))
    assert sizes == [[*range(10)]] * len(SEEDS)
