import pytest
from small_run import collected, small_run

from omninav.pipeline import Tick
from omninav.pipeline.engine.codec import decode, encode
from omninav.stages.values.drive_tally import DriveTally


def test_every_tick_has_its_row():
    run = small_run(frames=12, logs=2)
    drive = run.drive
    assert drive.stamps.tolist() == [tick.stamp for tick in run.ticks]
    assert drive.truth[:, 0].tolist() == [pose.x for pose in run.truth]
    assert drive.estimate[:, 0].tolist() == [estimate.pose.x for estimate in run.estimates]
    assert drive.mode_weight.tolist() == [estimate.mode_weight for estimate in run.estimates]
    assert drive.motion[1:12, 0].tolist() == [motion.x for motion in run.motion[1:12]]


def test_contacts_and_metres_of_a_simulated_robot_are_kept():
    ticks = [Tick(0, 0), Tick(1, 10**9)]
    drive = collected(ticks, [None, None], tallies=[DriveTally(0, 0.0), DriveTally(2, 0.5)])
    assert drive.collisions.tolist() == [0, 2]
    assert drive.distance.tolist() == [0.0, 0.5]


def test_sequences_of_different_length_are_an_error():
    with pytest.raises(ValueError, match="shorter"):
        collected([Tick(0, 0)], [])


def test_a_drive_survives_being_written():
    drive = small_run(frames=5).drive
    assert encode(decode(encode(drive))) == encode(drive)
