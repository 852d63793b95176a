import math

import numpy as np
import pytest

from omninav.stages.geometry.probability.evidence import (
    best_headings,
    centre_and_spread,
    contrast_power,
    evidence_novelty,
    hazen_quantile,
)


@pytest.mark.parametrize("quantile", [0.0, 0.2, 0.5, 0.8, 0.95, 1.0])
def test_a_quantile_is_numpys_to_the_bit(quantile: float) -> None:
    rng = np.random.default_rng(0)
    for number in (1, 2, 3, 10, 77, 260, 1000):
        values = rng.random(number).astype(np.float32)
        assert hazen_quantile(values, quantile) == float(np.quantile(values, quantile, method="hazen"))


def test_centre_and_spread_are_numpys_to_the_bit() -> None:
    rng = np.random.default_rng(1)
    for number in (1, 7, 130, 1001):
        for weights in (None, rng.random(number)):
            values = rng.random(number).astype(np.float32)
            centre = np.average(values.astype(np.float64), weights=weights)
            variance = np.average(np.square(values - centre), weights=weights)
            assert centre_and_spread(values, weights) == (centre, np.sqrt(variance))


def test_the_best_heading_is_the_first_of_the_highest() -> None:
    best, at = best_headings(np.array([[1.0, 3.0, 3.0], [2.0, 0.0, 1.0]], np.float32))
    assert (best.tolist(), at.tolist()) == ([3.0, 2.0], [1, 0])


def test_similarities_are_spread_to_the_contrast() -> None:
    # Standard deviation of the logarithms 0.1; weighted 3 to 1, 0.1 sqrt(3/4).
    best = np.exp(np.array([-10.0, -9.8])).astype(np.float32)
    assert contrast_power(best, 3.0) == pytest.approx(30.0, rel=1e-5)
    assert contrast_power(best, 3.0, np.array([3.0, 1.0])) == pytest.approx(30.0 / math.sqrt(0.75), rel=1e-5)
    assert contrast_power(np.full(4, 0.5, np.float32), 3.0) == 1.0


def test_an_image_is_as_new_as_the_way_to_it() -> None:
    given = [(None, 2.0), (0.0, 0.0), (0.5, 2.0), (0.5, 0.8), (0.0, 2.0), (3.0, 2.0)]
    assert [evidence_novelty(*each) for each in given] == [1.0, 1.0, 0.25, 0.625, 0.05, 1.0]
