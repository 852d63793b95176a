import math

import numpy as np
import pytest

from omninav.stages.monitor.consistency import consistency, log_odds_of_right


def test_places_agree_by_their_squared_distance_in_widths() -> None:
    pose = np.array([1.0, -1.0, 3.0])
    places = pose + np.array([[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 2.0, 0.5 - 2.0 * math.pi]])
    expected = [1.0, math.exp(-0.5), math.exp(-8.0), math.exp(-2.0)]  # 0, 1, 4 and 1 + 1 squared widths
    assert consistency(places, pose, 2.0, 0.5) == pytest.approx(expected, rel=1e-9)


def test_log_odds_worked_by_hand_of_an_image_against_and_one_for() -> None:
    # Right: shares are uniform, 1/2 for one image, B(2, 2) = 1/6 for one of each. Wrong: Beta(1, 4), 1/5 for an image
    # that agrees, 4/5 for one that does not, B(2, 5) / B(1, 4) = 2/15 for one of each. Changed between: 0.1 x 0.5.
    one = log_odds_of_right(np.ones(1), np.zeros(1), np.ones(1), 0.2, 5.0, 0.1)
    assert one == pytest.approx(math.log(0.5 / 0.2))
    both = log_odds_of_right(np.array([0.0, 1.0]), np.array([1.0, 0.0]), np.array([1.0, 0.5]), 0.2, 5.0, 0.1)
    assert both == pytest.approx(math.log((1 / 6 + 0.05 * 0.8 * 0.5) / (2 / 15 + 0.05 * 0.5 * 0.2)))
    reverse = log_odds_of_right(np.array([1.0, 0.0]), np.array([0.0, 1.0]), np.array([1.0, 0.5]), 0.2, 5.0, 0.1)
    assert reverse == pytest.approx(math.log((1 / 6 + 0.05 * 0.2 * 0.5) / (2 / 15 + 0.05 * 0.5 * 0.8)))
    assert log_odds_of_right(*np.zeros((3, 0)), 0.2, 5.0, 0.1) == 0.0
