import pytest
from measured_drives import figures, made_drive

from omninav.stages.metrics.drive_summary import DriveSummary
from omninav.stages.values.episode_statistics import EpisodeStatistics


def summary(frames, motion=None, **given):
    return figures(DriveSummary(), made_drive([None] * frames, motion=motion, **given))["drive"]


def test_the_last_tally_counts_and_the_last_tick_ends_the_drive():
    tallies = [EpisodeStatistics(0, 0.5), EpisodeStatistics(1, 1.0), EpisodeStatistics(3, 1.5), None]
    assert summary(4, every_s=3.0, tallies=tallies) == {"collisions": 3, "distance_m": 1.5, "duration_s": 9.0}
    assert summary(0) == {"duration_s": 0.0, "distance_m": 0.0}


def test_a_real_robot_is_measured_by_its_odometry_in_every_direction_and_no_contact_is_claimed():
    found = summary(4, [None, (0.3, -0.4, 0.7), (0.0, 0.25, 0.0), (-0.5, 0.0, 0.0)])
    assert found["distance_m"] == 1.25
    assert "collisions" not in found


def test_a_robot_has_stopped_where_it_makes_no_way_between_its_first_move_and_its_last():
    # Half a second a frame, and none at all at the fifth. Ways ahead and aside (m); 0.015 m in it are 0.03 m/s.
    seconds = [0.0, 0.5, 1.0, 1.5, 2.0, 2.0, 2.5, 3.0, 3.5, 4.0]
    ahead, aside = [0.0, 0.0, 0.0, 0.02, 0.0, 0.01, 0.0, 0.0, 0.0], [0.0, 0.3, 0.0, 0.0, 0.0, 0.0, 0.0, 0.015, 0.0]
    motion = [None, *zip(ahead, aside, [0.1] * 9, strict=True)]
    drive = made_drive([None] * 10, motion=motion)
    drive.stamps[:] = [int(10**9 * at) for at in seconds]
    assert figures(DriveSummary(), drive)["drive"]["stopped_share"] == pytest.approx(1.5 / 3.0)


def test_ticks_that_come_less_often_while_it_stands_weigh_their_time_and_a_pause_between_logs_none():
    drive = made_drive([None] * 8, motion=[None, *[(0.5, 0.0, 0.0)] * 3, (0.0, 0.0, 0.0), *[(0.5, 0.0, 0.0)] * 3])
    drive.stamps[:] = [10**9 * at for at in (0, 1, 2, 3, 13, 14, 15, 16)]
    assert figures(DriveSummary(), drive)["drive"]["stopped_share"] == 10.0 / 16.0
    later, earlier = (made_drive([None] * 4, logs=[0, 0, 1, 1]) for _ in range(2))
    later.stamps[2:] += 86_400 * 10**9
    earlier.stamps[2:] -= 86_400 * 10**9
    assert [figures(DriveSummary(), each)["drive"]["duration_s"] for each in (later, earlier)] == [2.0, 2.0]
