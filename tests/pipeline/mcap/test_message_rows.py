import numpy as np
import pytest

from omninav.pipeline.mcap.message_rows import MessageRows, row_bytes
from omninav.pipeline.mcap.message_types import encode_message


def pose(x: float, y: float, z: float) -> dict:
    return {"position": {"x": x, "y": y}, "orientation": {"z": z}}


def test_rows_are_the_messages_that_are_encoded_one_by_one():
    kind = "geometry_msgs/msg/PoseWithCovarianceStamped"
    numbers = np.random.default_rng(0).normal(size=(3, 40))
    rows = MessageRows(kind, {"header": {"frame_id": "somewhere"}}).rows(3)
    rows["header"]["stamp"]["sec"] = 1, 2, 3
    rows["pose"]["pose"]["position"]["y"] = numbers[:, 0]
    rows["pose"]["covariance"] = numbers[:, 4:]
    alone = [
        {
            "header": {"stamp": {"sec": n + 1}, "frame_id": "somewhere"},
            "pose": {"pose": {"position": {"y": each[0]}}, "covariance": each[4:]},
        }
        for n, each in enumerate(numbers)
    ]
    assert row_bytes(rows) == [encode_message(kind, fields) for fields in alone]


@pytest.mark.parametrize("frame", ["", "a", "ab", "abc", "abcd", "abcdefgh"])
@pytest.mark.parametrize("items", [1, 2, 5])
def test_items_of_a_sequence_lie_where_alignment_puts_them(frame: str, items: int):
    kind, head = "nav_msgs/msg/Path", {"frame_id": frame}
    at = np.arange(2.0 * items).reshape(2, items)
    rows = MessageRows(kind, {"header": head, "poses": [{"header": {"frame_id": "map"}}] * items}).rows(2)
    poses = rows["poses"]
    if poses.dtype.names == ("first", "rest"):
        poses["first"]["pose"]["position"]["x"] = at[:, 0]
        poses["rest"]["pose"]["position"]["x"] = at[:, 1:]
    else:
        poses["pose"]["position"]["x"] = at
    alone = [
        {"header": head, "poses": [{"header": {"frame_id": "map"}, "pose": pose(x, 0.0, 0.0)} for x in each]}
        for each in at.tolist()
    ]
    assert row_bytes(rows) == [encode_message(kind, fields) for fields in alone]


def test_a_marker_with_points_and_colours_is_the_one_that_is_encoded_alone():
    kind = "visualization_msgs/msg/MarkerArray"
    points, colours = [{}] * 3, [{"r": 0.5}] * 3
    rows = MessageRows(kind, {"markers": [{"ns": "seen", "points": points, "colors": colours}]}).rows(1)
    rows["markers"]["points"]["x"] = [[[1.0, 2.0, 3.0]]]
    rows["markers"]["colors"]["a"] = [[[0.25, 0.5, 1.0]]]
    alone = {
        "ns": "seen",
        "points": [{"x": x} for x in (1.0, 2.0, 3.0)],
        "colors": [{"r": 0.5, "a": a} for a in (0.25, 0.5, 1.0)],
    }
    assert row_bytes(rows) == [encode_message(kind, {"markers": [alone]})]


def test_items_that_differ_in_their_texts_are_refused():
    kind = "tf2_msgs/msg/TFMessage"
    frames = [{"child_frame_id": name} for name in ("a", "ab", "somewhat_longer")]
    with pytest.raises(ValueError, match="differ in their texts"):
        MessageRows(kind, {"transforms": frames})
    two = MessageRows(kind, {"transforms": [frames[0], frames[2]]}).rows(1)
    assert row_bytes(two) == [encode_message(kind, {"transforms": [frames[0], frames[2]]})]


def test_no_rows_are_no_messages():
    assert row_bytes(MessageRows("std_msgs/msg/Float64", {}).rows(0)) == []
