import numpy as np
import pytest
from made_references import references
from small_run import collected, small_run

from omninav.pipeline import Context, Tick
from omninav.pipeline.engine.codec import decode, encode
from omninav.stages.metrics.collect_drive import CollectDrive
from omninav.stages.values.belief import PoseEstimate, SinglePose
from omninav.stages.values.confidence import PoseConfidence
from omninav.stages.values.episode_statistics import EpisodeStatistics
from omninav.stages.values.pose import Motion, Pose
from omninav.stages.values.similarity import BestMatch


def test_every_tick_has_its_row():
    run = small_run(frames=12, logs=2)
    drive = run.drive
    assert drive.stamps.tolist() == [tick.stamp for tick in run.ticks]
    assert drive.truth[:, 0].tolist() == [pose.x for pose in run.truth]
    assert drive.estimate[:, 0].tolist() == [estimate.pose.x for estimate in run.estimates]
    assert drive.mode_weight.tolist() == [estimate.mode_weight for estimate in run.estimates]
    assert drive.motion[1:12, 0].tolist() == [motion.x for motion in run.motion[1:12]]


def test_sequences_of_different_length_are_an_error():
    with pytest.raises(ValueError, match="shorter"):
        collected([Tick(0, 0)], [])


def test_a_drive_survives_being_written():
    drive = small_run(frames=5).drive
    assert encode(decode(encode(drive))) == encode(drive)


def test_every_column_holds_what_the_tick_brought():
    covariance = np.arange(9.0).reshape(3, 3)
    estimate = PoseEstimate(Pose(1.0, 2.0, 0.3), covariance, 0.75, Pose(4.0, 5.0, 0.6), place=3)
    match = BestMatch(7, 0.5, similarity=0.9, distance=1.25)
    drive = collected(
        [Tick(5, 10, log=2, frame=4)],
        [Pose(-1.0, -2.0, -0.3)],
        [Motion(0.1, 0.2, 0.3)],
        [estimate],
        [EpisodeStatistics(6, 8.5)],
        [match],
        [PoseConfidence(0.25, "lost")],
    )
    ints = (drive.row, drive.log, drive.frames, drive.stamps, drive.collisions, drive.place, drive.reference)
    assert [each.tolist() for each in ints] == [[0], [2], [4], [10], [6], [3], [7]]
    assert drive.estimate.tolist() == [[1.0, 2.0, 0.3]]
    assert drive.covariance.tolist() == [covariance.tolist()]
    assert drive.mean.tolist() == [[4.0, 5.0, 0.6]]
    assert drive.truth.tolist() == [[-1.0, -2.0, -0.3]]
    assert drive.motion.tolist() == [[0.1, 0.2, 0.3]]
    floats = (drive.mode_weight, drive.distance, drive.similarity, drive.visual_distance, drive.reference_turn)
    assert [each.tolist() for each in floats] == [[0.75], [8.5], [0.9], [1.25], [0.5]]
    assert drive.confidence.tolist() == [0.25]
    assert drive.state.tolist() == [2]


@pytest.mark.parametrize(("source", "moved"), [("odometry", [3.0, 0.0]), ("truth", [-1.0, -2.0])])
def test_true_poses_are_in_the_frame_of_the_map(source, moved):
    run, ctx = small_run(frames=2), Context("drive")
    there, believed = [Pose(-1.0, -2.0, 0.0)] * 2, [PoseEstimate(Pose(3.0, 0.0, 0.5), np.eye(3), 1.0, None)] * 2
    map = references([[0.0, 0.0, 0.0]], source=source)
    drive = CollectDrive().step(ctx, run.ticks, there, run.motion, believed, map=map).drive
    assert drive.truth[0, :2].tolist() == pytest.approx(moved)
    assert bool(ctx.warnings) is (source == "odometry")


@pytest.mark.parametrize(("begun", "aligned"), [(0.0, True), (3.0, False)])
def test_truth_that_comes_late_is_told_and_aligned_with_a_map_begun_at_the_origin(begun: float, aligned: bool):
    run, ctx = small_run(frames=6), Context("drive")
    at = [PoseEstimate(Pose(begun + 0.5 * i, 0.0, 0.0), np.eye(3), 1.0, None) for i in range(6)]
    there = [None, None, *(Pose(7.0, 0.5 * i, np.pi / 2) for i in range(2, 6))]
    drive = CollectDrive().step(ctx, run.ticks, there, run.motion, at).drive
    seen = drive.estimate[2:, :2] if aligned else np.array([[7.0, 0.5 * i] for i in range(2, 6)])
    assert drive.truth[2:, :2] == pytest.approx(seen)
    *frame, share = ctx.warnings
    assert share == "2 of 6 images have no true pose: errors are those of the others"
    assert [said.partition(",")[0] for said in frame] == ["The map is begun at the origin"] * aligned


def test_what_a_tick_did_not_bring_is_not_a_number_or_less_than_none():
    drive = collected([Tick(0, 0)], [None])
    assert (drive.collisions[0], drive.place[0], drive.reference[0], drive.mode_weight[0]) == (0, -1, -1, 0.0)
    assert drive.state.tolist() == [-1]
    for each in (drive.estimate, drive.covariance, drive.mean, drive.truth, drive.motion, drive.distance):
        assert np.isnan(each).all()
    for each in (drive.similarity, drive.visual_distance, drive.reference_turn, drive.confidence):
        assert np.isnan(each).all()
    nowhere = SinglePose(Pose(0.0, 0.0, 0.0)).estimate()
    assert collected([Tick(0, 0)], [None], estimates=[nowhere]).place.tolist() == [-1]
