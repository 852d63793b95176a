"""The variants of the papers as printed hold nothing of ours: every addition is off, and its stage left out or idle."""

from typing import Any

import pytest

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.graph.graph import Graph
from omninav.pipeline.run.prepared_run import PreparedRun, prepare_run
from omninav.stages.features.haar_integral import Binning
from omninav.stages.features.hsv_histogram import HUE_BINS
from omninav.stages.fusion.uniform_recovery import RANDOM_PARTICLES
from omninav.stages.sensor.visibility import WINDOW_DEG

Stages = dict[str, tuple[str, dict[str, Any]]]
"""Node -> the class of its stage, and parameters."""
NAVIGATION = "topological_nav_as_printed goal=kitchen world=office"
PLACES = "topological_localisation_as_printed"

AS_LEARNED: Stages = {
    "visual_turn": ("VisualTurn", {"max_sigma_deg": 0}),
    "straightened": ("StraightenSessions", {"max_distance": 0}),
    "straightened_at_last": ("StraightenSessions", {"max_distance": 0}),
}
"""Turns are odometry's, and maps stay as they were learned."""
PLACE_FILTER: Stages = {
    "features": ("SiftAndVerticalSegments", {}),
    "match": ("VisualDistance", {"patch_distance": "mahalanobis"}),
    "sensor": ("PlaceLikelihood", {"tail": "gaussian", "sigma": None}),
}
HOMING: Stages = {
    "features": ("SiftAndVerticalSegments", {}),
    "target_match": ("MatchFeatures", {"patch_distance": "mahalanobis"}),
    "local_map": (
        "LocalMapping",
        {"matching": "at_start", "solver": "eight_point", "refine": False, "max_false_alarms": 1e300},
    ),
}
PRINTED: dict[str, Stages] = {
    # Porta and Kröse: views as they are, learned at once, merged half and half; points for places.
    "particle_cml_as_printed": AS_LEARNED
    | {
        "map_update": ("DelayedByDistance", {"distance_m": 0}),
        "features": ("CosineTransform", {"headings": 1, "contrast": "none", "mean": True}),
        "mapping": ("FusedMixtures", {"average": "halves", "spread": False}),
        "sensor": ("Superposition", {"extent": False, "views": "all"}),
        "fusion": (
            "ConditionalResampling",
            {"sampling": "importance", "agree_above": 1e-4, "keep": 0.8, "outlier_probability": 0.0},
        ),
    },
    # Gross et al.: fused by equations 2 to 8, merged by equation 14 to the letter, every path reconstructed.
    "omniview_cml_as_printed": AS_LEARNED
    | {
        "map_update": ("UnimodalQueue", {"length": 20, "reconstruct": True, "odometry_gate": 0.0}),
        "features": ("SegmentSpectrum", {"channels": "colour", "contrast": "none", "mean": True}),
        "mapping": (
            "AdaptiveViews",
            {"state_covariance": "every_update", "forgetting": "active", "min_sigma_m": 0.0, "min_sigma_deg": 0.0},
        ),
        "sensor": ("Superposition", {"extent": False, "views": "all"}),
        "fusion": ("CovarianceIntersection", {"weighted": True}),
    },
    # Gross and Koenig: the view expected at a particle's pose, compared by the best segments under a root; the weight
    # is a fixed power of S; each image is evidence, and no particle comes from anywhere else.
    "omniview_mcl_as_printed": {
        "features": ("HsvHistogram", {"value_bins": 4}),
        "prior": ("ParticlePrior", {"number": 5000}),
        "match": ("SelectiveMatch", {"penalty": "sqrt"}),
        "sensor": (
            "ExpectedObservation",
            {"power": 8.0, "fade_distance": None, "background_quantile": None, "independence_distance": 0.0},
        ),
        "fusion": (
            "ImportanceResampling",
            {
                "number": 5000,
                "resample_below": 1.0,
                "adapt": "none",
                "recovery_share": 0.0,
                "kidnapping_probability": 0.0,
            },
        ),
        "belief_estimate": ("BeliefEstimate", {"taken": "mode"}),
    },
    # Wolf, Burgard and Burkhardt, sections IV and VI-C, equations 7 and 8: the mean of the similarities as they are,
    # over all views of an area alike; samples drawn anew, anywhere in free space; an ordinary camera.
    "retrieval_mcl_as_printed": {
        "unwarp": ("PerspectiveWindow", {"directions": 1}),
        "features": (
            "HaarIntegral",
            {"kernels": ((0.0, 1.0), (3.0, 4.0)), "root": False, "histogram": "separate", "bins": 16},
        ),
        "prior": ("ParticlePrior", {"number": 5000}),
        "match": ("Retrieval", {}),
        "sensor": ("Visibility", {"distance_sigma_m": None, "independence_distance": 0.0, "retrieval": True}),
        "proposals": ("FreeSpaceProposals", {}),
        "fusion": ("UniformRecovery", {"number": 5000}),
        "belief_estimate": ("BeliefEstimate", {"taken": "mean"}),
    },
    # Goedemé et al.: a Gaussian and no words; one route, and the camera as the only sensor of homing.
    PLACES: PLACE_FILTER,
    "homing_as_printed": HOMING,
    NAVIGATION: PLACE_FILTER | HOMING | {"planning": ("ShortestPathPlanner", {"max_routes": 1})},
}
PRINTED_MAP: Stages = {
    "features": ("SiftAndVerticalSegments", {}),
    "views": ("ViewComparison", {"patch_distance": "mahalanobis"}),
    "loops": ("LoopClosure", {"between": "medoids", "similarity": "ratio", "min_share": 0.0, "accepted": "merge"}),
    "mapping": ("TopologicalMapping", {"min_path_matches": 0, "spread": "all_views"}),
}
"""Stages of a map of Goedemé et al., which keeps prototypes alone."""
LEFT_OUT = {
    "particle_cml_as_printed": {"fixed_lag_smoother", "pose_fixes", "proposals", "monitor"},
    "omniview_cml_as_printed": {"pose_fixes", "proposals", "monitor"},
    PLACES: {"word_match", "place_recognition"},
    "homing_as_printed": {"stall_monitor", "wander"},
    NAVIGATION: {"word_match", "place_recognition", "stall_monitor", "wander"},
}


def prepared(words: str) -> PreparedRun:
    with composed(f"variant={words}".split()) as config:
        return prepare_run(complete(config))


def map_of(whole: PreparedRun) -> Graph:
    (graph,) = [made.graph for made in whole.artifacts if made.name == "map"]
    assert graph is not None
    return graph


def values_of(graph: Graph, stages: Stages) -> Stages:
    """Those parameters of those nodes as they are in a graph."""
    found = {}
    for name, (_, parameters) in stages.items():
        stage = graph.nodes[name].stage
        found[name] = (type(stage).__name__, {parameter: getattr(stage, parameter) for parameter in parameters})
    return found


def wired(graph: Graph, node: str) -> set[str]:
    return {wire.to_port for wire in graph.wires if wire.to_node == node}


@pytest.mark.parametrize("variant", PRINTED)
def test_a_variant_as_printed_has_the_papers_stages_and_none_of_ours(variant: str):
    graph = prepared(variant).graph
    assert values_of(graph, PRINTED[variant]) == PRINTED[variant]
    assert not LEFT_OUT.get(variant, set()) & set(graph.nodes)


@pytest.mark.parametrize("variant", [PLACES, NAVIGATION])
def test_a_printed_map_of_places_has_neither_words_nor_merging_nor_straightening(variant: str):
    whole = prepared(variant)
    assert [made.name for made in whole.artifacts if made.name == "words"] == []
    assert values_of(map_of(whole), PRINTED_MAP) == PRINTED_MAP
    assert not {"straightened", "places", "words"} & set(map_of(whole).nodes)


@pytest.mark.parametrize("variant", ["homing_as_printed", NAVIGATION])
def test_printed_homing_has_the_camera_as_its_only_sensor(variant: str):
    steering = {"features", "path_following", "target_match", "tracker", "local_map", "homing", "control"}
    fed = {wire.origin for wire in prepared(variant).graph.wires if wire.to_node in steering}
    assert "source.image" in fed
    assert not {"source.motion", "source.odometry"} & fed


def test_gross_and_koenig_add_references_by_distance_or_dissimilarity_and_print_two_sizes_of_bins():
    whole = prepared("omniview_mcl_as_printed")
    graph, map = whole.graph, map_of(whole)
    assert "calibration" not in wired(graph, "sensor")
    mapping = map.nodes["mapping"].stage
    assert mapping.distance_m > 0.1
    assert mapping.similarity > 0.0
    assert map.nodes["features"].parameters == graph.nodes["features"].parameters
    assert HUE_BINS == 16


def test_wolf_burgard_and_burkhardt_draw_50_samples_anew_and_keep_936_images_in_far_less_than_4_mb():
    whole = prepared("retrieval_mcl_as_printed")
    graph, map = whole.graph, map_of(whole)
    assert "calibration" not in wired(graph, "sensor")
    assert "area" in wired(graph, "prior")
    assert (WINDOW_DEG, RANDOM_PARTICLES) == (5.0, 50)
    features = graph.nodes["features"].stage
    assert max(features.scales) == 2.0  # kernels of up to twice their own size
    assert 936 * len(features.kernels) * len(features.scales) * 4 * Binning(8, joint=False).length < 0.6e6
    assert map.nodes["unwarp"].stage.directions == 8
    assert map.nodes["features"].parameters == graph.nodes["features"].parameters


@pytest.mark.parametrize("variant", ["homing", "topological_nav learn=map", "topological_localisation"])
def test_ours_is_not_as_printed(variant: str):
    assert type(prepared(variant).graph.nodes["features"].stage).__name__ != "SiftAndVerticalSegments"
