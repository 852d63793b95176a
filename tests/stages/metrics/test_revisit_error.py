import numpy as np
import pytest
from measured_drives import AT_ORIGIN, Row, figures, made_drive, on_x

from omninav.stages.metrics.revisit_error import RevisitError, first_against_later, over_visits, visit_numbers

MODULE = "omninav.stages.metrics.revisit_error"


def there_and_back(times: int, drift: float, kept: float):
    """Along a line of 10 m and back, `times` times. Odometry drifts sideways by `drift` a metre, and the estimate is
    off by `kept` of what odometry was off by when it first came there."""
    xs = np.concatenate([[*range(10), *range(10, 0, -1)]] * times) + 0.5
    believed = [(x, 0.5 + kept * drift * (x - 0.5), 0.0) for x in xs]
    return made_drive(on_x(xs, 0.5), believed, [None, *[(step, drift, 0.0) for step in np.diff(xs)]])


@pytest.mark.parametrize("kept", [1.0, 0.5])
def test_errors_are_those_of_the_odometry_of_the_first_visit(kept: float, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.AWAY_M", 0.5)
    assert figures(RevisitError(), there_and_back(3, 0.1, kept))["first_visits"] == {
        "places": 11,
        "ratio": pytest.approx(kept),
        "correlation": pytest.approx(1.0),
        "odometry_error_m": pytest.approx(0.5),
        "position_error_m": pytest.approx(0.5 * kept),
    }


def test_each_number_of_visits_has_its_own_mean(monkeypatch: pytest.MonkeyPatch):
    drive = there_and_back(2, 0.1, 1.0)
    drive.estimate[20:, 1] += 1.0  # the second time
    monkeypatch.setattr(f"{MODULE}.AWAY_M", 0.5)
    visits = figures(RevisitError(), drive)["visits"]
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
    assert figures(RevisitError(), made_drive([None])) == {}


def seen_at(places: list[Row], errors: list[float] | float = 1.0):
    """`visits` of a robot that was at these true poses, with estimates so far (m) to the side."""
    truth = np.array(places)
    offsets = np.outer(np.broadcast_to(errors, len(truth)), (0.0, 1.0, 0.0))
    (visits,) = figures(RevisitError(), made_drive(truth, truth + offsets)).values()
    return visits


def test_a_place_is_a_square_of_a_metre_and_another_visit_begins_beyond_five():
    xs = [0.1, 0.9, 1.1, 3.0, 0.5, 5.0, 0.5]  # back in the first cell after 4.4 m, and after 9 m
    # At their first visits four places are off by (0 + 1 + 4) / 3, 2, 3 and 5 m; only one comes twice.
    first = (5 / 3 + 2.0 + 3.0 + 5.0) / 4
    visits = seen_at(on_x(xs, -0.5), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    assert visits == {"number": [1], "position_error_m": [pytest.approx(first)], "places": 4}


def test_a_place_is_a_cell_of_the_floor_whichever_way_the_robot_looks(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.PLACE_M", 2.0)
    places: list[Row] = [(0.5, 0.5, 0.0), (1.5, 1.5, 2.0), (2.0, 0.5, 0.0), (0.5, 2.5, 0.0)]
    assert seen_at(places) == {"number": [1], "position_error_m": [1.0], "places": 3}


def test_five_and_a_half_metres_are_away():
    assert seen_at(on_x([0.5, 3.25, 0.5, 3.25])) == {"number": [1, 2], "position_error_m": [1.0, 1.0], "places": 2}


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
    here = (0.5, 0.5, 0.0)
    truth, believed = [*[here] * 4, None, None], [*[here] * 3, None, *[here] * 2]
    found = figures(RevisitError(), made_drive(truth, believed, [None, AT_ORIGIN] * 3, [0, 0, 1, 1, 2, 2]))
    assert found["visits"] == {"number": [1, 2], "position_error_m": [0.0, 0.0], "places": 1}
    assert found["first_visits"]["places"] == 1


def test_visits_are_told_apart_by_the_path_and_not_by_frames():
    cells = np.array([0, 1, 0, 1, 0])
    assert visit_numbers(cells, np.array([np.inf, 2.5, 2.5, 2.5, 2.625]), 5.0).tolist() == [1, 1, 1, 1, 2]
    assert visit_numbers(cells, np.array([np.inf, 0.0, np.inf, 0.0, 0.0]), 5.0).tolist() == [1, 1, 2, 2, 2]
