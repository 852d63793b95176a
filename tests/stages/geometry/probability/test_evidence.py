import numpy as np
import pytest

from omninav.stages.geometry.probability.evidence import average, hazen_quantile


@pytest.mark.parametrize("quantile", [0.0, 0.2, 0.5, 0.8, 0.95, 1.0])
def test_a_quantile_is_numpys_to_the_bit(quantile: float) -> None:
    rng = np.random.default_rng(0)
    for number in (1, 2, 3, 10, 77, 260, 1000):
        values = rng.random(number).astype(np.float32)
        assert hazen_quantile(values, quantile) == float(np.quantile(values, quantile, method="hazen"))


def test_an_average_is_numpys_to_the_bit() -> None:
    rng = np.random.default_rng(1)
    for number in (1, 7, 130, 1001):
        values, weights = rng.random(number), rng.random(number)
        assert average(values, None) == np.average(values)
        assert average(values, weights) == np.average(values, weights=weights)
