"""Sensors that weigh by calibrated likelihood ratios."""

import math
from dataclasses import replace

import numpy as np
import pytest
from made_beliefs import even
from made_references import references

from omninav.pipeline import Context
from omninav.stages.sensor.calibrated_similarity import likelihood_ratios, novelty_and_kidnapping
from omninav.stages.sensor.near_references import NearReferences
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.pose import AssumedMotion, Motion
from omninav.stages.values.similarity import Similarities

CALIBRATION = SimilarityCalibration(slope=4.0, middle=1.0, images=100, right_distance_m=0.5, correlation_m=2.0)
PLACES = np.column_stack([np.arange(20.0), np.zeros(20), np.zeros(20)])
WALK = references(PLACES)


def similarities() -> Similarities:
    values = np.random.default_rng(1).uniform(0.2, 0.4, (20, 8)).astype(np.float32)
    values[5, 0] = 0.9
    return Similarities(values)


def weighed(
    poses: np.ndarray,
    motion: Motion | None = None,
    calibration: SimilarityCalibration = CALIBRATION,
    last_view: float | None = None,
):
    stage, ctx = NearReferences(independence_distance=1.0), Context("sensor")
    stage.setup(ctx)
    seen = replace(similarities(), last_view=last_view)
    return stage.step(ctx, seen, even(poses), WALK, motion, LengthScale(0.5), calibration)


def test_at_a_reference_the_weight_is_its_ratio_over_the_largest():
    ratios = likelihood_ratios(similarities(), CALIBRATION)
    found = weighed(PLACES).likelihood.values
    top = float(ratios.max())
    assert top == ratios[5, 0]
    # Its own reference has nearly all of the weight; a ratio below 1 counts as unknown.
    assert found[5] == pytest.approx(1.0, abs=0.02)
    assert found[12] == pytest.approx(max(float(ratios[12, 0]), 1.0) / top, rel=0.1)


def test_far_from_all_references_the_ratio_is_one():
    top = float(likelihood_ratios(similarities(), CALIBRATION).max())
    assert weighed(np.array([[5.0, 40.0, 0.0]])).likelihood.values[0] == pytest.approx(1 / top, rel=1e-5)


def test_evidence_is_new_after_the_distance_over_which_it_was_correlated():
    full = weighed(PLACES).likelihood
    half = weighed(PLACES, Motion(1.0, 0.0, 0.0)).likelihood
    assert half.novelty == pytest.approx(0.5)
    assert np.allclose(half.values, np.sqrt(full.values))
    assert half.mean_likelihood == full.mean_likelihood
    assert weighed(PLACES, Motion(3.0, 0.0, 0.0)).likelihood.novelty == 1.0


def test_a_calibration_that_says_nothing_weighs_all_places_alike():
    nothing = SimilarityCalibration(0.0, 0.0, 100, 0.5, 2.0)
    values = weighed(PLACES, calibration=nothing).likelihood.values
    assert values.max() / values.min() == pytest.approx(1.0, abs=1e-5)
    assert math.isfinite(float(values.sum()))


MOVED = Motion(0.2, 0.0, 0.0)
LOGARITHMS = np.log(similarities().best.astype(float))
EITHER = math.exp(LOGARITHMS.mean() + CALIBRATION.middle * LOGARITHMS.std())
"""Similarity that is as likely of the same place as of another one."""


@pytest.mark.parametrize(("last_view", "motion", "slope", "novelty", "carried"), [
    (0.9, MOVED, 8.0, 0.1, 0.0),  # the image continues the last
    (0.2, MOVED, 8.0, 1.0, 0.9 / 21.0),  # it looks like any other place: 0.9 of 1e-4 against 2e-3
    (EITHER, MOVED, 8.0, 0.55, 0.9e-4),  # as likely the one as the other
    (0.2, Motion(1.0, 0.0, 0.0), 8.0, 1.0, 0.5 / 21.0),  # the way explains half
    (0.2, Motion(2.0, 0.0, 0.0), 8.0, 1.0, 0.0),  # after so long a way it may
    (None, MOVED, 8.0, 0.1, 0.0),  # nobody compared
    (0.2, AssumedMotion(0.2, 0.0, 0.0, 1.0, 1.0), 8.0, 0.1, 0.0),  # nobody knows how far the robot drove
    (0.2, MOVED, 0.0, 0.1, 0.0),  # similarity says nothing of the place
])  # fmt: skip
def test_a_view_that_does_not_continue_the_last_is_new_and_says_that_the_robot_was_carried(
    last_view: float | None, motion: Motion, slope: float, novelty: float, carried: float
):
    seen, calibration = replace(similarities(), last_view=last_view), replace(CALIBRATION, slope=slope)
    assert novelty_and_kidnapping(seen, calibration, motion, calibration.correlation_m) == pytest.approx(
        (novelty, carried), rel=0.02, abs=1e-5
    )


@pytest.mark.parametrize("values", [np.zeros((20, 8)), np.full((1, 8), 0.3), np.full((20, 8), 0.3)])
def test_similarities_that_are_all_alike_tell_of_no_kidnapping(values: np.ndarray):
    seen = Similarities(values.astype(np.float32), last_view=0.29)
    assert novelty_and_kidnapping(seen, CALIBRATION, MOVED, CALIBRATION.correlation_m) == (0.1, 0.0)


@pytest.mark.parametrize(("last_view", "novelty", "carried"), [(0.9, 0.1, 0.0), (0.2, 1.0, 0.9 / 21.0)])
def test_the_likelihood_says_that_the_robot_was_carried(last_view: float, novelty: float, carried: float):
    said = weighed(PLACES, MOVED, replace(CALIBRATION, slope=8.0), last_view).likelihood
    assert (said.novelty, said.carried) == pytest.approx((novelty, carried), rel=0.02, abs=1e-5)
