import math

import pytest
from measured_drives import figures, made_drive, on_x

from omninav.stages.metrics.homing_errors import HomingErrors
from omninav.stages.values.homing import HomingVector, PathProgress

MODULE = "omninav.stages.metrics.homing_errors"
EAST, NORTH = 0.0, math.pi / 2
HOME = (2.0, 1.0, NORTH)
PATH = [HOME, (2.0, 5.0, EAST), (2.0, 3.0, EAST), (2.0, 1.25, NORTH), (2.0, 0.5, NORTH + 0.1)]
"""Carried 4 m to the north of home, it drives back, comes as close as 0.25 m and ends 0.5 m beyond."""


def vector(direction, turn=0.0, inliers=10, state="tracking"):
    return HomingVector(0, direction, turn, 1.0, 1.0, 1.0, None, inliers, state)


def degrees(angle):
    return pytest.approx(math.degrees(angle))


def at(arrived):
    return PathProgress(path=0, at=0, of=1, target=0, last=True, docking=False, arrived=arrived)


VECTORS = [
    vector(1.0, 1.0, 99),  # before it was carried away: not measured
    vector(-math.pi / 2 + 0.2, math.pi / 2 - 0.3, 30),
    vector(0.0, 0.0, 50, "lost"),
    vector(2.0, 0.0, 10),  # within 0.3 m, where the direction hardly matters
    vector(-0.1 + 0.4, -0.1, 14),
]


def homing(path=PATH, vectors=VECTORS, arrived=(True, False, False, True, True), motion=None):
    drive = made_drive(path, motion=motion, every_s=2.0)
    found = figures(HomingErrors(), drive, vectors, [at(each) for each in arrived])
    return found and found["homing"]


def test_it_begins_where_it_was_carried_to_and_ends_with_its_last_pose_however_close_it_came_before(
    monkeypatch: pytest.MonkeyPatch,
):
    assert homing() == {
        "start_m": pytest.approx(4.0),
        "reached": 1,
        "arrived": 1,
        "end_error_m": pytest.approx(0.5),
        "end": {"error_m": {"mean": pytest.approx(0.5), "std": 0.0}, "frames": 1},
        "end_turn_deg": degrees(0.1),
        "time_s": 4.0,
        "lost_rate": pytest.approx(1 / 4),
        "direction_error_deg": {"median": degrees(0.3), "p90": degrees(0.38), "max": degrees(0.4)},
        "inliers": 14.0,
        "first": {"direction_error_deg": degrees(0.2), "turn_error_deg": degrees(0.3), "inliers": 30},
    }
    monkeypatch.setattr(f"{MODULE}.FROM_M", 0.1)
    assert homing()["direction_error_deg"]["max"] > 60.0


def test_a_robot_that_drives_on_away_from_home_begins_where_it_was_put_down():
    motion = [None, (0.0, 0.0, 0.0), (0.3, 0.0, 0.0), (-1.3, 0.0, 0.0)]
    vectors = [None, vector(EAST, 0.0, 7), vector(math.pi), vector(math.pi, 0.0, 8, "lost")]
    found = homing(on_x([0.0, 3.0, 3.3, 2.0]), vectors, (False, False, False, True), motion)
    assert (found["start_m"], found["time_s"], found["lost_rate"]) == (3.0, 4.0, pytest.approx(1 / 3))
    assert found["first"]["direction_error_deg"] == pytest.approx(180.0)


def test_a_vector_at_from_m_itself_is_not_measured(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(f"{MODULE}.FROM_M", 0.5)
    found = homing(on_x([0.0, 4.0, 0.5]), [None, vector(math.pi + 0.1), vector(math.pi + 0.7)], (False,) * 3)
    assert found["direction_error_deg"]["max"] == degrees(0.1)


def test_who_never_says_that_it_arrived_has_not():
    found = homing(arrived=(True, True, False, False, False))
    assert (found["arrived"], found["time_s"]) == (0, None)


@pytest.mark.parametrize(
    ("arrived", "reached", "within_60_cm"),
    [((False, False, True, True), 1, 1), ((False, False, False, True), 0, 1), ((False,) * 4, 0, 0)],
)
def test_it_has_reached_what_it_was_near_when_it_said_so(
    arrived, reached, within_60_cm, monkeypatch: pytest.MonkeyPatch
):
    given = on_x([0.0, 4.0, 0.5, 0.6]), [None, *[vector(math.pi)] * 3], arrived
    assert homing(*given)["reached"] == reached
    monkeypatch.setattr(f"{MODULE}.WITHIN_M", 0.6)
    assert homing(*given)["reached"] == within_60_cm


def test_where_the_target_was_never_found_no_error_is_told():
    lost = [None, *[vector(0.0, inliers=3, state="lost")] * 4]
    found = homing(vectors=lost)
    assert found["lost_rate"] == 1.0
    assert found["inliers"] is None
    assert found["direction_error_deg"] == {"median": None, "p90": None, "max": None}
    assert found["first"] == {"direction_error_deg": None, "turn_error_deg": None, "inliers": 3}
    assert found["end_error_m"] == pytest.approx(0.5)


def test_without_a_vector_or_with_a_gap_in_the_truth_nothing_is_measured():
    assert homing(vectors=[VECTORS[0], None, None, None, None]) is None
    assert homing(path=[*PATH[:2], None, *PATH[3:]]) is None


def test_it_was_carried_to_where_it_was_farthest_to_any_side():
    # Ahead of home by 5 m, then 3 m to its side, and turned most while it was near.
    path = [(0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (0.0, 3.0, 0.0), (0.25, 0.0, 3.0)]
    found = homing(path, [None, vector(math.pi), vector(-math.pi / 2), vector(1.0)], (False,) * 4)
    assert found["start_m"] == 5.0
    assert found["direction_error_deg"]["max"] == pytest.approx(0.0, abs=1e-9)


def test_angles_are_compared_the_short_way_around():
    path = [(0.0, 0.0, 3.0), (4.0, 0.0, -3.0), (3.0, 0.0, -3.0), (2.0, 0.0, -3.0)]
    ahead = math.pi + 3.0 - 2 * math.pi  # home is behind, and the robot almost looks there
    vectors = [None, *[vector(ahead + off - 2 * math.pi, 6.0 - 0.5) for off in (0.0, 0.0, 0.9)]]
    found = homing(path, vectors, (False,) * 4)
    assert found["direction_error_deg"]["median"] == pytest.approx(0.0, abs=1e-6)
    assert found["first"]["turn_error_deg"] == degrees(0.5)
