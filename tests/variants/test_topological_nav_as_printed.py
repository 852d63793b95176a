"""What a variant `…_as_printed` may not contain: nothing that Goedemé et al. 2007 do not print."""

import pytest

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.graph.graph import Graph
from omninav.pipeline.run.plan import Plan, plan
from omninav.stages.features.sift_and_vertical_segments import SiftAndVerticalSegments
from omninav.stages.mapping.loop_closure import LoopClosure
from omninav.stages.mapping.topological import TopologicalMapping
from omninav.stages.sensor.place_likelihood import PlaceLikelihood


def planned(*words: str) -> Plan:
    with composed(words) as config:
        return plan(complete(config))


def map_graph(whole: Plan) -> Graph:
    (made,) = [made for made in whole.artifacts if made.name == "map"]
    assert made.graph is not None
    return made.graph


def is_printed_map(graph: Graph) -> None:
    assert not {"straightened", "places", "words"} & set(graph.nodes)
    loops, mapping = graph.nodes["loops"].stage, graph.nodes["mapping"].stage
    assert isinstance(loops, LoopClosure)
    assert isinstance(mapping, TopologicalMapping)
    assert (loops.between, loops.similarity, loops.min_share, loops.accepted) == ("medoids", "ratio", 0.0, "merge")
    assert (mapping.min_path_matches, mapping.spread) == (0, "all_views")
    assert graph.nodes["views"].stage.patch_distance == "mahalanobis"
    assert type(graph.nodes["features"].stage) is SiftAndVerticalSegments


def is_printed_place_filter(whole: Plan) -> None:
    assert not {"word_match", "place_recognition"} & set(whole.graph.nodes)
    assert [made.name for made in whole.artifacts if made.name == "words"] == []
    sensor = whole.graph.nodes["sensor"].stage
    assert isinstance(sensor, PlaceLikelihood)
    assert (sensor.tail, sensor.sigma) == ("gaussian", None)
    assert whole.graph.nodes["match"].stage.patch_distance == "mahalanobis"
    assert type(whole.graph.nodes["features"].stage) is SiftAndVerticalSegments
    is_printed_map(map_graph(whole))


def is_printed_homing(graph: Graph) -> None:
    assert not {"stall_monitor", "wander"} & set(graph.nodes)
    steering = {"features", "path_following", "target_match", "tracker", "local_map", "homing", "control"}
    fed = {wire.origin for wire in graph.wires if wire.to_node in steering}
    assert "source.image" in fed
    assert not {"source.motion", "source.odometry"} & fed
    local_map = graph.nodes["local_map"].stage
    assert (local_map.matching, local_map.solver, local_map.refine) == ("at_start", "eight_point", False)
    assert local_map.max_false_alarms > 1e9
    assert graph.nodes["target_match"].stage.patch_distance == "mahalanobis"


def test_a_printed_map_has_prototypes_alone_and_neither_words_nor_merging_nor_straightening():
    is_printed_map(planned("learn=map", "variant=topological_nav_as_printed").graph)


def test_a_printed_place_filter_has_a_gaussian_and_no_words_over_a_printed_map():
    is_printed_place_filter(planned("variant=topological_localisation_as_printed"))


def test_printed_homing_has_the_camera_as_its_only_sensor():
    is_printed_homing(planned("variant=homing_as_printed").graph)


def test_printed_navigation_is_all_of_these_and_one_route():
    whole = planned("variant=topological_nav_as_printed", "goal=kitchen", "world=office")
    is_printed_place_filter(whole)
    is_printed_homing(whole.graph)
    assert whole.graph.nodes["planning"].stage.max_routes == 1


@pytest.mark.parametrize("variant", ["homing", "topological_nav learn=map", "topological_localisation"])
def test_ours_is_not_as_printed(variant: str):
    features = planned(*f"variant={variant}".split()).graph.nodes["features"].stage
    assert type(features) is not SiftAndVerticalSegments
