"""The two filters that the papers on Monte Carlo localisation print."""

import pytest

from omninav.pipeline.cli.composition import complete, composed
from omninav.pipeline.run.plan import plan
from omninav.stages.features.haar_integral import Binning
from omninav.stages.features.hsv_histogram import HUE_BINS
from omninav.stages.fusion.importance_resampling import ImportanceResampling
from omninav.stages.fusion.uniform_recovery import RANDOM_PARTICLES, UniformRecovery
from omninav.stages.match.retrieval import Retrieval
from omninav.stages.match.selective import SelectiveMatch
from omninav.stages.sensor.expected_observation import ExpectedObservation
from omninav.stages.sensor.free_space_proposals import FreeSpaceProposals
from omninav.stages.sensor.visibility import WINDOW_DEG, Visibility
from omninav.stages.unwarp.window import PerspectiveWindow


@pytest.fixture
def printed(request):
    with composed([f"variant={request.param}_as_printed"]) as config:
        planned = plan(complete(config))
    graph = planned.graph
    maps = [artifact for artifact in planned.artifacts if artifact.name == "map"]
    return graph, maps[0].graph


def wired(graph, node):
    return {wire.to_port for wire in graph.wires if wire.to_node == node}


@pytest.mark.parametrize("printed", ["omniview_mcl"], indirect=True)
def test_gross_and_koenig(printed):
    graph, map = printed
    stages = {name: node.stage for name, node in graph.nodes.items()}
    sensor, fusion, match = stages["sensor"], stages["fusion"], stages["match"]
    # The view expected at a particle's pose, compared by the best segments under a root; no likelihood ratios.
    assert type(sensor) is ExpectedObservation
    assert "calibration" not in wired(graph, "sensor")
    assert type(match) is SelectiveMatch
    assert (match.penalty, HUE_BINS, stages["features"].value_bins) == ("sqrt", 16, 4)
    # The weight is a fixed power of S: no contrast of the image's own, no fade with distance, no floor.
    assert (sensor.power, sensor.fade_distance, sensor.background_quantile) == (8.0, None, None)
    # Each image is evidence.
    assert sensor.independence_distance == 0.0
    # Sampling, importance weights, resampling at each image; no particle comes from anywhere else.
    assert type(fusion) is ImportanceResampling
    assert (fusion.number, fusion.resample_below, fusion.adapt) == (5000, 1.0, "none")
    assert (fusion.recovery_share, fusion.kidnapping_probability) == (0.0, 0.0)
    assert stages["prior"].number == 5000
    assert stages["belief_estimate"].taken == "mode"
    # References by distance or dissimilarity: both rules are on, and of the same views.
    mapping = map.nodes["mapping"].stage
    assert mapping.distance_m > 0.1
    assert mapping.similarity > 0.0
    assert map.nodes["features"].parameters == graph.nodes["features"].parameters


@pytest.mark.parametrize("printed", ["retrieval_mcl"], indirect=True)
def test_wolf_burgard_and_burkhardt(printed):
    graph, map = printed
    stages = {name: node.stage for name, node in graph.nodes.items()}
    sensor, fusion, features = stages["sensor"], stages["fusion"], stages["features"]
    # Equations 7 and 8: the mean of the similarities as they are, over all views of an area alike, within 5 degrees.
    assert type(sensor) is Visibility
    assert (sensor.distance_sigma_m, sensor.independence_distance) == (None, 0.0)
    assert (WINDOW_DEG, sensor.retrieval) == (5.0, True)
    assert "calibration" not in wired(graph, "sensor")
    # Section VI-C: 50 of 5000 samples are drawn anew, anywhere in free space.
    assert type(fusion) is UniformRecovery
    assert (fusion.number, RANDOM_PARTICLES, stages["prior"].number) == (5000, 50, 5000)
    assert type(stages["proposals"]) is FreeSpaceProposals
    assert "area" in wired(graph, "prior")
    # Section IV: several kernels, of sizes up to twice their own; products without a root.
    assert (features.kernels, max(features.scales), features.root) == (((0.0, 1.0), (3.0, 4.0)), 2.0, False)
    # "One simply considers the different channels independently", so that 936 images take far less than 4 MB.
    assert (features.histogram, features.bins) == ("separate", 16)
    assert 936 * len(features.kernels) * len(features.scales) * 4 * Binning(8, joint=False).length < 0.6e6
    assert type(stages["match"]) is Retrieval
    # An ordinary camera; the mean of the samples is the estimate.
    assert type(stages["unwarp"]) is PerspectiveWindow
    assert stages["unwarp"].directions == 1
    assert map.nodes["unwarp"].stage.directions == 8
    assert stages["belief_estimate"].taken == "mean"
    assert map.nodes["features"].parameters == graph.nodes["features"].parameters
