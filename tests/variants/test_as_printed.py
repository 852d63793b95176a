"""The variants of the papers as printed hold nothing of ours: every addition is off, and its stage left out or idle."""

import pytest

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.graph.graph import Graph
from omninav.pipeline.run.plan import plan


def graph_of(variant: str) -> Graph:
    with composed([f"variant={variant}"]) as config:
        return plan(complete(config)).graph


@pytest.fixture(scope="module")
def porta() -> Graph:
    return graph_of("particle_cml_as_printed")


@pytest.fixture(scope="module")
def gross() -> Graph:
    return graph_of("omniview_cml_as_printed")


def test_porta_and_kroese_learn_from_every_state_at_once_and_carry_nothing_back(porta: Graph):
    assert type(porta.nodes["map_update"].stage).__name__ == "ImmediateUpdate"
    assert "fixed_lag_smoother" not in porta.nodes


def test_porta_and_kroese_compare_views_as_they_are_with_their_brightness(porta: Graph):
    features = porta.nodes["features"].stage
    assert type(features).__name__ == "CosineTransform"
    assert (features.headings, features.contrast, features.mean) == (1, "none", True)


def test_porta_and_kroese_merge_half_and_half_without_the_spread_of_the_means(porta: Graph):
    mapping = porta.nodes["mapping"].stage
    assert (mapping.average, mapping.spread) == ("halves", False)


def test_porta_and_kroese_have_points_for_places_and_resample_by_importance(porta: Graph):
    assert not porta.nodes["sensor"].stage.extent
    assert porta.nodes["sensor"].stage.views == "all"
    fusion = porta.nodes["fusion"].stage
    assert type(fusion).__name__ == "ConditionalResampling"
    assert (fusion.sampling, fusion.agree_above, fusion.keep) == ("importance", 1e-4, 0.8)
    assert fusion.outlier_probability == 0.0


def test_gross_merges_by_equation_14_to_the_letter(gross: Graph):
    mapping = gross.nodes["mapping"].stage
    assert type(mapping).__name__ == "AdaptiveViews"
    assert (mapping.state_covariance, mapping.forgetting) == ("every_update", "active")
    assert (mapping.min_sigma_m, mapping.min_sigma_deg) == (0.0, 0.0)


def test_gross_fuses_by_equations_2_to_8_and_superposes_all_similar_views(gross: Graph):
    fusion, sensor = gross.nodes["fusion"].stage, gross.nodes["sensor"].stage
    assert type(fusion).__name__ == "CovarianceIntersection"
    assert (fusion.alpha, fusion.weighted) == ("det_ratio", True)
    assert (sensor.views, sensor.extent) == ("all", False)


def test_gross_reconstructs_every_path_between_unimodal_states(gross: Graph):
    queue = gross.nodes["map_update"].stage
    assert type(queue).__name__ == "UnimodalQueue"
    assert queue.length > 0
    assert queue.reconstruct
    assert queue.odometry_gate == 0.0


def test_gross_describes_views_by_the_spectrum_of_their_colours(gross: Graph):
    features = gross.nodes["features"].stage
    assert type(features).__name__ == "SegmentSpectrum"
    assert (features.channels, features.contrast, features.mean) == ("colour", "none", True)


@pytest.mark.parametrize("variant", ["porta", "gross"])
def test_turns_are_odometrys_and_maps_stay_as_they_were_learned(variant: str, request: pytest.FixtureRequest):
    graph: Graph = request.getfixturevalue(variant)
    assert graph.nodes["visual_turn"].stage.max_sigma_deg == 0
    assert graph.nodes["straightened"].stage.max_distance == 0
    assert graph.nodes["straightened_at_last"].stage.max_distance == 0
    assert not {"pose_fixes", "proposals", "monitor"} & set(graph.nodes)
