import itertools

import numpy as np
import pytest
from small_run import collected

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.revisit_error import RevisitError, first_against_later, over_visits, visit_numbers
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


def test_errors_are_those_of_the_odometry_of_the_first_visit(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.metrics.revisit_error.AWAY_M", 0.5)
    found = RevisitError().step(CTX, there_and_back(3, 0.1, 1.0)).metrics.values["first_visits"]
    assert found["places"] == 11
    assert found["ratio"] == pytest.approx(1.0)
    assert found["correlation"] == pytest.approx(1.0)
    monkeypatch.setattr("omninav.stages.metrics.revisit_error.AWAY_M", 0.5)
    halved = RevisitError().step(CTX, there_and_back(3, 0.1, 0.5)).metrics.values["first_visits"]
    assert halved["ratio"] == pytest.approx(0.5)
    assert halved["odometry_error_m"] == pytest.approx(0.5)


def test_a_place_is_visited_again_once_the_robot_has_been_away():
    # Away by 3 m of path: still the same visit. By 6 m: another. A new log begins others everywhere.
    cells, ways = np.array([0, 1, 1, 0, 1, 1, 0, 0]), np.array([np.inf, 1, 1, 1, 3, 1, 2, np.inf])
    assert visit_numbers(cells, ways, 5.0).tolist() == [1, 1, 1, 1, 1, 1, 2, 3]


def test_each_number_of_visits_has_its_own_mean(monkeypatch: pytest.MonkeyPatch):
    drive = there_and_back(2, 0.1, 1.0)
    drive.estimate[20:, 1] += 1.0  # the second time
    monkeypatch.setattr("omninav.stages.metrics.revisit_error.AWAY_M", 0.5)
    visits = RevisitError().step(CTX, drive).metrics.values["visits"]
    # The nine places between the ends are passed four times, 0.1 to 0.9 m off; the ends twice.
    assert visits == {"number": [1, 2, 3, 4], "position_error_m": pytest.approx([0.5, 0.5, 1.5, 1.5]), "places": 9}


def test_the_places_are_the_same_at_every_visit():
    # Places 0 and 1, near the start, are exact and come four times; 2, 3 and 4 are 1 m off and come twice or once.
    cells = np.array([0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 3, 3, 4])
    numbers = np.array([1, 2, 3, 4, 1, 2, 3, 4, 1, 2, 1, 2, 1])
    found = over_visits(cells, numbers, np.array([0.0] * 8 + [1.0] * 5))
    assert found == {"number": [1, 2], "position_error_m": [0.5, 0.5], "places": 4}


def test_every_place_counts_alike_however_many_frames_a_visit_has():
    cells, numbers = np.array([0, 0, 0, 1, 0, 1]), np.array([1, 1, 1, 1, 2, 2])
    found = over_visits(cells, numbers, np.array([1.0, 2.0, 3.0, 4.0, 5.0, 9.0]))
    assert found == {"number": [1, 2], "position_error_m": [3.0, 7.0], "places": 2}


def test_nothing_is_measured_without_truth():
    blind = collected([Tick(0, 0)], [None])
    assert RevisitError().step(CTX, blind).metrics.values == {}


def test_a_place_is_a_square_of_a_metre_and_another_visit_begins_beyond_five():
    stage = RevisitError()
    xs = [0.1, 0.9, 1.1, 3.0, 0.5, 5.0, 0.5]  # back in the first cell after 4.4 m, and after 9 m
    truth = [Pose(x, -0.5, 0.0) for x in xs]
    seen = [PoseEstimate(Pose(x, k - 0.5, 0.0), np.eye(3), 1.0, Pose(x, 0.0, 0.0)) for k, x in enumerate(xs)]
    visits = stage.step(CTX, collected([Tick(n, n) for n in range(7)], truth, None, seen)).metrics.values
    # At their first visits four places are off by (0 + 1 + 4) / 3, 2, 3 and 5 m; only one comes twice.
    first = (5 / 3 + 2.0 + 3.0 + 5.0) / 4
    assert visits == {"visits": {"number": [1], "position_error_m": [pytest.approx(first)], "places": 4}}


def seen_at(places: list[tuple[float, float, float]]):
    """`visits` of a robot that was at these true poses, with estimates 1 m off."""
    truth = [Pose(*place) for place in places]
    seen = [PoseEstimate(Pose(x, y + 1.0, turn), np.eye(3), 1.0, Pose(x, y, turn)) for x, y, turn in places]
    drive = collected([Tick(n, n) for n in range(len(truth))], truth, None, seen)
    return RevisitError().step(CTX, drive).metrics.values["visits"]


def test_a_place_is_a_cell_of_the_floor_whichever_way_the_robot_looks(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("omninav.stages.metrics.revisit_error.PLACE_M", 2.0)
    places = [(0.5, 0.5, 0.0), (1.5, 1.5, 2.0), (2.0, 0.5, 0.0), (0.5, 2.5, 0.0)]
    assert seen_at(places) == {"number": [1], "position_error_m": [1.0], "places": 3}


def test_five_and_a_half_metres_are_away():
    found = seen_at([(0.5, 0.0, 0.0), (3.25, 0.0, 0.0), (0.5, 0.0, 0.0), (3.25, 0.0, 0.0)])
    assert found == {"number": [1, 2], "position_error_m": [1.0, 1.0], "places": 2}


def test_figures_are_means_over_the_places_that_were_visited_again():
    cells = np.array([0, 0, 1, 2, 0, 1, 1, 2, 3])
    numbers = np.array([1, 1, 1, 1, 2, 2, 3, 2, 1])
    odometry = np.array([1.0, 3.0, 4.0, 6.0, 50.0, 50.0, 50.0, 50.0, 99.0])
    errors = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 2.0, 6.0, 4.0, 0.0])
    found = first_against_later(cells, numbers, errors, odometry)
    assert found == {
        "places": 3,
        "odometry_error_m": 4.0,
        "position_error_m": 3.0,
        "ratio": 0.75,
        "correlation": pytest.approx(np.corrcoef([2.0, 4.0, 6.0], [1.0, 4.0, 4.0])[0, 1]),
    }
    assert first_against_later(cells, numbers, np.ones(9), odometry)["correlation"] is None
    assert first_against_later(cells, numbers, errors, np.ones(9))["correlation"] is None
    few = [0, 2, 4, 5]
    two = first_against_later(cells[few], numbers[few], errors[few], odometry[few])
    assert (two["places"], two["correlation"]) == (2, None)
    assert first_against_later(cells, numbers, errors, np.zeros(9))["ratio"] is None
    assert first_against_later(cells, numbers, errors, np.where(cells == 3, np.nan, odometry)) == {}
    assert first_against_later(cells, np.ones(9, int), errors, odometry) == {}


def test_a_log_begins_elsewhere_and_frames_without_truth_or_estimate_do_not_count():
    pose = Pose(0.5, 0.5, 0.0)
    seen = [PoseEstimate(pose, np.eye(3), 1.0, pose)] * 6
    ticks = [Tick(n, n, n // 2, n % 2) for n in range(6)]
    motion = [None, Motion(0.0, 0.0, 0.0)] * 3
    truth = [pose, pose, pose, pose, None, None]
    found = RevisitError().step(CTX, collected(ticks, truth, motion, [*seen[:3], None, *seen[4:]])).metrics
    assert found.values["visits"] == {"number": [1, 2], "position_error_m": [0.0, 0.0], "places": 1}
    assert found.values["first_visits"]["places"] == 1


def test_visits_are_told_apart_by_the_path_and_not_by_frames():
    cells = np.array([0, 1, 0, 1, 0])
    assert visit_numbers(cells, np.array([np.inf, 2.5, 2.5, 2.5, 2.625]), 5.0).tolist() == [1, 1, 1, 1, 2]
    assert visit_numbers(cells, np.array([np.inf, 0.0, np.inf, 0.0, 0.0]), 5.0).tolist() == [1, 1, 2, 2, 2]
