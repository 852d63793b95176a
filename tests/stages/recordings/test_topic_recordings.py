"""Recordings out of ROS topics: what is read, and what becomes of each kind of damage."""

import math
import os
import random
import sqlite3
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from itertools import chain, combinations
from pathlib import Path

import numpy as np
import pytest
from conftest import DATA, needs_data
from made_logs import (
    CAMERA,
    FRAMES,
    IMAGE,
    ODOMETRY,
    START,
    TRUTH,
    Made,
    compressed,
    encoded,
    messages,
    picture,
    pose_at,
    write_mcap,
    write_rosbag1,
    write_rosbag2,
)

from omninav.pipeline.mcap.message_types import make_message
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.recordings import rosbag
from omninav.stages.recordings.camera_yaml import UNSAID_BY_INFO, write_camera
from omninav.stages.recordings.messages import is_blank, pixels_of
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Recording, Topics
from omninav.stages.recordings.stamps import ascending
from omninav.stages.values.encoded_image import Undecodable

from .conftest import refused


def only(topic: str):
    """A change that applies to the pictures (or poses) of one topic, by their number there."""

    def decorate(function):
        count = iter(range(10**6))
        return lambda made: function(made, next(count)) if made.topic == topic else [made]

    return decorate


def test_a_whole_log_gives_every_image_with_poses_at_its_own_stamp(whole: Recording) -> None:
    assert len(whole.stamps) == FRAMES
    assert not whole.dropped
    expected = np.array([pose_at(second) for second in (whole.stamps - START) / 1e9])
    # a chord of 1 cm of a circle of 1 m lies at most 1.25e-5 m inside it
    np.testing.assert_allclose(whole.odometry, expected, atol=1.3e-5)
    np.testing.assert_allclose(whole.truth, expected, atol=1.3e-5)
    for frame in range(FRAMES):
        np.testing.assert_array_equal(whole.image(frame), picture(frame))


def test_a_rosbag2_folder_and_a_ros1_bag_read_as_the_mcap_does(tmp_path: Path, whole: Recording) -> None:
    (tmp_path / "one").mkdir()
    for path in (write_rosbag2(tmp_path / "two"), write_rosbag1(tmp_path / "one" / "log.bag")):
        other = open_recording(str(path))
        for name in ("stamps", "odometry", "truth"):
            np.testing.assert_array_equal(getattr(other, name), getattr(whole, name))
        for frame in random.Random(0).sample(range(FRAMES), FRAMES):
            np.testing.assert_array_equal(other.image(frame), picture(frame))
        assert type(other.camera) is type(whole.camera)


def test_a_rosbag2_folder_of_mcap_parts_is_one_recording_and_a_lost_part_is_counted(tmp_path: Path) -> None:
    folder = tmp_path / "bag"
    folder.mkdir()
    half = START + 5_000_000_000
    write_mcap(folder / "bag_0.mcap", (m for m in messages() if m.stamp < half))
    write_mcap(folder / "bag_1.mcap", (m for m in messages() if m.stamp >= half))
    names = "[bag_0.mcap, bag_1.mcap, bag_2.mcap]"
    (folder / "metadata.yaml").write_text(f"rosbag2_bagfile_information: {{relative_file_paths: {names}}}")
    recording = open_recording(str(folder))
    assert len(recording.stamps) == FRAMES
    assert recording.dropped == {"missing_file": 1}
    np.testing.assert_array_equal(recording.image(15), picture(15))


def test_a_cut_log_is_used_up_to_the_cut(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap")
    data = path.read_bytes()
    path.write_bytes(data[: len(data) * 6 // 10])
    recording = open_recording(str(path))
    assert 5 <= len(recording.stamps) < FRAMES
    assert recording.dropped["cut_file"] == 1
    np.testing.assert_array_equal(recording.image(3), picture(3))


def test_a_camera_that_a_message_alone_describes_has_a_yaw_that_is_assumed(tmp_path: Path, whole: Recording) -> None:
    height, width = picture(0).shape[:2]
    k = [50.0, 0.0, width / 2, 0.0, 50.0, height / 2, 0.0, 0.0, 1.0]
    kind, fields = "sensor_msgs/msg/CameraInfo", {"width": width, "height": height, "k": k}
    told = Made("/camera_info", kind, START, START, make_message(kind, fields, START))
    path = write_mcap(tmp_path / "log.mcap", chain([told], messages()), camera=None)
    recording = open_recording(str(path), topics=Topics(camera_info="/camera_info"))
    assert (recording.camera.yaw, whole.assumed) == (0.0, ())
    assert recording.assumed == (f"{path}: {UNSAID_BY_INFO}",)


def in_frame(parent: str, child: str, x: float, y: float, z: float, *quaternion: float) -> dict:
    translation, rotation = dict(zip("xyz", (x, y, z), strict=True)), dict(zip("xyzw", quaternion, strict=True))
    header, transform = {"frame_id": parent}, {"translation": translation, "rotation": rotation}
    return {"header": header, "child_frame_id": child, "transform": transform}


def fixed_frames(*links: dict) -> Made:
    content = make_message("tf2_msgs/msg/TFMessage", {"transforms": links})
    return Made("/tf_static", "tf2_msgs/msg/TFMessage", 0, START, content)


def fisheye_info(frame: str) -> Made:
    height, width = picture(0).shape[:2]
    k = [12.0, 0.0, width / 2, 0.0, 12.0, height / 2, 0.0, 0.0, 1.0]
    fields = {"header": {"frame_id": frame}, "width": width, "height": height, "k": k, "d": [-0.01, 0.0, 0.0, 0.0]}
    fields["distortion_model"] = "equidistant"
    kind = "sensor_msgs/msg/CameraInfo"
    return Made("/camera/camera_info", kind, START, START, make_message(kind, fields, START))


HALF = math.sqrt(0.5)
UP = in_frame("plate", "eye", 0.1, 0.0, 0.5, 0.0, 0.0, HALF, HALF)
"""A lens that looks up, a quarter turn counter-clockwise."""
PLATE = in_frame("base_link", "plate", 0.2, -0.05, 0.3, 0.0, 0.0, 0.0, 1.0)
FLOOR = in_frame("base_footprint", "base_link", 0.0, 0.0, 0.1, 0.0, 0.0, 0.0, 1.0)


def test_static_transforms_say_where_a_camera_sits_that_a_message_describes(tmp_path: Path) -> None:
    made = chain([fisheye_info("eye"), fixed_frames(PLATE, FLOOR), fixed_frames(UP)], messages())
    log = open_recording(str(write_mcap(tmp_path / "log.mcap", made, camera=None)))
    assert log.camera.projection == "kannala_brandt"
    assert log.camera.mount == pytest.approx([0.3, -0.05, math.pi / 2])
    assert log.camera.height == pytest.approx(0.9)
    assert log.assumed == ()
    assert "x 0.300, y -0.050 m in base_link, by /tf_static, turned by 90.0 degrees" in log.mounted


def test_a_lens_that_looks_ahead_is_doubted_and_loops_and_unknown_frames_say_nothing(tmp_path: Path) -> None:
    ahead = in_frame("plate", "eye", 0.1, 0.0, 0.5, -0.5, 0.5, -0.5, 0.5)
    loop = in_frame("plate", "base_link", 0.2, 0.0, 0.3, 0.0, 0.0, 0.0, 1.0)
    for links, x, words in (
        ((PLATE, ahead), 0.3, "its axis is 90 degrees off the vertical"),
        ((PLATE, loop, UP), None, "neither CameraInfo nor /tf_static"),
        ((PLATE, loop), None, "neither CameraInfo nor /tf_static"),
        ((UP,), None, "neither CameraInfo nor /tf_static"),
        ((PLATE, in_frame("plate", "eye", 100.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)), None, "neither CameraInfo nor"),
    ):
        made = chain([fisheye_info("eye"), fixed_frames(*links)], messages())
        log = open_recording(str(write_mcap(tmp_path / "log.mcap", made, camera=None)))
        assert (log.camera.position_x, log.camera.yaw) == (x, 0.0)
        assert words in log.assumed[0]
    made = chain([fisheye_info("base_link"), fixed_frames(PLATE, UP)], messages())  # a driver that names no frame
    assert not open_recording(str(write_mcap(tmp_path / "log.mcap", made, camera=None))).camera.placed


def test_a_camera_that_hangs_upside_down_and_a_frame_with_two_poses_are_reported(tmp_path: Path) -> None:
    height, width = picture(0).shape[:2]
    k = [50.0, 0.0, width / 2, 0.0, 50.0, height / 2, 0.0, 0.0, 1.0]
    fields = {"header": {"frame_id": "eye"}, "width": width, "height": height, "k": k}
    kind = "sensor_msgs/msg/CameraInfo"
    info = Made("/camera/camera_info", kind, START, START, make_message(kind, fields, START))
    upright = in_frame("plate", "eye", 0.1, 0.0, 0.5, -0.5, 0.5, -0.5, 0.5)
    hanging = in_frame("plate", "eye", 0.1, 0.0, 0.5, 0.5, 0.5, 0.5, 0.5)
    moved = in_frame("base_link", "plate", 0.4, -0.05, 0.3, 0.0, 0.0, 0.0, 1.0)
    elsewhere = in_frame("base_link", "lidar", 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    again = in_frame("base_link", "lidar", 2.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    for links, assumed in (
        ((PLATE, PLATE, upright, elsewhere, again), ""),
        ((PLATE, hanging), "its image is 180 degrees off the vertical, expected a camera that looks ahead"),
        ((moved, upright, PLATE), "/tf_static gives 'plate' more than one pose; the last is taken"),
    ):
        made = chain([info, *(fixed_frames(link) for link in links)], messages())
        log = open_recording(str(write_mcap(tmp_path / "log.mcap", made, camera=None)))
        assert (log.camera.position_x, log.camera.yaw) == (pytest.approx(0.3), 0.0)
        assert (assumed in log.assumed[0]) if assumed else log.assumed == ()


def test_a_transform_that_cannot_be_is_counted_and_the_others_hold(tmp_path: Path) -> None:
    unset = in_frame("plate", "lidar", 0, 0, 0, 0, 0, 0, 0)
    for broken in (
        unset,
        in_frame("plate", "lidar", math.nan, 0, 0, 0, 0, 0, 1),
        in_frame("a", "b", 0, 0, 1e9, 0, 0, 0, 1),
        in_frame("", "eye", 9, 0, 0, 0, 0, 0, 1),
        in_frame("plate", "plate", 9, 0, 0, 0, 0, 0, 1),
    ):
        made = chain([fisheye_info("eye"), fixed_frames(broken, PLATE, UP)], messages())
        log = open_recording(str(write_mcap(tmp_path / "log.mcap", made, camera=None)))
        assert log.dropped["bad_message"] == 1
        assert log.camera.position_x == pytest.approx(0.3)


def test_a_camera_yaml_that_says_no_position_has_that_of_the_transforms_and_keeps_its_yaw(tmp_path: Path) -> None:
    def framed(made: Made) -> Iterator[Made]:
        if made.topic == IMAGE:
            made.content.header.frame_id = "eye"
        yield made

    front = in_frame("base_link", "front", 1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0)  # another camera's CameraInfo
    made = chain([fisheye_info("front"), fixed_frames(PLATE, UP, front)], messages(framed))
    path = write_mcap(tmp_path / "log.mcap", made)
    assert open_recording(str(path)).camera.mount == pytest.approx([0.3, -0.05, 0.0])
    (tmp_path / "own.yaml").write_bytes(CAMERA + b"position: {x: 0.0, y: 0.0}\n")
    assert open_recording(str(path), camera=str(tmp_path / "own.yaml")).camera.mount == pytest.approx([0.0, 0.0, 0.0])


def test_a_bad_chunk_costs_its_images_and_no_others(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap")
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 4
    path.write_bytes(data)
    recording = open_recording(str(path))
    assert recording.dropped["bad_chunk"] == 1
    assert FRAMES - 5 <= len(recording.stamps) < FRAMES
    for frame, stamp in enumerate(recording.stamps):
        np.testing.assert_array_equal(recording.image(frame), picture(round((stamp - START) / 5e8 - 0.534)))


def later(made: Made, seconds: float) -> Made:
    """An image of the same picture with another stamp."""
    stamp = made.stamp + round(seconds * 1e9)
    return made._replace(stamp=stamp, content=compressed(stamp, made.content.data.tobytes()))


def no_number(made: Made, number: int) -> list[Made]:
    nowhere = make_message("nav_msgs/msg/Odometry", {"pose": {"pose": {"position": {"x": float("nan")}}}}, made.stamp)
    return [made._replace(content=nowhere) if number == 7 else made]


def far_ahead(made: Made, number: int) -> list[Made]:
    return [later(made, 3600.0) if number == 4 else made]


def after_2262(made: Made, number: int) -> list[Made]:
    return [made._replace(log_time=2**63 + 1) if number == 5 else made]


def twice_and_back(made: Made, number: int) -> list[Made]:
    if number == 5:
        return [made, made._replace(log_time=made.log_time + 1)]
    return [later(made, -1.2) if number == 9 else made]


@pytest.mark.parametrize(
    ("topic", "change", "dropped", "frames"),
    [
        (ODOMETRY, no_number, {"bad_message": 1}, FRAMES),
        (IMAGE, far_ahead, {"backward_stamp": 1}, FRAMES - 1),
        (IMAGE, after_2262, {"backward_stamp": 1}, FRAMES - 1),
        (IMAGE, twice_and_back, {"duplicate_frame": 1, "backward_stamp": 1}, FRAMES - 1),
    ],
)
def test_a_message_that_cannot_be_is_counted_and_costs_only_itself(
    tmp_path: Path, topic: str, change, dropped: dict[str, int], frames: int
) -> None:
    recording = open_recording(str(write_mcap(tmp_path / "log.mcap", messages(only(topic)(change)))))
    assert recording.dropped == dropped
    assert len(recording.stamps) == frames
    assert np.all(np.diff(recording.stamps) > 0)


@pytest.mark.parametrize(("topic", "said"), [(IMAGE, "20 of its 20 images"), (ODOMETRY, "200 of its 201 messages")])
def test_messages_of_a_driver_that_sets_no_stamp_are_refused(tmp_path: Path, topic: str, said: str) -> None:
    @only(topic)
    def unstamped(made: Made, number: int) -> list[Made]:
        if topic == IMAGE or number:
            made.content.header.stamp.sec, made.content.header.stamp.nanosec = 0, 0
        return [made]

    with refused(f"log.mcap: {topic}: {said} are stamped 0.000 s"):
        open_recording(str(write_mcap(tmp_path / "log.mcap", messages(unstamped))))


def test_undecodable_cut_off_and_blank_images_are_left_out_when_met(tmp_path: Path) -> None:
    bad = {
        3: b"no picture",
        6: encoded(picture(6), ".jpg")[:-200],
        8: encoded(np.full((16, 48, 3), 77, np.uint8), ".jpg"),
        11: b"",
        13: encoded(picture(13))[:-30],
        14: encoded(np.zeros((8, 8, 3), np.uint8)),
    }

    @only(IMAGE)
    def spoilt(made: Made, number: int) -> list[Made]:
        return [made._replace(content=compressed(made.stamp, bad[number]))] if number in bad else [made]

    recording = open_recording(str(write_mcap(tmp_path / "log.mcap", messages(spoilt))))
    seen = [frame for frame in range(FRAMES) if recording.image(frame) is not None]
    assert seen == [frame for frame in range(FRAMES) if frame not in bad]
    assert recording.dropped == {"undecodable_image": 4, "blank_image": 1, "wrong_size": 1}


def test_readings_are_the_last_of_the_second_before_an_image(tmp_path: Path) -> None:
    kind, scans = "sensor_msgs/msg/LaserScan", []
    for seconds, ranges in ((1.267, [1.0, 2.0]), (3.0, [])):  # images are taken at 0.267 s, 0.767 s, ...
        at = START + round(seconds * 1e9)
        fields = {"ranges": np.array(ranges, np.float32), "angle_increment": 0.1, "range_max": 4.0}
        scans.append(Made("/scan", kind, at, at, make_message(kind, fields, at)))
    recording = open_recording(str(write_mcap(tmp_path / "log.mcap", chain(messages(), scans))))
    found = [recording.scan(frame) for frame in range(7)]
    assert [each and each.ranges.tolist() for each in found] == [None] * 2 + [[1.0, 2.0]] * 3 + [None] * 2
    assert recording.dropped == {"bad_message": 1}


@pytest.mark.parametrize(("frame", "first"), [("laser", math.pi), ("elsewhere", 0.0)])
def test_readings_are_turned_as_their_frame_sits_on_the_robot(frame: str, first: float, tmp_path: Path) -> None:
    kind, at = "sensor_msgs/msg/LaserScan", START + 1_267_000_000
    fields = {"ranges": np.array([1.0, 2.0], np.float32), "angle_increment": 0.1, "range_max": 4.0}
    scan = Made("/scan", kind, at, at, make_message(kind, fields | {"header": {"frame_id": frame}}, at))
    backwards = fixed_frames(
        PLATE | {"transform": {"translation": {}, "rotation": {"z": 1.0}}},
        in_frame("plate", "laser", 0, 0, 0, 0, 0, 0, 1),
    )
    made = chain([backwards], messages(), [scan])
    found = open_recording(str(write_mcap(tmp_path / "log.mcap", made))).scan(2)
    assert (found.first, found.ranges.tolist()) == (pytest.approx(first), [1.0, 2.0])


FIRST, LAST = START + 2_000_000_000, START + 8_000_000_000


def test_images_outside_the_odometrys_time_are_counted(tmp_path: Path) -> None:
    made = (m for m in messages() if m.topic != ODOMETRY or FIRST <= m.stamp <= LAST)
    recording = open_recording(str(write_mcap(tmp_path / "log.mcap", made)))
    assert FIRST <= recording.stamps[0] < recording.stamps[-1] <= LAST
    assert recording.dropped == {"outside_odometry": FRAMES - len(recording.stamps)}


@pytest.mark.parametrize(("gone", "role"), [(TRUTH, "odometry"), (ODOMETRY, "truth")])
def test_clocks_without_a_common_moment_are_said_with_both_spans(tmp_path: Path, gone: str, role: str) -> None:
    made = (later(m, 3600.0) if m.topic == IMAGE else m for m in messages() if m.topic != gone)
    with refused(rf"images are from 1700003600\.267 to .* is from 1700000000\.000 to .* type topics\.{role}=null"):
        open_recording(str(write_mcap(tmp_path / "log.mcap", made)))


def test_truth_that_ends_early_leaves_images_without_truth_and_without_odometry_out(tmp_path: Path) -> None:
    made = [m for m in messages() if m.topic != TRUTH or m.stamp <= LAST]
    recording = open_recording(str(write_mcap(tmp_path / "log.mcap", iter(made))))
    assert len(recording.stamps) == FRAMES
    assert np.isnan(recording.truth[-1]).all()
    assert np.isfinite(recording.truth[0]).all()
    alone = (m for m in made if m.topic != ODOMETRY)
    recording = open_recording(str(write_mcap(tmp_path / "alone.mcap", alone)))
    assert recording.odometry is None
    assert recording.dropped == {"no_position": FRAMES - len(recording.stamps)}
    assert np.isfinite(recording.truth).all()


def renamed(made: Made) -> list[Made]:
    names = {IMAGE: "/omni/image", ODOMETRY: "/wheels/odom"}
    return [made._replace(topic=names.get(made.topic, made.topic))]


def test_a_missing_topic_is_refused_with_what_to_type(tmp_path: Path) -> None:
    path = str(write_mcap(tmp_path / "log.mcap", messages(renamed)))
    for topics, said in (
        (Topics(), r"log\.mcap: no topic /camera/image.*type topics\.image=/omni/image"),
        (Topics(image="/omni/image"), r"no topic /odom; type topics\.odometry=/wheels/odom, or"),
        (Topics(image="/wheels/odom"), r"/wheels/odom carries nav_msgs/msg/Odometry, not images"),
    ):
        with refused(said):
            open_recording(path, topics)
    recording = open_recording(path, Topics(image="/omni/image", odometry="/wheels/odom"))
    assert len(recording.stamps) == FRAMES
    assert open_recording(path, Topics(image="/omni/image", odometry=None)).odometry is None


def test_every_user_error_is_one_line_that_names_the_log(tmp_path: Path) -> None:
    (tmp_path / "text.bag").write_text("no bag")
    nothing = write_mcap(tmp_path / "nothing.mcap", (m for m in messages() if m.topic != IMAGE))
    no_camera = write_mcap(tmp_path / "camera.mcap", camera=None)
    wrong_camera = write_mcap(tmp_path / "wrong.mcap", camera=CAMERA.replace(b"48", b"64"))
    halved = write_mcap(tmp_path / "half.mcap", camera=CAMERA.replace(b"48", b"96").replace(b"16", b"32"))
    for log, said in (
        (halved, "says 96 x 32; they are 0.5 times as large: the description is of another resolution; give camera="),
        (tmp_path / "text.bag", "this is no bag of ROS 1, which begins with '#ROSBAG V2.0'"),
        (tmp_path / "gone.mcap", "no such file"),
        (nothing, "no images"),
        (no_camera, "give camera="),
        (wrong_camera, "48 x 16, but its camera says 64 x 16"),
    ):
        with refused(f"{log}.*{said}"):
            open_recording(str(log))


def test_a_camera_beside_the_log_or_named_by_the_user_is_taken(tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "log.mcap", camera=None)
    (tmp_path / "camera.yaml").write_bytes(CAMERA)
    assert open_recording(str(path)).camera.column_of_forward == 24
    other = tmp_path / "other.yaml"
    other.write_bytes(CAMERA.replace(b"forward: 24", b"forward: 12"))
    named = open_recording(str(path), camera=str(other))
    assert named.camera.column_of_forward == 12
    assert named.digest() != open_recording(str(path)).digest()


def test_late_images_have_the_poses_and_the_times_at_which_they_were_taken(tmp_path: Path, whole: Recording) -> None:
    text = write_camera(replace(whole.camera, delay=0.3))
    (tmp_path / "late.yaml").write_text(text)
    late = open_recording(str(write_mcap(tmp_path / "log.mcap")), camera=str(tmp_path / "late.yaml"))
    kept = whole.stamps[-len(late.stamps) :]
    assert (late.stamps == kept - 300_000_000).all()
    np.testing.assert_allclose(late.odometry, [pose_at(at) for at in (late.stamps - START) / 1e9], atol=1.3e-5)
    assert late.dropped["outside_odometry"] == len(whole.stamps) - len(kept) > 0
    alone = Topics(odometry=None, truth=None)
    path, camera = str(tmp_path / "log.mcap"), str(tmp_path / "late.yaml")
    assert (open_recording(path, alone, camera).stamps == open_recording(path, alone).stamps - 300_000_000).all()


def test_the_digest_follows_the_content_and_not_the_name(tmp_path: Path, whole: Recording) -> None:
    assert open_recording(str(write_mcap(tmp_path / "other.mcap"))).digest() == whole.digest()


@pytest.mark.parametrize("encoding", ["bgr8", "8UC3", "rgb8", "bgra8", "rgba8", "mono8", "8UC1"])
def test_raw_images_are_read_with_their_row_padding(encoding: str) -> None:
    pixels = picture(1) if encoding not in ("mono8", "8UC1") else np.repeat(picture(1)[..., :1], 3, axis=2)
    channels = {"rgb8": [2, 1, 0], "bgra8": [0, 1, 2, 0], "rgba8": [2, 1, 0, 0], "mono8": [0], "8UC1": [0]}
    channels = channels.get(encoding, [0, 1, 2])
    rows = np.hstack([pixels[..., channels].reshape(16, -1), np.zeros((16, 5), np.uint8)])
    np.testing.assert_array_equal(pixels_of(raw_image(encoding, rows)), pixels)
    for cut in (rows[:, :-6], rows[:-1]):
        with pytest.raises(Undecodable):
            pixels_of(raw_image(encoding, cut))


@pytest.mark.parametrize(
    ("encoding", "width", "step", "bytes_"),
    [("mono8", 48, 144, 3), ("bgr8", 160, 640, 4), ("mono8", 48, 96, 2), ("mono8", 64, 128, 0), ("bgr8", 12, 48, 0)],
)
def test_rows_of_another_number_of_channels_are_refused_and_padded_ones_read(
    encoding: str, width: int, step: int, bytes_: int
) -> None:
    message = raw_image(encoding, np.zeros((16, step), np.uint8), width)
    if not bytes_:
        assert pixels_of(message).shape == (16, width, 3)
        return
    with pytest.raises(Undecodable, match=f"rows hold {bytes_} bytes a pixel, its encoding {encoding} has"):
        pixels_of(message)


@pytest.mark.parametrize("pattern", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_patterns_keep_their_colours(pattern: str) -> None:
    colour = {"b": 200, "g": 100, "r": 20}
    tile = np.array([colour[letter] for letter in pattern], np.uint8).reshape(2, 2)
    pixels = pixels_of(raw_image(f"bayer_{pattern}8", np.tile(tile, (8, 24))))
    assert (pixels[4:12, 4:44] == (200, 100, 20)).all()


@pytest.mark.parametrize(("encoding", "luma"), [("yuv422", 1), ("uyvy", 1), ("yuv422_yuy2", 0), ("yuyv", 0)])
def test_colours_of_half_the_width_are_read(encoding: str, luma: int) -> None:
    """Blue and red of two neighbours in common, ITU-R BT.601: 16 to 235 is black to white, 128 no colour."""
    pair = np.full(4, 128, np.uint8)
    pair[[luma, luma + 2]] = 16, 235
    pixels = pixels_of(raw_image(encoding, np.tile(pair, (16, 24))))
    assert (pixels[:, ::2] <= 2).all()
    assert (pixels[:, 1::2] >= 253).all()
    pair[1 - luma] = 240  # the first of both colours is blue
    blue = pixels_of(raw_image(encoding, np.tile(pair, (16, 24))))[:, ::2]
    assert (blue[..., 0] > blue[..., 2] + 150).all()
    with pytest.raises(Undecodable, match="47 pixels a row, expected an even number"):
        pixels_of(raw_image(encoding, np.tile(pair, (16, 24)), 47))


def test_a_step_that_is_too_short_is_named() -> None:
    message = raw_image("bgr8", np.zeros((16, 144), np.uint8))
    message.step = 48
    with pytest.raises(Undecodable, match="its step of 48 bytes is too short for 48 pixels of bgr8"):
        pixels_of(message)


def raw_image(encoding: str, rows: np.ndarray, width: int = 48) -> object:
    """A message of 16 rows of pixels, which may be longer than its width."""
    fields = {"height": 16, "width": width, "encoding": encoding, "step": rows.shape[1], "data": rows.tobytes()}
    return make_message("sensor_msgs/msg/Image", fields)


def test_an_image_is_blank_only_when_it_is_constant() -> None:
    for level, blank in ((2, True), (3, False)):  # JPEG rounds by one, to either side
        one_pixel = np.full((16, 48, 3), (10, 200, 90), np.uint8)
        one_pixel[3, 5, 1] += level
        assert is_blank(one_pixel) is blank


def test_ascending_keeps_the_longest_run_by_brute_force() -> None:
    chance = random.Random(5)
    for _ in range(60):
        stamps = [chance.randrange(9) for _ in range(8)]
        kept, repeated, backward = ascending(stamps)
        values = [stamps[number] for number in kept]
        assert values == sorted(set(values))
        assert sorted(kept + repeated + backward) == list(range(8))
        firsts = [number for number in range(8) if stamps.index(stamps[number]) == number]
        best = max(
            size
            for size in range(1, 9)
            for chosen in combinations(firsts, size)
            if [stamps[n] for n in chosen] == sorted(stamps[n] for n in chosen)
        )
        assert len(kept) == best


@needs_data
@pytest.mark.parametrize(("name", "images"), [("tour", 279), ("drive", 130)])
def test_the_house_is_read_completely_and_its_truth_is_right(name: str, images: int) -> None:
    folder = DATA / "photoreal-house"
    recording = open_recording(str(folder / f"{name}.mcap"))
    table = np.loadtxt(folder / f"{name}_truth.tum")
    assert len(recording.stamps) == len(table) == images
    assert sum(recording.image(frame) is not None for frame in range(images)) == images
    assert not recording.dropped
    np.testing.assert_allclose(recording.stamps / 1e9, table[:, 0], atol=1e-6)
    # linear between truths 50 ms apart; the robot's acceleration makes that wrong by up to 0.3 mm and 0.07 degrees
    np.testing.assert_allclose(recording.truth[:, :2], table[:, 1:3], atol=3e-4)
    turn = recording.truth[:, 2] - 2 * np.arctan2(table[:, 6], table[:, 7])
    np.testing.assert_allclose(np.sin(turn / 2), 0, atol=6e-4)


@needs_data
def test_a_robots_own_bag_is_read_by_header_time_not_by_log_time() -> None:
    reader = LogReader(DATA / "nav2-turtlebot-mcap" / "nav2_turtlebot.mcap")
    odometry = list(reader.messages(["/odom"]))
    assert len(odometry) == 2639
    assert 928e9 < odometry[0].stamp < odometry[-1].stamp < 1026e9  # simulation time (the set's notes)
    assert odometry[0].log_time > 1.7e18  # wall time
    assert not reader.dropped


def test_a_rosbag2_folder_is_read_without_its_metadata(tmp_path: Path) -> None:
    folder = write_rosbag2(tmp_path / "bag")
    (folder / "metadata.yaml").write_text("rosbag2_bagfile_information: {version: 9}")
    recording = open_recording(str(folder))
    assert len(recording.stamps) == FRAMES
    assert recording.dropped == {"bad_metadata": 1}
    (folder / "metadata.yaml").unlink()
    assert len(open_recording(str(folder)).stamps) == FRAMES


def test_messages_that_a_bags_metadata_states_and_that_are_not_there_are_counted(tmp_path: Path) -> None:
    write_rosbag2(tmp_path / "bag")
    with closing(sqlite3.connect(next((tmp_path / "bag").glob("*.db3")))) as bag, bag:
        some = "SELECT messages.id FROM messages JOIN topics ON topic_id = topics.id WHERE name = ? LIMIT 3"
        bag.execute(f"DELETE FROM messages WHERE id IN ({some})", (ODOMETRY,))
    recording = open_recording(str(tmp_path / "bag"))
    assert recording.dropped["missing_message"] == 3
    assert "3 of " in recording.details["missing_message"]


@pytest.mark.parametrize("name", ["x.db3", "metadata.yaml"])
def test_a_pipe_in_a_bags_folder_is_refused_without_being_read(tmp_path: Path, name: str) -> None:
    write_rosbag2(tmp_path / "bag")
    (tmp_path / "bag" / name).unlink(missing_ok=True)
    os.mkfifo(tmp_path / "bag" / name)
    with refused("pipe"):
        open_recording(str(tmp_path / "bag"))


@pytest.mark.parametrize("mode", ["FILE", "MESSAGE"])
def test_a_compressed_rosbag2_folder_is_read_within_limits(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, mode: str, whole: Recording
) -> None:
    from rosbags.rosbag2.enums import CompressionFormat, CompressionMode

    given = CompressionMode[mode], CompressionFormat.ZSTD
    folder = write_rosbag2(tmp_path / "bag", prepare=lambda writer: writer.set_compression(*given))
    recording = open_recording(str(folder))
    np.testing.assert_array_equal(recording.stamps, whole.stamps)
    np.testing.assert_array_equal(recording.image(1), picture(1))
    monkeypatch.setattr(rosbag, "MAX_BYTES", 100)
    monkeypatch.setattr(rosbag, "MAX_RATIO", 1)
    with refused(r"not a readable bag|image"):
        open_recording(str(folder))


def odometry_as_transforms(made: Made) -> list[Made]:
    if made.topic != ODOMETRY:
        return [made]
    x, y, heading = pose_at((made.stamp - START) / 1e9)
    half = heading / 2
    link = in_frame("/odom", "base_footprint", x, y, 0.0, 0.0, 0.0, math.sin(half), math.cos(half))
    link["header"]["stamp"] = {"sec": made.stamp // 10**9, "nanosec": made.stamp % 10**9}
    other = in_frame("map", "odom", 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    kind = "tf2_msgs/msg/TFMessage"
    return [made._replace(topic="/tf", msgtype=kind, content=make_message(kind, {"transforms": [other, link]}))]


@pytest.mark.parametrize("topic", ["/odom", "/tf:odom:base_footprint"])
def test_odometry_in_transforms_alone_is_read_and_told(tmp_path: Path, whole: Recording, topic: str) -> None:
    path = write_mcap(tmp_path / "log.mcap", messages(odometry_as_transforms))
    recording = open_recording(str(path), Topics(odometry=topic))
    np.testing.assert_allclose(recording.odometry, whole.odometry, atol=1e-9)
    told = [each for each in recording.assumed if "no Odometry is recorded" in each]
    assert [each.split(": ", 1)[1] for each in told] == (
        ["no Odometry is recorded: its transforms from odom to base_footprint are taken"] if topic == "/odom" else []
    )


def test_transforms_that_hold_no_odometry_are_no_odometry(tmp_path: Path) -> None:
    def of_map(made: Made) -> list[Made]:
        if made.topic != ODOMETRY:
            return [made]
        kind = "tf2_msgs/msg/TFMessage"
        link = in_frame("map", "odom", 1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0)
        return [made._replace(topic="/tf", msgtype=kind, content=make_message(kind, {"transforms": [link]}))]

    recording = open_recording(str(write_mcap(tmp_path / "map.mcap", messages(of_map))))
    assert recording.odometry is None
    assert not [each for each in recording.assumed if "Odometry" in each]

    def without(made: Made) -> list[Made]:
        return [each._replace(topic="/tf2") if each.topic == "/tf" else each for each in odometry_as_transforms(made)]

    path = str(write_mcap(tmp_path / "log.mcap", messages(without)))
    assert open_recording(path).odometry is None
    with refused("/tf2:odom:base; type topics.odometry= with one of: /tf2:map:odom, /tf2:odom:base_footprint"):
        open_recording(path, Topics(odometry="/tf2:odom:base"))
