import itertools

import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.visited_places import VisitedPlaces, visit_numbers
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.pose import Motion, Pose

CTX = Context("metric")


def there_and_back(times: int, drift: float, kept: float):
    """Along a line of 10 m and back, `times` times. Odometry drifts sideways by `drift` a metre, and the estimate is
    off by `kept` of what odometry was off by when it first came there."""
    xs = np.concatenate([[*range(10), *range(10, 0, -1)]] * times).astype(float)
    truth = [Pose(x + 0.5, 0.5, 0.0) for x in xs]
    motion = [None, *(Motion(after.x - before.x, drift, 0.0) for before, after in itertools.pairwise(truth))]
    poses = [Pose(true.x, 0.5 + kept * drift * (true.x - 0.5), 0.0) for true in truth]
    estimates = [PoseEstimate(pose, np.eye(3), 1.0, pose) for pose in poses]
    return collected([Tick(n, n * 10**9) for n in range(len(truth))], truth, motion, estimates)


def test_errors_are_those_of_the_odometry_of_the_first_visit():
    found = VisitedPlaces(away_m=0.5).step(CTX, there_and_back(3, 0.1, 1.0)).metrics.values["first_visits"]
    assert found["places"] == 11
    assert found["ratio"] == pytest.approx(1.0)
    assert found["correlation"] == pytest.approx(1.0)
    halved = VisitedPlaces(away_m=0.5).step(CTX, there_and_back(3, 0.1, 0.5)).metrics.values["first_visits"]
    assert halved["ratio"] == pytest.approx(0.5)
    assert halved["odometry_error_m"] == pytest.approx(0.5)


def test_a_place_is_visited_again_once_the_robot_has_been_away():
    # Away by 3 m of path: still the same visit. By 6 m: another. A new log begins others everywhere.
    cells, ways = np.array([0, 1, 1, 0, 1, 1, 0, 0]), np.array([np.inf, 1, 1, 1, 3, 1, 2, np.inf])
    assert visit_numbers(cells, ways, 5.0).tolist() == [1, 1, 1, 1, 1, 1, 2, 3]


def test_each_number_of_visits_has_its_own_mean():
    drive = there_and_back(2, 0.1, 1.0)
    drive.estimate[20:, 1] += 1.0  # the second time
    visits = VisitedPlaces(away_m=0.5).step(CTX, drive).metrics.values["visits"]
    assert visits["number"] == [1, 2, 3, 4]
    assert visits["frames"] == [11, 11, 9, 9]
    assert visits["position_error_m"] == pytest.approx([0.5, (5.5 + 2.0) / 11, 1.5, 1.5])


def test_nothing_is_measured_without_truth():
    blind = collected([Tick(0, 0)], [None])
    assert VisitedPlaces().step(CTX, blind).metrics.values == {}
