import numpy as np
import pytest

from omninav.stages.geometry.probability.evidence import centre_and_spread, hazen_quantile


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
