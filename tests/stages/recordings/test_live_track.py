import numpy as np
import pytest

from omninav.stages.recordings.live_track import LiveTrack
from omninav.stages.recordings.plausibility import MotionLimits

S = 10**9


def straight(track: LiveTrack, seconds: np.ndarray, x0: float = 0.0) -> list[float]:
    """A robot that drives 1 m/s along x; the times of what came to be believed."""
    believed: list[float] = []
    for at in seconds:
        believed += track.add(round(at * S), (x0 + at, 0.0, 0.0), at)
    return believed


def test_a_pose_between_two_messages_is_interpolated_and_one_beyond_them_is_not_known():
    track = LiveTrack(MotionLimits(), jumps=False)
    straight(track, np.array([1.0, 2.0]))
    assert track.at(1 * S) == pytest.approx([1, 0, 0])
    assert track.at(round(1.25 * S)) == pytest.approx([1.25, 0, 0])
    assert track.at(round(2.5 * S)) is None
    assert track.at(round(0.5 * S)) is None


def test_a_single_stamp_that_leaps_ahead_or_back_costs_itself():
    track = LiveTrack(MotionLimits(), jumps=False)
    straight(track, np.arange(1.0, 3.0, 0.1))
    assert track.add(100 * S, (3.0, 0, 0)) == []
    assert track.add(1 * S, (3.0, 0, 0)) == []
    assert track.add(round(2.9 * S), (3.0, 0, 0)) == []  # once more the last one
    assert len(straight(track, np.arange(3.0, 4.0, 0.1))) == 10
    assert track.dropped == {"lone_stamp": 1, "backward_stamp": 1, "duplicate_stamp": 1}
    assert track.details["backward_stamp"].startswith("a pose of 1.000 s, 0.10 m and -1.900 s from the one before")


def test_a_track_goes_on_after_ten_seconds_and_is_known_for_thirty():
    track = LiveTrack(MotionLimits(), jumps=False)
    assert straight(track, np.arange(0.0, 31.0, 10.0)) == [0.0, 10.0, 20.0, 30.0]
    assert track.add(40 * S + 1, (40.0, 0, 0)) == []
    assert track.at(0) == pytest.approx([0, 0, 0])
    straight(track, np.array([31.0]))
    assert (track.at(9 * S), track.at(10 * S).tolist()) == (None, [10.0, 0.0, 0.0])


def test_a_counter_that_was_reset_is_joined_to_where_it_was_and_the_gap_is_known():
    track = LiveTrack(MotionLimits(), jumps=False)
    straight(track, np.arange(0.0, 5.05, 0.1))
    for begin, end, number in ((5.1, 6.05, 0), (6.1, 6.15, 11), (6.2, 7.05, 9)):
        assert len(straight(track, np.arange(begin, end, 0.1), x0=-100.0)) == number  # all are kept after a second
    assert len(straight(track, np.arange(7.1, 9.05, 0.1), x0=50.0)) == 20
    assert [track.at(at * S)[0] for at in (6, 8)] == pytest.approx([6, 8])
    assert track.reported(track.at(8 * S)) == pytest.approx([58, 0, 0])
    assert [track.unmeasured_s2(at * S) for at in (4, 6, 8)] == pytest.approx([0, 0.01, 0.02])
    straight(track, np.arange(1.0, 3.05, 0.1))  # a clock that is set back for good begins again
    assert (track.last, track.at(6 * S), track.unmeasured_s2(8 * S)) == (3 * S, None, 0.0)


@pytest.mark.parametrize("back_m", [1.0, 2.0, 8.0, 20.0])
@pytest.mark.parametrize("turned", [0.0, 1.5])
def test_a_counter_that_begins_again_nearby_or_turned_is_joined_too(back_m: float, turned: float):
    track = LiveTrack(MotionLimits(), jumps=False)
    straight(track, np.arange(0.0, 10.0, 0.05))
    for at in np.arange(10.0, 20.0, 0.05):
        away = at - back_m
        track.add(round(at * S), (away * np.cos(turned), away * np.sin(turned), turned))
    assert track.at(track.last) == pytest.approx([19.95, 0.0, 0.0], abs=1e-6)
    assert track.unmeasured_s2(track.last) == pytest.approx(0.05**2)


def test_a_single_wrong_pose_is_dropped_though_messages_are_missing_after_it():
    track = LiveTrack(MotionLimits(), jumps=False)
    straight(track, np.arange(0.0, 10.0, 0.05))
    track.add(10 * S, (15.0, 0.0, 0.0))
    straight(track, np.arange(10.5, 12.0, 0.05))
    assert track.at(track.last) == pytest.approx([11.95, 0.0, 0.0])
    assert track.dropped == {"impossible_motion": 1}


def test_odometry_that_was_joined_goes_on_where_a_clock_is_set_back():
    track = LiveTrack(MotionLimits(), jumps=False)
    straight(track, np.arange(0.0, 5.0, 0.05))
    straight(track, np.arange(5.0, 8.0, 0.05), x0=-100.0)
    for at in np.arange(8.0, 10.0, 0.05):  # stamped 1.3 s too early from now on
        track.add(round((at - 1.3) * S), (at - 100.0, 0.0, 0.0))
    assert track.at(track.last)[0] == pytest.approx(9.95, abs=0.1)


def test_over_a_jump_after_a_pause_the_robot_goes_one_step_and_not_as_far_as_it_might_have():
    track = LiveTrack(MotionLimits(), jumps=False)
    straight(track, np.arange(0.0, 5.05, 0.1))
    straight(track, np.arange(8.0, 10.05, 0.1), x0=-100.0)
    assert track.at(8 * S) == pytest.approx([5.1, 0, 0], abs=1e-6)  # 0.1 s ahead as before, and not 3 s
    assert track.at(9 * S) == pytest.approx([6.1, 0, 0], abs=1e-6)
    assert track.unmeasured_s2(9 * S) == pytest.approx(9.0)


def test_a_silence_is_a_gap_once_whether_the_track_goes_on_or_was_reset():
    for pause, shift in ((8.0, 0.0), (8.0, -1000.0), (20.0, 0.0)):
        track = LiveTrack(MotionLimits(), jumps=False)
        straight(track, np.arange(0.0, 5.05, 0.1))
        straight(track, np.arange(5.0 + pause, 8.05 + pause, 0.1), x0=shift)
        assert track.unmeasured_s2(round((7 + pause) * S)) == pytest.approx(pause**2)
        assert track.dropped == ({} if shift else {"odometry_silence": 1})


def test_nothing_is_true_in_a_silence_and_while_a_robot_is_carried_and_slow_truth_is_interpolated():
    for pause, shift, known in ((2.0, 0.0, False), (0.1, 99.0, False), (0.9, 0.0, True)):
        track = LiveTrack(MotionLimits(), jumps=True)
        straight(track, np.arange(0.0, 5.05, 0.1))
        straight(track, np.arange(5.0 + pause, 8.05 + pause, 0.1), x0=shift)
        assert (track.at(round((5 + pause / 2) * S)) is not None) == known
        assert track.at(round((5 + pause) * S)) == pytest.approx([5 + pause + shift, 0, 0])
    track = LiveTrack(MotionLimits(), jumps=True)
    straight(track, np.arange(0.0, 9.0, 3.0))
    assert track.at(5 * S) == pytest.approx([5, 0, 0])


def test_an_excursion_is_dropped_where_the_track_goes_on_as_before():
    track = LiveTrack(MotionLimits(), jumps=False)
    straight(track, np.arange(0.0, 2.0, 0.1))
    straight(track, np.arange(2.0, 2.5, 0.1), x0=500.0)
    straight(track, np.arange(2.5, 4.0, 0.1))
    assert track.dropped == {"impossible_motion": 5}
    assert track.at(3 * S) == pytest.approx([3, 0, 0])


def test_a_track_that_is_fed_with_what_another_kept_gives_the_same():
    rng = np.random.default_rng(3)
    one, other = (LiveTrack(MotionLimits(), jumps=False) for _ in range(2))
    kept: list[tuple[int, tuple[float, float, float]]] = []
    for number in range(600):
        stamp, shift = number * S // 20, 300.0 if 200 < number < 210 or number > 400 else 0.0
        stamp += int(rng.choice([0, 0, 0, 0, 0, 3600, -7]) * S)
        pose = (number / 20 + shift + float(rng.normal(0, 0.01)), 0.0, float(rng.normal(0, 0.01)))
        kept += one.add(stamp, pose, (stamp, pose))
    for stamp, pose in kept:
        other.add(stamp, pose)
    assert sum(one.dropped.values()) > 50
    assert not other.dropped
    for at in range(1, 29):
        here, there = one.at(at * S), other.at(at * S)
        assert (here is None) == (there is None)
        assert here is None or here.tobytes() == there.tobytes()
