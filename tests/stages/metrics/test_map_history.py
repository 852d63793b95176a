import dataclasses

import numpy as np
import pytest
from measured_drives import figures, made_drive, on_x

from omninav.stages.metrics.map_history import MapHistory, counted, last_new_ground
from omninav.stages.values.drive import Drive
from omninav.stages.values.view_mixtures import ViewEvent


def event(views, inserted=(), seen=(), removed=()):
    came, at, went = (np.array(each, np.int64) for each in (inserted, seen, removed))
    return ViewEvent(views, views, came, at, went, "", came, np.zeros(len(came)), np.zeros((len(came), 2)), came)


def line(*xs: float | None, off: float = 0.0, stretched: float = 1.0, logs: list[int] | None = None) -> Drive:
    """A drive along x (None: no truth); estimates lie so far (m) to its side, odometry stretches its steps."""
    at = [x or 0.0 for x in xs]
    motion = [None, *[(stretched * step, 0.0, 0.1) for step in np.diff(at)]]
    return made_drive(on_x(xs), on_x(at, off), motion, logs)


def history(drive: Drive, events=None, after_last=None, **parameters):
    events = [event(0)] * len(drive) if events is None else events
    return figures(MapHistory(**parameters), drive, events, after_last)


def test_a_reference_comes_when_it_is_seen_and_goes_when_it_is_removed():
    events = [None, None, event(3, [0, 1, 2], [0, 0, 1]), None, event(3, [3], [2], [1])]
    # References and components as the map has them; of four that came two were seen in frame 0, one in 1, one in 2.
    assert counted(events).tolist() == [[0, 0, 2, 0], [0, 0, 3, 0], [3, 3, 4, 0], [3, 3, 4, 0], [3, 3, 4, 1]]
    left_over = event(4, [4], [3])
    assert counted(events, left_over)[2:].tolist() == [[3, 3, 4, 0], [3, 3, 5, 0], [4, 4, 5, 1]]
    assert counted([None, None], event(1, [0], [1])).tolist() == [[0, 0, 0, 0], [1, 1, 1, 0]]


def test_a_known_map_is_there_before_the_first_event_with_what_that_removes():
    first = dataclasses.replace(event(2, [5], [1], [0]), components=7)
    assert counted([None, first]).tolist() == [[2, 7, 0, 0], [2, 7, 1, 1]]


@pytest.mark.parametrize(
    ("xs", "row"),
    [
        ([0.0, 4.0, 0.0], 2),  # it has not left the start by more than twice the radius
        ([0.0, 4.5, 0.0], 1),
        ([0.0, 6.5, 2.0], 1),  # within the radius of where it had been
        ([0.0, 6.5, 2.25], 2),
        ([0.0, 6.0, 2.0], 2),
        ([0.0, 5.0, 0.0, -5.0, 0.0], 3),  # however often it was back before
        ([0.0], 0),
    ],
)
def test_ground_is_new_beyond_the_radius_of_what_was_left(xs: list[float], row: int):
    assert last_new_ground(np.array([(0.0, x) for x in xs])) == row


def test_without_truth_there_are_counts_but_no_errors():
    found = history(line(None, None), [event(1, [0], [0]), event(2, [1], [1])])
    assert found["map_per_lap"]["inserted"] == [2]
    assert "first_map" not in found
    assert history(made_drive([])) == {}


def test_what_came_in_each_lap_is_told_of_it_alone():
    out_and_back = [0.0, 5.0, 10.0, 5.0]
    events = [event(k + 1, [k], [k]) for k in range(4)]  # four references in the first lap
    events += [event(5, [4], [4]), None, None, event(3, [], [], [0, 1])]
    events += [event(4, [5], [8]), event(4)]
    drive = line(*out_and_back, *out_and_back, 0.0, 5.0, logs=[0] * 8 + [1] * 2)
    found = history(drive, events)
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
    assert history(drive, events, points=4)["map_over_steps"]["step"] == [0, 3, 6, 9]


def test_of_one_lap_or_an_empty_map_nothing_came_after_the_first():
    one = history(line(0.0, 5.0, 10.0), [event(1, [0], [0]), None, None])
    assert one["map"] == {"inserted": 1, "removed": 0, "new_after_first_lap_rate": None}
    none = history(line(*[0.0, 5.0, 10.0, 5.0] * 2), [None] * 4 + [event(1, [0], [4])] + [None] * 3)
    assert none["map_per_lap"]["inserted"] == [0, 1]
    assert none["map"]["new_after_first_lap_rate"] is None


def test_what_was_learned_after_the_end_counts_to_the_last_frame():
    found = history(line(0.0, 5.0, 10.0), [None] * 3, event(2, [0, 1], [0, 2]))
    assert found["map_over_steps"]["inserted"] == [1, 1, 2]
    assert found["map_over_steps"]["references"] == [0, 0, 2]


def test_sixty_steps_are_told():
    assert len(history(line(*range(201)))["map_over_steps"]["step"]) == 60


@pytest.mark.parametrize(
    ("xs", "frames"),
    [
        pytest.param([0.0, 5.0, 1.9, 5.0], [2, 2], id="within two metres"),
        pytest.param([0.0, 5.0, 2.1, 5.0], [4], id="beyond them"),
        pytest.param([None, 0.0, 5.0, None, 0.5, 5.0], [4, 2], id="also where truth is missing"),
    ],
)
def test_laps_are_counted_in_frames_of_the_log(xs: list[float | None], frames: list[int]):
    assert history(line(*xs))["map_per_lap"]["frames"] == frames


def test_the_first_map_ends_with_the_last_new_ground():
    drive = line(None, 0.0, 1.0, 6.0, 7.0, 6.0, 1.0, off=0.25, stretched=2.0)
    first = history(drive)["first_map"]
    assert (first["frames"], first["driven_m"]) == (6, 8.0)  # the end is where it had been
    assert first["estimate"]["position_error_m"]["max"] == first["estimate"]["final_error_m"] == 0.25
    assert first["estimate"]["final_heading_error_deg"] == 0.0
    alone = first["odometry_alone"]
    away = np.hypot(*(drive.odometry_alone() - drive.truth)[1:6, :2].T)
    assert alone["position_error_m"]["mean"] == pytest.approx(away.mean())
    assert alone["final_error_m"] == pytest.approx(away[-1])
    assert alone["final_heading_error_deg"] == pytest.approx(np.degrees(0.4))
    assert alone["heading_error_deg"]["median"] == pytest.approx(np.degrees(0.2))


def test_without_odometry_or_estimates_there_is_no_drift():
    assert history(made_drive(on_x([0.0, 1.0])))["first_map"] == {}
    seen = line(0.0, 1.0)
    seen.motion[:] = np.nan
    assert "odometry_alone" not in history(seen)["first_map"]


def test_what_is_new_is_a_share_of_the_references_of_the_first_lap_up_to_the_last_frame():
    events = [dataclasses.replace(event(2, [0, 1], [0, 0]), components=7), None]
    events += [event(1, removed=[1]), event(1, [2], [3], [0])]
    found = history(line(0.0, 5.0, None, None, logs=[0, 0, 1, 1]), events)
    assert found["map"] == {"inserted": 3, "removed": 2, "new_after_first_lap_rate": 0.5}
    assert found["map_per_lap"]["removed"] == [0, 2]
    assert found["first_map"]["frames"] == 2  # only the first log has ground truth
