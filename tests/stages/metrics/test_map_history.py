import dataclasses
import itertools

import numpy as np
import pytest
from small_run import collected, mixture_run, small_run

from omninav.pipeline import Context, Tick
from omninav.stages.geometry.plane.se2 import chain, compose
from omninav.stages.metrics.map_history import MapHistory, counted, last_new_ground
from omninav.stages.metrics.view_map_size import ViewMapSize, stored_bytes, visited_area
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.view_mixtures import ViewEvent, ViewMixtures

CTX = Context("metric")


@pytest.fixture(scope="module")
def run():
    return small_run(30, logs=2)


@pytest.fixture(scope="module")
def learned(run):
    return mixture_run(run)


@pytest.fixture(scope="module")
def history(run, learned):
    return MapHistory(points=7).step(CTX, run.drive, learned[2]).metrics.values


def test_what_came_less_what_went_is_what_is_in_the_map(history, learned):
    over = history["map_over_steps"]
    assert over["step"][0] == 0
    assert over["step"][-1] == 59
    assert len(over["step"]) == 7
    assert np.subtract(over["inserted"], over["removed"]).tolist() == over["references"]
    assert history["map"] == {"inserted": 60, "removed": 12, "new_after_first_lap_rate": 1.0}
    assert over["references"][-1] == len(learned[0]) == 48


def test_each_part_of_the_run_says_what_came_and_went_in_it(history):
    per_lap = history["map_per_lap"]
    assert per_lap["frames"] == [30, 30]
    assert per_lap["inserted"] == [30, 30]
    assert per_lap["removed"] == [6, 6]
    assert per_lap["references"] == [24, 48]


def event(views, inserted=(), seen=(), removed=()):
    came, at, went = (np.array(each, np.int64) for each in (inserted, seen, removed))
    return ViewEvent(views, views, came, at, went, "", came, np.zeros(len(came)), np.zeros((len(came), 2)), came)


def test_a_reference_comes_when_it_is_seen_and_goes_when_it_is_removed():
    events = [None, None, event(3, [0, 1, 2], [0, 0, 1]), None, event(3, [3], [2], [1])]
    # References and components as the map has them; of four that came two were seen in frame 0, one in 1, one in 2.
    assert counted(events).tolist() == [[0, 0, 2, 0], [0, 0, 3, 0], [3, 3, 4, 0], [3, 3, 4, 0], [3, 3, 4, 1]]
    left_over = event(4, [4], [3])
    assert counted(events, left_over)[2:].tolist() == [[3, 3, 4, 0], [3, 3, 5, 0], [4, 4, 5, 1]]
    assert counted([None, None], event(1, [0], [1])).tolist() == [[0, 0, 0, 0], [1, 1, 1, 0]]


def test_ticks_without_an_event_change_nothing():
    assert counted([None, None]).tolist() == [[0, 0, 0, 0], [0, 0, 0, 0]]


def test_a_map_that_was_known_is_there_before_the_first_event(learned):
    later = [dataclasses.replace(event, seen=event.seen - 39) for event in learned[2][40:]]
    counts = counted([None, *later])
    assert counts[0].tolist() == [learned[2][39].views, later[0].components, 0, 0]
    assert counts[1, 0] == later[0].views


def test_laps_of_the_first_log_are_parts_of_their_own(monkeypatch: pytest.MonkeyPatch):
    run = small_run(60)
    twice = small_run(60)
    run.ticks += [type(tick)(60 + n, tick.stamp + 6 * 10**9, 0, 60 + n) for n, tick in enumerate(twice.ticks)]
    run.estimates += twice.estimates
    run.truth += twice.truth
    run.motion += twice.motion
    events = mixture_run(run)[2]
    monkeypatch.setattr("omninav.stages.metrics.map_history.HOME_M", 1.0)
    found = MapHistory().step(CTX, run.drive, events).metrics.values
    assert found["map_per_lap"]["frames"] == [60, 60]
    assert found["first_map"]["frames"] == 59  # the last of the first lap is within a metre of the start


def turned(angles: list[float], radius: float = 5.0) -> np.ndarray:
    """Places on a circle (N, 2), a frame a degree, from each angle (degrees) to the next."""
    way = np.concatenate([np.arange(a, b, np.sign(b - a)) for a, b in itertools.pairwise(angles)])
    return radius * np.stack([np.cos(np.radians(way)), np.sin(np.radians(way))], axis=1)


def test_new_ground_ends_where_the_robot_comes_to_what_it_has_left_however_often_it_was_back_before():
    near = np.degrees(2 * np.arcsin(0.5 / 2 / 5.0))  # on the circle, half a metre from a place
    assert last_new_ground(turned([0, 360]), 0.5) == int(360 - near)
    assert last_new_ground(turned([0, 3 * 360]), 0.5) == int(360 - near)
    by_either_side = turned([0, 90, 0, -180, 0, -180])
    not_yet_left = np.degrees(2 * np.arcsin(1.0 / 2 / 5.0))  # turning where new ground ends: a metre back
    assert last_new_ground(by_either_side, 0.5) == int(180 + 180 + not_yet_left)
    assert last_new_ground(turned([0, 90]), 0.5) == 89
    standing = np.concatenate([turned([0, 90]), np.tile(turned([0, 1]), (9, 1))])
    assert last_new_ground(standing, 0.5) == 89


def test_the_drift_of_the_first_part_is_that_of_odometry_from_its_first_true_pose(history, run):
    first = history["first_map"]
    assert first["frames"] == 29  # the last of 30 is within 2 m of the first
    # odometry is the true motion times 1.05 in turn and way: by hand the last pose is off by the chained difference
    steps = np.array([[m.x, m.y, m.turn] if m else [0.0, 0.0, 0.0] for m in run.motion[:29]])
    true = np.array([[p.x, p.y, p.heading] for p in run.truth[:29]])
    alone = compose(true[0], chain(steps))
    assert first["odometry_alone"]["final_error_m"] == pytest.approx(np.hypot(*(alone - true)[-1, :2]))
    assert first["odometry_alone"]["position_error_m"]["max"] >= first["odometry_alone"]["final_error_m"]
    assert first["estimate"]["final_error_m"] < 0.2


def test_without_truth_there_are_counts_but_no_errors(run, learned):
    found = MapHistory().step(CTX, run.blind, learned[2]).metrics.values
    assert "first_map" not in found
    assert found["map_per_lap"]["inserted"] == [30, 30]
    assert MapHistory().step(CTX, collected([], []), []).metrics.values == {}


def test_the_size_of_a_map_is_that_of_its_arrays(learned, run):
    map = learned[0]
    views, components = 48, len(map.weights)
    # float32 values, names and births as 8 bytes; owner, mean, covariance, weight, count: 8 * (1 + 3 + 9 + 1 + 1)
    assert stored_bytes(map) == views * (4 * 6 + 16) + components * 120
    found = ViewMapSize().step(CTX, run.drive, map).metrics.values["map"]
    assert found["references"] == 48
    assert found["reference_size_bytes"] == stored_bytes(map) / 48
    assert found["references_per_m2"] == pytest.approx(48 / found["visited_area_m2"])


def test_the_area_along_a_line_is_a_strip_with_round_ends():
    line = np.stack([np.linspace(0, 40, 400), np.zeros(400)], axis=1)
    assert visited_area(line, 1.0) == pytest.approx(40 * 2 + np.pi, rel=0.06)
    assert visited_area(np.concatenate([line, line]), 1.0) == visited_area(line, 1.0)
    assert visited_area(np.empty((0, 2)), 1.0) == 0.0


def test_an_empty_map_has_no_density_and_an_unseen_path_no_area():
    drive = collected([Tick(0, 0)], [Pose(0.0, 0.0, 0.0)])
    found = ViewMapSize().step(CTX, drive, ViewMixtures.empty()).metrics.values["map"]
    assert found["references"] == 0
    assert found["reference_size_bytes"] is None
    assert found["references_per_m2"] == 0.0


def line(xs: list[float | None], off: float = 0.0, stretched: float = 1.0, logs: list[int] | None = None):
    """A drive along x (None: no truth); estimates lie so far (m) to its side, odometry stretches its steps."""
    at = [0.0 if x is None else x for x in xs]
    truth = [None if x is None else Pose(x, 0.0, 0.0) for x in xs]
    seen = [PoseEstimate(Pose(x, off, 0.0), np.eye(3), 1.0, Pose(x, off, 0.0)) for x in at]
    motion = [None, *[Motion(stretched * float(step), 0.0, 0.1) for step in np.diff(at)]]
    ticks = [Tick(n, n, log, n) for n, log in enumerate(logs or [0] * len(xs))]
    return collected(ticks, truth, motion, seen)


def test_what_came_in_each_lap_is_told_of_it_alone():
    out_and_back = [0.0, 5.0, 10.0, 5.0]
    events = [event(k + 1, [k], [k]) for k in range(4)]  # four references in the first lap
    events += [event(5, [4], [4]), None, None, event(3, [], [], [0, 1])]
    events += [event(4, [5], [8]), event(4)]
    drive = line([*out_and_back, *out_and_back, 0.0, 5.0], logs=[0] * 8 + [1] * 2)
    found = MapHistory().step(CTX, drive, events).metrics.values
    assert found["map_per_lap"] == {
        "frames": [4, 4, 2],
        "references": [4, 3, 4],
        "components": [4, 3, 4],
        "inserted": [4, 1, 1],
        "removed": [0, 2, 0],
    }
    assert found["map"] == {"inserted": 6, "removed": 2, "new_after_first_lap_rate": 0.5}
    assert found["map_over_steps"]["step"] == list(range(10))
    assert found["map_over_steps"]["removed"] == [0] * 7 + [2] * 3


def test_of_one_lap_or_an_empty_map_nothing_came_after_the_first():
    one = MapHistory().step(CTX, line([0.0, 5.0, 10.0]), [event(1, [0], [0]), None, None]).metrics.values
    assert one["map"] == {"inserted": 1, "removed": 0, "new_after_first_lap_rate": None}
    later = [None] * 4 + [event(1, [0], [4])] + [None] * 3
    none = MapHistory().step(CTX, line([0.0, 5.0, 10.0, 5.0] * 2), later).metrics.values
    assert none["map_per_lap"]["inserted"] == [0, 1]
    assert none["map"]["new_after_first_lap_rate"] is None


def test_what_was_learned_after_the_end_counts_to_the_last_frame():
    found = MapHistory().step(CTX, line([0.0, 5.0, 10.0]), [None] * 3, event(2, [0, 1], [0, 2])).metrics.values
    assert found["map_over_steps"]["inserted"] == [1, 1, 2]
    assert found["map_over_steps"]["references"] == [0, 0, 2]


def test_sixty_steps_are_told_and_laps_are_those_within_two_metres():
    drive = line(np.linspace(0.0, 200.0, 201).tolist())
    found = MapHistory().step(CTX, drive, [event(0)] * 201).metrics.values
    assert len(found["map_over_steps"]["step"]) == 60
    near, far = [0.0, 5.0, 1.9, 5.0], [0.0, 5.0, 2.1, 5.0]
    laps = [
        MapHistory().step(CTX, line(xs), [event(0)] * 4).metrics.values["map_per_lap"]["frames"] for xs in (near, far)
    ]
    assert laps == [[2, 2], [4]]


def test_laps_are_counted_in_frames_of_the_log_also_where_truth_is_missing():
    found = MapHistory().step(CTX, line([None, 0.0, 5.0, None, 0.5, 5.0]), [event(0)] * 6).metrics.values
    assert found["map_per_lap"]["frames"] == [4, 2]


def test_the_first_map_ends_with_the_last_new_ground():
    drive = line([None, 0.0, 1.0, 6.0, 7.0, 6.0, 1.0], off=0.25, stretched=2.0)
    first = MapHistory().step(CTX, drive, [event(0)] * 7).metrics.values["first_map"]
    assert (first["frames"], first["driven_m"]) == (6, 8.0)  # the end is where it had been
    assert first["estimate"]["position_error_m"]["max"] == first["estimate"]["final_error_m"] == 0.25
    assert first["estimate"]["final_heading_error_deg"] == 0.0
    alone = first["odometry_alone"]
    path = drive.odometry_alone()
    away = np.hypot(*(path - drive.truth)[1:6, :2].T)
    assert alone["position_error_m"]["mean"] == pytest.approx(away.mean())
    assert alone["final_error_m"] == pytest.approx(away[-1])
    assert alone["final_heading_error_deg"] == pytest.approx(np.degrees(0.4))
    assert alone["heading_error_deg"]["median"] == pytest.approx(np.degrees(0.2))


def test_without_odometry_or_estimates_there_is_no_drift():
    still = collected([Tick(n, n) for n in range(2)], [Pose(float(n), 0.0, 0.0) for n in range(2)])
    assert MapHistory().step(CTX, still, [event(0)] * 2).metrics.values["first_map"] == {}
    seen = line([0.0, 1.0])
    seen.motion[:] = np.nan
    assert "odometry_alone" not in MapHistory().step(CTX, seen, [event(0)] * 2).metrics.values["first_map"]


@pytest.mark.parametrize(
    ("xs", "row"),
    [
        ([0.0, 4.0, 0.0], 2),  # it has not left the start by more than twice the radius
        ([0.0, 4.5, 0.0], 1),
        ([0.0, 6.5, 2.0], 1),  # within the radius of where it had been
        ([0.0, 6.5, 2.25], 2),
        ([0.0, 6.0, 2.0], 2),
        ([0.0], 0),
    ],
)
def test_ground_is_new_beyond_the_radius_of_what_was_left(xs: list[float], row: int):
    assert last_new_ground(np.array([(0.0, x) for x in xs]), 2.0) == row


def test_what_is_new_is_a_share_of_the_references_of_the_first_lap_up_to_the_last_frame():
    events = [dataclasses.replace(event(2, [0, 1], [0, 0]), components=7), None]
    events += [event(1, removed=[1]), event(1, [2], [3], [0])]
    found = MapHistory().step(CTX, line([0.0, 5.0, None, None], logs=[0, 0, 1, 1]), events).metrics.values
    assert found["map"] == {"inserted": 3, "removed": 2, "new_after_first_lap_rate": 0.5}
    assert found["map_per_lap"]["removed"] == [0, 2]
    assert found["first_map"]["frames"] == 2  # only the first log has ground truth


def test_what_a_known_map_held_had_what_the_first_event_removes():
    assert counted([None, event(2, [5], [1], [0])]).tolist() == [[2, 2, 0, 0], [2, 2, 1, 1]]
