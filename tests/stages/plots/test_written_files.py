import numpy as np
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from measured_drives import AT_ORIGIN, made_drive
from result_of import write_result
from rosbags.highlevel import AnyReader
from small_run import small_run

from omninav.pipeline import Context
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.plots.pose_messages import covariance_6x6
from omninav.stages.plots.thin_belief import ThinBelief, thin
from omninav.stages.plots.trajectory_file import TrajectoryFile
from omninav.stages.values.belief import Particles, SinglePose
from omninav.stages.values.pose import Pose


def test_a_trajectory_file_has_a_row_per_image_with_all_digits_of_its_stamp(tmp_path):
    drive = made_drive([None, None], [(1.0, -2.5, np.pi / 2), AT_ORIGIN])
    drive.stamps[:] = 1_700_000_000_123_456_789, 1_700_000_001_000_000_001
    TrajectoryFile().step(Context("t", folder=tmp_path), drive)
    first, second = (tmp_path / "trajectory.tum").read_text().splitlines()
    half = "0.707106781"  # sin and cos of 45 degrees
    assert first == f"1700000000.123456789 1.000000000 -2.500000000 0.000000000 0.000000000 0.000000000 {half} {half}"
    assert second.startswith("1700000001.000000001 ")


def test_every_log_has_its_trajectory_and_the_last_has_the_plain_name(tmp_path):
    run = small_run(frames=5, logs=2)
    TrajectoryFile().step(Context("t", folder=tmp_path), run.drive)
    names = {f"{name}{log}.tum" for name in ("trajectory", "truth") for log in ("", "_0", "_1")}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert (tmp_path / "trajectory.tum").read_bytes() == (tmp_path / "trajectory_1.tum").read_bytes()


def test_frames_without_an_estimate_are_counted(tmp_path):
    ctx = Context("t", folder=tmp_path)
    TrajectoryFile().step(ctx, made_drive([None, None], [None, AT_ORIGIN]))
    assert ctx.counts == {"frame_without_estimate": 1}
    assert len((tmp_path / "trajectory.tum").read_text().splitlines()) == 1
    assert not ctx.warnings
    TrajectoryFile().step(ctx, made_drive([None, None]))
    assert ctx.warnings[0].startswith("no image has an estimate")


def test_the_result_log_opens_with_mcaps_own_ros2_decoder(tmp_path):
    run = small_run(frames=12, logs=2)
    with write_result(tmp_path, run).open("rb") as file:
        found = {}
        decoded = make_reader(file, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
        for _, channel, message, content in decoded:
            found.setdefault(channel.topic, []).append((message.log_time, content))
    assert {topic: len(messages) for topic, messages in found.items()} == {
        "/belief": 24,
        "/estimate/path": 3,
        "/estimate/pose": 24,
        "/ground_truth/pose": 24,
        "/map": 2,
        "/odom": 24,
        "/odometry/path": 2,
        "/tf": 24,
    }
    stamp, pose = found["/estimate/pose"][3]
    assert stamp == run.ticks[3].stamp
    assert pose.header.stamp.sec * 10**9 + pose.header.stamp.nanosec == stamp
    assert pose.pose.pose.position.x == run.estimates[3].pose.x
    assert len(found["/belief"][0][1].poses) == 30
    assert len(found["/estimate/path"][0][1].poses) == 12
    assert len(found["/map"][0][1].markers[0].points) == len(run.map)
    map_to_odom, odom_to_base = (placed(transform.transform) for transform in found["/tf"][20][1].transforms)
    at = run.estimates[20].pose
    np.testing.assert_allclose(compose(map_to_odom, odom_to_base), [at.x, at.y, at.heading], atol=1e-9)


def placed(transform):
    heading = 2 * np.arctan2(transform.rotation.z, transform.rotation.w)
    return np.array([transform.translation.x, transform.translation.y, heading])


def test_the_result_log_opens_with_rosbags(tmp_path):
    run = small_run(frames=4)
    with AnyReader([write_result(tmp_path, run)]) as reader:
        read = [(c.topic, reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages()]
    truth = [message.pose.position.x for topic, message in read if topic == "/ground_truth/pose"]
    assert truth == [pose.x for pose in run.truth]


def test_the_same_run_gives_the_same_log_byte_for_byte(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "b").mkdir()
    first, second = (write_result(tmp_path / name, small_run(frames=5)) for name in "ab")
    assert first.read_bytes() == second.read_bytes()


def test_a_long_run_keeps_every_pose_and_some_views(tmp_path):
    run = small_run(frames=7)
    write_result(tmp_path, run, max_views=3)
    stamps: dict[str, list[int]] = {}
    for record in LogReader(tmp_path / "result.mcap").scan():
        stamps.setdefault(record.topic, []).append(record.log_time)
    every = [tick.stamp for tick in run.ticks]
    assert stamps["/tf"] == stamps["/ground_truth/pose"] == every
    assert stamps["/belief"] == every[::4]


def test_a_covariance_stands_where_ros_wants_it():
    plane = np.arange(9.0).reshape(3, 3)
    whole = covariance_6x6(plane).reshape(6, 6)
    assert whole[0, 1] == plane[0, 1]
    assert whole[5, 5] == plane[2, 2]
    assert whole[1, 5] == plane[1, 2]
    assert not whole[2:5].any()
    assert covariance_6x6(np.zeros((2, 3, 3))).reshape(2, 6, 6)[1, [0, 1, 5], [0, 1, 5]].tolist() == [1e6] * 3


def test_thinning_keeps_a_particle_as_often_as_its_weight_says():
    belief = Particles(np.arange(12.0).reshape(4, 3), np.array([0.5, 0.25, 0.25, 0.0]))
    kept = thin(belief, 3)  # middles of thirds: 1/6, 1/2 and 5/6 of the weight
    assert kept.poses[:, 0].tolist() == [0.0, 0.0, 6.0]
    np.testing.assert_allclose(kept.weights, 1 / 3)
    assert thin(belief, 4) is belief


def test_a_belief_of_another_kind_is_shown_by_its_pose():
    belief = SinglePose(Pose(1.0, 2.0, 0.5))
    out = ThinBelief().step(Context("thin"), belief, belief.estimate())
    assert out.belief.poses.tolist() == [[1.0, 2.0, 0.5]]
