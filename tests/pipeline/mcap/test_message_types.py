"""Stamps, empty fields and the size of types, counted by hand."""

import struct

import pytest

from omninav.pipeline.mcap.message_types import has_header, header_stamp, make_message, standard_types, types_of


def test_a_stamp_is_read_in_the_byte_order_that_the_message_states() -> None:
    little, big = struct.pack("<iI", 5, 7), struct.pack(">iI", 5, 7)
    for head, stamp, cdr in ((b"\0\1\0\0", little, True), (b"\0\0\0\0", big, True), (b"\0\0\0\1", little, False)):
        assert header_stamp(head + stamp, cdr) == 5_000_000_007
        assert header_stamp(head + stamp) == 5_000_000_007 or not cdr
        assert header_stamp((head + stamp)[:-1], cdr) is None


def test_fields_that_are_left_out_are_empty_and_bytes_are_numbers() -> None:
    assert make_message("std_msgs/msg/Bool", {}).data is False
    assert make_message("std_msgs/msg/String", {}).data == ""
    marker = make_message("visualization_msgs/msg/Marker", {"points": [{"x": 1.0}]}, 3_000_000_004)
    assert (marker.id, marker.points[0].x, marker.points[0].y, marker.colors) == (0, 1.0, 0, [])
    assert (marker.header.stamp.sec, marker.header.stamp.nanosec) == (3, 4)
    assert make_message("sensor_msgs/msg/Image", {"data": b"\xff"}).data.tolist() == [255]
    assert has_header(standard_types(), "sensor_msgs/msg/Image")
    assert not has_header(standard_types(), "std_msgs/msg/Bool")


@pytest.mark.parametrize(
    ("definition", "parts"),
    [
        ("Part[49] a", 1 + 49 * 2),
        ("Part[50] a", 1 + 50 * 2),
        ("string[99] a", 1 + 99),
        ("string[100] a", 1 + 100),
        ("Part[] a\nPart[<=60] b\nfloat64[200] c\nPart[47] d", 1 + 2 + 2 + 1 + 47 * 2),
        ("Part[] a\nPart[<=60] b\nfloat64[200] c\nPart[47] d\nint8 e", 1 + 2 + 2 + 1 + 47 * 2 + 1),
    ],
)
def test_a_type_of_too_many_parts_is_not_taken(monkeypatch: pytest.MonkeyPatch, definition: str, parts: int) -> None:
    monkeypatch.setattr("omninav.pipeline.mcap.message_types.MAX_PARTS", 100)
    text = f"{definition}\n{'=' * 80}\nMSG: my/Part\nbool there\n"
    assert (types_of("my/msg/Long", "ros2msg", text.encode()) is standard_types()) is (parts > 100)
