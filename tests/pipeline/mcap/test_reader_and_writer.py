"""MCAP logs: what is written comes back, and damage costs what it must and no more."""

import itertools
import random
import struct
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import zstandard
from mcap.writer import CompressionType, IndexType, Writer
from memory_peak import memory_peak

from omninav.pipeline.mcap.chunks import MAGIC, Allowance, unpack
from omninav.pipeline.mcap.message import BadMessage, LogError
from omninav.pipeline.mcap.message_types import encode_message, make_message
from omninav.pipeline.mcap.reader import LogReader
from omninav.pipeline.mcap.writer import written_log

POSE = "geometry_msgs/msg/PoseStamped"
COUNT = 60


def written(path: Path, count: int = COUNT, chunk_bytes: int = 2000) -> Path:
    """A small log in several chunks: poses and blobs, and an attachment in the middle."""
    noise = np.random.default_rng(1)
    with written_log(path, chunk_bytes) as log:
        for number in range(count):
            stamp = 1_700_000_000_000_000_000 + number * 1_000_000
            log.write("/pose", POSE, stamp, {"pose": {"position": {"x": float(number)}}}, log_time=stamp + 5)
            blob = noise.integers(0, 256, 150, dtype=np.uint8)
            log.write("/blob", "sensor_msgs/msg/CompressedImage", stamp, {"format": "none", "data": blob})
            if number == count // 2:
                log.attach("note.txt", b"in the middle")
    return path


def keys(reader: LogReader) -> list[tuple[str, int, bytes]]:
    return [(record.topic, record.stamp, bytes(record.data)) for record in reader.scan()]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return written(tmp_path / "log.mcap")


@pytest.fixture
def whole(path: Path) -> list[tuple[str, int, bytes]]:
    """All that is in it."""
    return keys(LogReader(path))


def records_of(path: Path) -> list[bytes]:
    """Every record of a file with its head, up to its end record."""
    data, at, found = path.read_bytes(), len(MAGIC), []
    while at + 9 <= len(data) - len(MAGIC):
        length = 9 + struct.unpack_from("<Q", data, at + 1)[0]
        found.append(data[at : at + length])
        at += length
    return found


def write_records(path: Path, records: list[bytes]) -> LogReader:
    path.write_bytes(MAGIC + b"".join(records) + MAGIC)
    return LogReader(path)


def chunk_places(path: Path) -> list[tuple[int, int]]:
    """First byte and length of every chunk record's content."""
    records = records_of(path)
    ends = itertools.accumulate(map(len, records), initial=len(MAGIC))
    return [(at + 9, len(each) - 9) for at, each in zip(ends, records, strict=False) if each[0] == 0x06]


def foreign(path: Path, msgtype: str, definition: bytes, data: list[bytes], **options: Any) -> Path:
    """A log of one topic by another program; the n-th message has the log time n."""
    with path.open("wb") as file:
        writer = Writer(file, **options)
        writer.start(profile="ros2", library="test")
        channel = writer.register_channel("/topic", "cdr", writer.register_schema(msgtype, "ros2msg", definition))
        for number, each in enumerate(data):
            writer.add_message(channel, number, each, number)
        writer.finish()
    return path


def flipped(path: Path, at: int, bit: int = 0) -> Path:
    data = bytearray(path.read_bytes())
    data[at] ^= 1 << bit
    path.write_bytes(data)
    return path


def test_messages_come_back_in_the_order_of_their_stamps_which_without_a_header_are_log_times(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with written_log(path) as log:
        for log_time, stamp in ((1, 30), (2, 10), (3, 20)):
            log.write("/pose", POSE, stamp, {"header": {"frame_id": "map"}}, log_time=log_time)
        log.write("/text", "std_msgs/msg/String", 7, {"data": "seven"})
    text, *found = LogReader(path).messages()
    assert (text.stamp, text.content.data) == (7, "seven")
    assert [(m.stamp, m.log_time, m.content.header.frame_id) for m in found] == [
        (10, 2, "map"), (20, 3, "map"), (30, 1, "map"),
    ]  # fmt: skip


def test_the_same_content_gives_the_same_bytes(tmp_path: Path) -> None:
    assert written(tmp_path / "a.mcap").read_bytes() == written(tmp_path / "b.mcap").read_bytes()
    with written_log(tmp_path / "c.mcap") as log:
        for number in range(9):
            log.write("/text", "std_msgs/msg/String", number, {"data": "one chunk holds it"})
    assert len(chunk_places(tmp_path / "c.mcap")) == 1


def test_no_file_appears_when_writing_fails(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no such message type"), written_log(tmp_path / "log.mcap") as log:
        log.write("/pose", "my/msg/Nothing", 1, {})
    assert list(tmp_path.iterdir()) == []


def test_topics_types_and_attachments_are_listed(path: Path) -> None:
    reader = LogReader(path)
    assert reader.topics == {"/blob": "sensor_msgs/msg/CompressedImage", "/pose": POSE}
    assert reader.attachments == {"note.txt": b"in the middle"}
    assert not reader.dropped


@pytest.mark.parametrize("in_memory", [0, 5000, 32_000_000])
def test_bytes_are_fetched_again_from_where_the_scan_found_them(
    path: Path, monkeypatch: pytest.MonkeyPatch, in_memory: int
) -> None:
    unpacked: list[int] = []
    monkeypatch.setattr("omninav.pipeline.mcap.reader._BYTES_IN_MEMORY", in_memory)
    monkeypatch.setattr(
        "omninav.pipeline.mcap.reader.unpack", lambda *given, **more: unpacked.append(1) or unpack(*given, **more)
    )
    reader = LogReader(path)
    found = [(record.location, bytes(record.data)) for record in reader.scan(["/blob"])]
    assert (len(found), len(unpacked)) == (COUNT, len(chunk_places(path)))
    unpacked.clear()
    for location, data in random.Random(0).sample(found, COUNT):
        assert reader.fetch(location) == data
    assert (len(unpacked) == 0) is (in_memory > 5000)


def test_a_cut_file_gives_every_whole_message_before_the_cut(path: Path, whole: list) -> None:
    data, chunks = path.read_bytes(), chunk_places(path)
    per_chunk = [len(whole) * (n + 1) // len(chunks) for n in range(len(chunks))]
    end_of_data = data.rindex(b"\x0f" + struct.pack("<Q", 4))
    for cut in sorted(random.Random(2).sample(range(len(MAGIC), end_of_data), 60)):
        path.write_bytes(data[:cut])
        reader = LogReader(path)
        found = keys(reader)
        assert found == whole[: len(found)]
        assert reader.dropped == {"cut_file": 1}
        complete = sum(1 for start, length in chunks if start + length <= cut)
        assert len(found) >= (per_chunk[complete - 1] - per_chunk[0] if complete else 0)


def test_a_log_cut_behind_its_messages_loses_nothing(path: Path, whole: list) -> None:
    path.write_bytes(path.read_bytes()[:-30])
    reader = LogReader(path)
    assert keys(reader) == whole
    assert reader.attachments == {"note.txt": b"in the middle"}


@pytest.mark.parametrize(("which", "where"), [(0, "content"), (2, "content"), (-1, "content"), (1, "length")])
def test_a_bad_chunk_costs_only_itself_and_is_counted_once(path: Path, whole: list, which: int, where: str) -> None:
    chunks = chunk_places(path)
    start, length = chunks[which]
    at = start + length // 2 if where == "content" else start - 8 + 5  # a high byte of the record's length
    reader = LogReader(flipped(path, at))
    found = keys(reader)
    assert set(found) < set(whole)
    assert found == [key for key in whole if key in set(found)]
    assert len(whole) - len(found) <= 2 * len(whole) / len(chunks)
    assert keys(reader) == found  # a second scan
    assert reader.dropped == {"bad_chunk": 1, "missing_message": len(whole) - len(found)}
    assert str(path) in reader.details["bad_chunk"]


def test_a_flipped_bit_anywhere_is_never_delivered_as_data(tmp_path: Path) -> None:
    path = written(tmp_path / "log.mcap", count=20)
    whole, data = keys(LogReader(path)), path.read_bytes()
    chance, delivered = random.Random(3), 0
    for _ in range(150):
        path.write_bytes(data)
        flipped(path, chance.randrange(len(MAGIC), len(data)), chance.randrange(8))
        reader = LogReader(path)
        found = keys(reader)
        assert set(found) <= set(whole)
        assert found == whole or reader.dropped
        assert reader.attachments in ({}, {"note.txt": b"in the middle"})
        delivered += len(found)
    assert delivered > 0.5 * 150 * len(whole)


def test_a_message_that_its_definition_cannot_decode_is_counted(tmp_path: Path) -> None:
    data = next(bytes(record.data) for record in LogReader(written(tmp_path / "good.mcap", count=1)).scan(["/pose"]))
    definition = "std_msgs/Header header\n" + "=" * 80 + "\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\n"
    definition += "string frame_id\n" + "=" * 80 + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n"
    kind = "my_robot/msg/Beat"  # which no ROS release knows
    reader = LogReader(foreign(tmp_path / "log.mcap", kind, definition.encode(), [data[:20], data[:9]]))
    assert [m.msgtype for m in reader.messages()] == [kind]
    assert reader.dropped == {"bad_message": 1}
    with pytest.raises(BadMessage, match="/topic"):
        reader.decode("/topic", b"\x00\x01\x00\x00\x01")


def test_a_log_without_chunks_is_read_and_its_cut_found(tmp_path: Path) -> None:
    poses = [bytes(record.data) for record in LogReader(written(tmp_path / "log.mcap", 10)).scan(["/pose"])]
    definition = b"std_msgs/Header header\ngeometry_msgs/Pose pose\n"  # without its parts: the standard one is taken
    path = foreign(tmp_path / "flat.mcap", POSE, definition, poses, use_chunking=False)
    reader = LogReader(path)
    assert [m.content.pose.position.x for m in reader.messages()] == [float(n) for n in range(10)]
    *_, last = reader.scan()
    path.write_bytes(path.read_bytes()[: last.location.start + 10])
    cut = LogReader(path)
    assert [m.content.pose.position.x for m in cut.messages()] == [float(n) for n in range(9)]
    assert cut.dropped == {"cut_file": 1}


def test_what_is_no_log_or_is_missing_is_refused_by_name(tmp_path: Path) -> None:
    path = tmp_path / "log.mcap"
    with pytest.raises(LogError, match=r"log\.mcap: No such file"):
        LogReader(path)
    for content in (b"", b"\x89PNG\r\n\x1a\n" * 9):
        path.write_bytes(content)
        with pytest.raises(LogError, match=r"log\.mcap.*not an MCAP file"):
            LogReader(path)


def test_a_wrong_field_or_type_is_refused_with_the_nearest_name(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="did you mean 'position'"):
        make_message("geometry_msgs/msg/Pose", {"positon": {}})
    with pytest.raises(LogError, match="did you mean 'geometry_msgs/msg/PoseStamped'"):
        make_message("geometry_msgs/msg/PoseStampd", {})
    with written_log(tmp_path / "log.mcap") as log:
        log.write("/pose", POSE, 1, {})
        with pytest.raises(LogError, match="use another topic"):
            log.write("/pose", "std_msgs/msg/String", 1, {})


def test_what_is_written_opens_with_mcap_ros2_message_by_message(path: Path) -> None:
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    ours = list(LogReader(path).messages(["/pose"]))
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        theirs = [message for *_, message in reader.iter_decoded_messages(["/pose"], log_time_order=False)]
    assert len(theirs) == len(ours) == COUNT
    for message, their in zip(ours, theirs, strict=True):
        assert their.header.stamp.sec * 10**9 + their.header.stamp.nanosec == message.stamp
        assert their.pose.position.x == message.content.pose.position.x


def test_what_is_written_opens_with_rosbags_message_by_message(path: Path) -> None:
    from rosbags.highlevel import AnyReader

    ours = {(m.topic, m.log_time): m.content for m in LogReader(path).messages()}
    with AnyReader([path]) as reader:
        count = 0
        for connection, time, data in reader.messages():
            theirs, mine = reader.deserialize(data, connection.msgtype), ours[connection.topic, time]
            assert theirs.header.stamp.nanosec == mine.header.stamp.nanosec
            if connection.topic == "/blob":
                assert np.array_equal(theirs.data, mine.data)
            count += 1
    assert count == len(ours) == 2 * COUNT


@pytest.mark.parametrize("compression", ["LZ4", "NONE", "ZSTD"])
def test_every_compression_is_read_whole_and_cut_inside_a_chunk(tmp_path: Path, compression: str) -> None:
    texts = [made_text(number) for number in range(3000)]
    packing = {"chunk_size": 1 << 24, "compression": CompressionType[compression]}
    path = foreign(tmp_path / "log.mcap", "std_msgs/msg/String", b"string data\n", texts, **packing)
    assert [bytes(record.data) for record in LogReader(path).scan()] == texts
    ((start, length),) = chunk_places(path)
    path.write_bytes(path.read_bytes()[: start + length * 9 // 10])
    cut = LogReader(path)
    found = [bytes(record.data) for record in cut.scan()]
    assert 1000 < len(found) < len(texts)  # the part of the chunk that its compression lets through
    assert found == texts[: len(found)]
    assert cut.dropped == {"cut_file": 1}


def made_text(number: int) -> bytes:
    noise = "".join(chr(letter) for letter in np.random.default_rng(number).integers(33, 127, 200))
    return encode_message("std_msgs/msg/String", {"data": noise})


def test_a_chunk_that_was_taken_out_is_missed_by_topic(path: Path, whole: list) -> None:
    records = records_of(path)
    number = [n for n, record in enumerate(records) if record[0] == 0x06][2]
    end = next(n for n in range(number + 1, len(records)) if records[n][0] != 0x07)  # its message indexes too
    reader = write_records(path, records[:number] + records[end:])
    lost = len(whole) - len(keys(reader))
    assert lost > 0
    assert reader.dropped["missing_message"] == lost
    assert "of 60 on /blob" in reader.details["missing_message"]
    assert "of 60 on /pose" in reader.details["missing_message"]


@pytest.mark.parametrize(("topics", "said"), [(3, "/2"), (4, "/2 and of 1 more topic"), (5, "/2 and of 2 more topics")])
def test_messages_of_three_topics_that_are_missing_are_named_and_the_others_counted(
    tmp_path: Path, topics: int, said: str
) -> None:
    with written_log(tmp_path / "log.mcap", 1 << 24) as log:
        for number in range(topics):
            log.write(f"/{number}", "std_msgs/msg/String", number, {"data": "lost"})
    reader = write_records(tmp_path / "log.mcap", [r for r in records_of(tmp_path / "log.mcap") if r[0] != 0x06])
    assert list(reader.scan()) == []
    assert reader.dropped["missing_message"] == topics
    named = ", ".join(f"1 of 1 on {topic}" for topic in ("/0", "/1", said))
    assert reader.details["missing_message"].endswith(f" missing: {named}")


def test_a_file_without_a_summary_is_read_whole(tmp_path: Path) -> None:
    texts = [encode_message("std_msgs/msg/String", {"data": f"{number}"}) for number in range(9)]
    without = dict.fromkeys(("repeat_channels", "repeat_schemas", "use_statistics", "use_summary_offsets"), False)
    without["index_types"] = IndexType.NONE
    reader = LogReader(foreign(tmp_path / "log.mcap", "std_msgs/msg/String", b"string data\n", texts, **without))
    assert [bytes(record.data) for record in reader.scan()] == texts
    assert (reader.topics, reader.dropped) == ({"/topic": "std_msgs/msg/String"}, {})


@pytest.mark.parametrize(("behind", "wrong"), [(0, False), (1, True), (2**62, True), (-301, True), (-300, False)])
def test_a_summary_that_is_nowhere_or_too_long_is_not_read(
    path: Path, whole: list, monkeypatch: pytest.MonkeyPatch, behind: int, wrong: bool
) -> None:
    monkeypatch.setattr("omninav.pipeline.mcap.summary.MAX_BYTES", 300)
    *records, end = records_of(path)
    start = path.stat().st_size - 37 + behind  # the end record's first byte, and so on
    reader = write_records(path, [*records, end[:9] + struct.pack("<Q", start) + end[17:25] + bytes(4)])
    assert (reader._summary.damage == "its end names a place where no summary is") is wrong
    monkeypatch.undo()
    assert keys(reader) == whole


def test_chunks_in_each_others_place_lose_nothing_and_are_noticed(path: Path, whole: list) -> None:
    records = records_of(path)
    one, other = [n for n, record in enumerate(records) if record[0] == 0x06][1:4:2]
    records[one], records[other] = records[other], records[one]
    reader = write_records(path, records)
    assert sorted(keys(reader)) == sorted(whole)
    assert reader.dropped


def test_a_changed_byte_that_no_chunk_covers_is_noticed(path: Path, whole: list) -> None:
    reader = LogReader(flipped(path, chunk_places(path)[0][0] + 3))  # the time that a chunk says it starts at
    assert keys(reader) == whole
    assert reader.dropped == {"bad_checksum": 1}


def test_a_summary_that_names_places_beyond_the_file_does_no_harm(path: Path, whole: list) -> None:
    records = records_of(path)
    for number, record in enumerate(records):
        if record[0] == 0x08:
            records[number] = record[:25] + struct.pack("<Q", 2**63 + number) + record[33:]
        elif record[0] == 0x02:
            records[number] = record[:25] + bytes(4)
    reader = write_records(path, records)
    assert keys(reader) == whole
    assert set(reader.dropped) == {"bad_chunk"}


def test_a_time_that_no_clock_shows_costs_its_message(tmp_path: Path) -> None:
    with written_log(tmp_path / "log.mcap") as log:
        log.write("/text", "std_msgs/msg/String", 7, {"data": "seven"}, log_time=2**64 - 1)
        log.write("/text", "std_msgs/msg/String", 8, {"data": "eight"})
    reader = LogReader(tmp_path / "log.mcap")
    assert [message.content.data for message in reader.messages()] == ["eight"]
    assert reader.dropped == {"bad_message": 1}


def chunk_of(content: bytes, size: int) -> bytes:
    """A chunk that says it unpacks to so many bytes."""
    packed = zstandard.compress(content)
    content = struct.pack("<QQQII", 0, 0, size, 0, 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
    return struct.pack("<BQ", 0x06, len(content)) + content


def loses_a_chunk(path: Path, whole: list) -> None:
    reader = LogReader(path)
    assert set(keys(reader)) < set(whole)
    assert reader.dropped["bad_chunk"]


@pytest.mark.parametrize("size", [6_000_000_000, 400_000_000, 100])
def test_a_chunk_that_unpacks_to_far_more_than_a_log_holds_is_not_unpacked(path: Path, whole: list, size: int) -> None:
    records = records_of(path)
    number = next(n for n, record in enumerate(records) if record[0] == 0x06)
    records[number] = chunk_of(bytes(400_000_000), size)
    path.write_bytes(MAGIC + b"".join(records) + MAGIC)
    assert memory_peak(loses_a_chunk, path, whole) < 50_000_000


def test_very_many_chunks_that_unpack_to_far_more_than_a_log_holds_are_not_read(tmp_path: Path) -> None:
    chunk = chunk_of(struct.pack("<BQ", 0x80, 4_000_000) + bytes(4_000_000), 4_000_009)
    (tmp_path / "log.mcap").write_bytes(MAGIC + 40 * chunk + struct.pack("<BQI", 0x0F, 4, 0))
    reader = LogReader(tmp_path / "log.mcap")
    assert keys(reader) == []
    assert "all that was unpacked so far is more than a log of" in reader.details["bad_chunk"]


def test_of_two_attachments_of_one_name_the_first_is_used_and_the_other_counted(tmp_path: Path) -> None:
    with written_log(tmp_path / "log.mcap") as log:
        for content in (b"first", b"first", b"other"):
            log.write("/pose", POSE, 1_700_000_000_000_000_000, {})
            log.attach("camera.yaml", content)
    reader = LogReader(tmp_path / "log.mcap")
    list(reader.scan())
    assert reader.attachments == {"camera.yaml": b"first"}
    assert reader.dropped["bad_attachment"] == 1
    assert "there is another 'camera.yaml' before it, which is used" in reader.details["bad_attachment"]


def test_a_file_may_unpack_to_so_many_bytes_and_messages() -> None:
    allowed = Allowance(80)
    allowed.unpack((1 << 26) + 128 * 80)
    for _ in range(100_000 + 10):
        allowed.read_message()
    for more in (lambda: allowed.unpack(1), allowed.read_message):
        with pytest.raises(ValueError, match="log of 80 bytes"):
            more()


@pytest.mark.parametrize(("bytes_", "limit"), [(100, 1 << 22), (20_000, 256 * (32 + 8 + 20_000))])
def test_a_chunk_may_say_that_it_unpacks_to_4_mb_or_256_times_its_bytes(bytes_: int, limit: int) -> None:
    for size, said in ((bytes_, None), (limit, "not as long as it states"), (limit + 1, f"unpack to {limit + 1}")):
        content = struct.pack("<QQQIIQ", 0, 0, size, 0, 0, bytes_) + bytes(bytes_)
        with nullcontext() if said is None else pytest.raises(ValueError, match=said):
            assert unpack(content, whole=True) == bytes(bytes_)
