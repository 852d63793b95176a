"""Samples, and how many of them are needed."""

import math

import numpy as np
import pytest

from omninav.stages.geometry.two_views.ransac import BATCH, samples_needed, samples_of


def test_no_row_is_twice_in_a_sample_and_every_row_is_drawn():
    samples = samples_of(12, 5, np.random.default_rng(0))
    assert samples.shape == (BATCH, 5)
    assert all(len(set(sample)) == 5 for sample in samples.tolist())
    assert set(samples.ravel().tolist()) == set(range(12))


@pytest.mark.parametrize(("share", "size"), [(0.5, 2), (0.3, 3), (0.8, 5)])
def test_after_as_many_samples_as_needed_the_chance_of_a_clean_one_is_as_asked(share: float, size: int):
    needed = samples_needed(share, size, 0.99)
    assert 1.0 - (1.0 - share**size) ** needed == pytest.approx(0.99)


def test_without_outliers_one_sample_is_enough_and_without_inliers_none_is():
    assert samples_needed(0.999, 5, 0.99) == 1.0
    assert samples_needed(0.0, 5, 0.99) == math.inf
