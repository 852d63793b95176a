import pytest
from small_run import collected, small_run

from omninav.pipeline import Context, Tick
from omninav.stages.metrics.drive_summary import DriveSummary
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.pose import Motion


def summary(drive):
    return DriveSummary().step(Context("summary"), drive).metrics.values["drive"]


def test_a_simulated_robot_is_measured_by_its_tally():
    drive = collected(
        [Tick(0, 0), Tick(1, 10**9)], [None, None], tallies=[EpisodeStatistics(0, 0.0), EpisodeStatistics(2, 0.5)]
    )
    assert summary(drive) == {"collisions": 2, "distance_m": 0.5, "duration_s": 1.0}


def test_the_last_tally_counts_and_the_last_tick_ends_the_drive():
    ticks = [Tick(k, 10**9 * (2 + 3 * k)) for k in range(4)]
    drive = collected(
        ticks,
        [None] * 4,
        tallies=[EpisodeStatistics(0, 0.5), EpisodeStatistics(1, 1.0), EpisodeStatistics(3, 1.5), None],
    )
    assert summary(drive) == {"collisions": 3, "distance_m": 1.5, "duration_s": 9.0}
    assert summary(collected([], [])) == {"duration_s": 0.0, "distance_m": 0.0}


def test_a_real_robot_is_measured_by_its_odometry_and_no_contact_is_claimed():
    run = small_run(frames=12)
    found = summary(run.drive)
    assert "collisions" not in found
    assert found["distance_m"] == pytest.approx(
        sum((motion.x**2 + motion.y**2) ** 0.5 for motion in run.motion if motion)
    )


def test_a_robot_has_stopped_where_it_makes_no_way_between_its_first_move_and_its_last():
    # Half a second a frame, and none at all at the fifth. Ways ahead and aside (m); 0.015 m in it are 0.03 m/s.
    seconds = [0.0, 0.5, 1.0, 1.5, 2.0, 2.0, 2.5, 3.0, 3.5, 4.0]
    ways = [
        (0.0, 0.0),
        (0.0, 0.3),
        (0.0, 0.0),
        (0.02, 0.0),
        (0.0, 0.0),
        (0.01, 0.0),
        (0.0, 0.0),
        (0.0, 0.015),
        (0.0, 0.0),
    ]
    motion = [None, *(Motion(x, y, 0.1) for x, y in ways)]
    drive = collected([Tick(k, int(10**9 * at)) for k, at in enumerate(seconds)], [None] * 10, motion=motion)
    assert summary(drive)["stopped_share"] == pytest.approx(4 / 7)


def test_a_way_by_odometry_counts_in_every_direction():
    motion = [None, Motion(0.3, -0.4, 0.7), Motion(0.0, 0.25, 0.0), Motion(-0.5, 0.0, 0.0)]
    assert summary(collected([Tick(k, k) for k in range(4)], [None] * 4, motion=motion))["distance_m"] == 1.25
