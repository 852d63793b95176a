"""Whether a mixture has one mode."""

import numpy as np
import pytest

from omninav.stages.mapping.unimodality import unimodal_state
from omninav.stages.values.belief import GaussianMixture


def mixture(*parts: tuple[float, float]) -> GaussianMixture:
    """Components at these x (m) with these weights, each with sigma 1 m, 1 m and 0.1 rad."""
    places, weights = zip(*parts, strict=True)
    means = np.array([[x, 0.0, 0.0] for x in places])
    return GaussianMixture(means, np.tile(np.diag([1.0, 1.0, 0.01]), (len(parts), 1, 1)), np.array(weights))


def test_components_close_to_the_heaviest_are_merged_and_far_ones_left_out():
    mean, covariance = unimodal_state(mixture((0.0, 0.5), (1.0, 0.3), (20.0, 0.2)))
    assert mean[0] == pytest.approx(0.3 / 0.8)
    assert covariance[0, 0] == pytest.approx(1.0 + 0.3 / 0.8 * 0.5 / 0.8)  # theirs, and what lies between them


def test_nothing_has_no_mode():
    assert unimodal_state(GaussianMixture(np.empty((0, 3)), np.empty((0, 3, 3)), np.empty(0))) is None


@pytest.mark.parametrize(("apart", "one"), [(3.99, True), (4.0, True), (4.01, False)])
def test_components_up_to_the_limit_are_near_the_heaviest(apart: float, one: bool):
    # Squared distance with both covariances: 4^2 / (1 + 1) = 8. Together they hold all, alone the heaviest half.
    assert (unimodal_state(mixture((0.0, 0.5), (apart, 0.5)), 0.5, 8.0) is not None) == one


def test_a_share_is_of_the_whole_weight_and_must_be_exceeded():
    assert unimodal_state(mixture((0.0, 3.0), (20.0, 1.0)), 0.75) is None
    assert unimodal_state(mixture((0.0, 3.0), (20.0, 1.0)), 0.74) is not None
