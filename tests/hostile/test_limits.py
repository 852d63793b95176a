"""Small inputs that would take minutes or gigabytes: each is refused or counted within limits of time and memory."""

import bz2
import os
import sqlite3
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import made_logs
import numpy as np
import pytest
from mcap.writer import CompressionType, IndexType, Writer

from hostile.harness import within
from omninav.pipeline import BadInput
from omninav.pipeline.cli.main import main
from omninav.pipeline.mcap.reader import LogReader
from omninav.pipeline.tables import read_table
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.plausibility import MotionLimits, believed
from omninav.stages.recordings.positions import track_directions
from omninav.stages.recordings.rosbag import _Limits, _Sqlite
from omninav.stages.recordings.stamps import ascending_rows
from omninav.stages.recordings.truth_file import read_trajectory

COMMAND_S = 8.0
"""Processor seconds of a command that composes a configuration, as for the formats beside this file."""


def bomb(kind: str, levels: int) -> str:
    """A configuration whose interpolations repeat ten values for each of its lines."""
    lines = {
        "text": ["a0: aaaaaaaaaa", *(f"a{n}: {f'${{a{n - 1}}}' * 10}" for n in range(1, levels))],
        "list": ["a0: [1, 2]", *(f"a{n}: [" + 10 * f"'${{a{n - 1}}}', " + "]" for n in range(1, levels))],
        "computed name": ["one: a0", "a0: x", *(f"a{n}: {f'${{oc.select:a{n - 1}}}' * 10}" for n in range(1, levels))],
        "decoded": ["d: $", "a0: x"]
        + [f'a{n}: "{f"${{oc.decode:${{d}}{{a{n - 1}}}}}" * 10}"' for n in range(1, levels)],
        "node": [f"nodes: {{match: {{x: '{'${nodes}' * 10}'}}}}"],
        "long": [f"a0: {'a' * 200_000}", f"a1: {'${a0}' * 5000}"],
    }[kind]
    return "# @package _global_\n" + "\n".join(lines) + "\n"


@pytest.mark.parametrize("kind", ["text", "list", "computed name", "decoded", "node", "long"])
def test_interpolations_that_multiply_are_refused_in_one_problem(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], kind: str
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "my/match").mkdir(parents=True)
    (tmp_path / "my/match/mine.yaml").write_text(bomb(kind, 8))
    with within(COMMAND_S):
        assert main(["check", "--config-dir=my", "match=mine"]) == 2
    said = capsys.readouterr().err
    assert "Traceback" not in said
    assert kind in ("decoded", "node") or "interpolations repeat more than 10,000 values" in said
    assert [path.name for path in tmp_path.iterdir()] == ["my"]


def test_links_between_folders_of_configurations_are_not_followed_when_names_are_listed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
):
    monkeypatch.chdir(tmp_path)
    Path("my/match").mkdir(parents=True)
    Path("my/match/mine.yaml").write_text("a: 1\n")
    for name, target in (("match/self", "."), ("match/self2", "."), ("match/up", ".."), ("again", ".")):
        Path("my", name).symlink_to(target)
    with within(COMMAND_S):
        assert main(["check", "--config-dir=my", "match=minr"]) == 2
    assert "did you mean 'match=mine'?" in capsys.readouterr().err


@pytest.mark.parametrize("value", ["zeroblob(900000000)", "zeroblob(9000000)", "printf('%.*c', 900000000, 'x')"])
def test_a_computed_column_of_a_bag_is_refused(tmp_path: Path, value: str):
    with sqlite3.connect(tmp_path / "bag_0.db3") as base:
        base.executescript(
            "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, "
            "offered_qos_profiles TEXT); INSERT INTO topics VALUES"
            "(1, '/camera/image/compressed', 'sensor_msgs/msg/CompressedImage', 'cdr', ''); "
            "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER)"
        )
        base.executemany("INSERT INTO messages VALUES (?, 1, ?)", [(number, number) for number in range(100)])
        base.execute(f"ALTER TABLE messages ADD COLUMN data BLOB GENERATED ALWAYS AS ({value}) VIRTUAL")
    with within(), pytest.raises(BadInput, match="is computed"):
        open_recording(str(tmp_path))


@pytest.mark.parametrize("module", [sqlite3, pytest.importorskip("apsw")], ids=lambda module: module.__name__)
def test_a_question_of_sqlite_that_does_not_end_is_given_up(tmp_path: Path, module: Any):
    (tmp_path / "bag.db3").write_bytes(bytes(1000))
    database = _Sqlite(module, _Limits([tmp_path / "bag.db3"]))
    connection = (database.connect if module is sqlite3 else database.Connection)(":memory:")
    with within(), pytest.raises(Exception, match="nterrupt"):
        connection.execute(
            "WITH RECURSIVE n(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM n) SELECT count(*) FROM n"
        ).fetchall()
    with within(), pytest.raises(Exception, match="too big"):
        connection.execute("SELECT zeroblob(900000000)").fetchall()


def test_the_chunks_of_a_ros_1_bag_unpack_within_a_total(tmp_path: Path):
    (tmp_path / "x.bag").write_bytes(bytes(1000))
    limits, packed = _Limits([tmp_path / "x.bag"]), bz2.compress(bytes(30_000_000))
    assert sum(len(limits.bz2(packed)) for _ in range(2)) == 60_000_000
    with pytest.raises(ValueError, match="all that was unpacked so far is more than a log of 1,000 bytes holds"):
        limits.bz2(packed)
    limits.begin()
    limits.bz2(packed)


def test_of_more_messages_than_a_file_of_its_size_holds_the_rest_is_counted(tmp_path: Path):
    number = 120_000
    with (tmp_path / "log.mcap").open("wb") as file:  # one chunk of messages that are all alike
        writer = Writer(file, chunk_size=1 << 26, compression=CompressionType.ZSTD, index_types=IndexType.NONE)
        writer.start()
        schema = writer.register_schema("std_msgs/msg/Empty", "ros2msg", b"")
        channel = writer.register_channel("/camera/image/compressed", "cdr", schema)
        for _ in range(number):
            writer.add_message(channel, 0, b"", 0)
        writer.finish()
    reader = LogReader(tmp_path / "log.mcap")
    with within(2.0):
        found = sum(1 for _ in reader.scan())
    assert found == 100_000 + (tmp_path / "log.mcap").stat().st_size // 8 < number
    assert "these are more messages than a log of" in reader.details["bad_chunk"]
    assert reader.dropped["missing_message"] == number - found


TABLES: dict[str, tuple[Callable[[], str], str]] = {
    "short rows": (lambda: "1\n" * 400_000, "fewer than two rows with a time and a pose"),
    "words": (lambda: "a,b,c\n" * 400_000, "fewer than two rows with a time and a pose"),
    "commas": (lambda: (4000 * "," + "\n") * 2500, "fewer than two rows with a time and a pose"),
    "too many rows": (lambda: "1\n" * 10_000_000, "more than 1,000,000 lines"),
    "too many rows of an old Mac": (lambda: "1\r" * 10_000_000, "more than 1,000,000 lines"),
    "a row of commas": (lambda: "," * 60_000_000, "line 2: a row of more than 100,000 characters"),
    "a row of lines": (lambda: '"\n",' * 900_000, "line 2: a quote is opened and not closed"),
    "a column for each byte": (lambda: "t,x,y" * 12_000_000, "line 1: a row of more than 100,000 characters"),
}


@pytest.mark.parametrize("kind", TABLES)
def test_a_table_of_no_use_takes_memory_in_proportion(tmp_path: Path, kind: str):
    make, said = TABLES[kind]
    (tmp_path / "truth.csv").write_text(("" if "column" in kind else "t,x,y,yaw\n") + make())
    with within(4.0, 150_000_000), pytest.raises(BadInput, match=said):
        read_trajectory(tmp_path / "truth.csv")


def test_a_tum_file_of_one_line_takes_memory_in_proportion(tmp_path: Path):
    (tmp_path / "truth.tum").write_text("1 1 1 0 0 0 0 1\n" + "10 " * 20_000_000)
    with within(1.0, 100_000_000), pytest.raises(BadInput, match="line 2: a row of more than 100,000 characters"):
        read_trajectory(tmp_path / "truth.tum")


def test_a_large_table_is_read_by_columns(tmp_path: Path):
    rows = (f"{1_700_000_000 + n / 100:.2f},{n % 1000 / 100:.6f},{n // 1000:.6f},0.5" for n in range(250_000))
    (tmp_path / "truth.csv").write_text("t,x,y,yaw\n" + "\n".join(rows))
    with within(3.0, 120_000_000):
        assert len(read_trajectory(tmp_path / "truth.csv").stamps) == 250_000


def test_a_large_trajectory_as_numpy_writes_it_is_read_by_columns(tmp_path: Path):
    rows = np.tile([0, 1, 2, 0, 0, 0, 0, 1.0], (60_000, 1))
    rows[:, 0] = np.arange(60_000) / 100
    np.savetxt(tmp_path / "truth.tum", rows)
    with within(1.0, 60_000_000):  # as numbers one by one it takes 3 s
        assert len(read_trajectory(tmp_path / "truth.tum").stamps) == 60_000


def test_a_track_that_leaps_at_every_pose_is_judged_in_proportion():
    chance, number = np.random.default_rng(0), 60_000
    poses = chance.uniform(0, 1000, (number, 3))
    with within(1.0):
        kept = believed(np.arange(number) * 10**8, poses, MotionLimits())
    assert len(kept.rows) < number / 10


def test_stamps_in_disorder_are_put_in_order_in_proportion():
    stamps = np.random.default_rng(0).permutation(1_000_000)
    with within(3.0, 80_000_000):
        kept = ascending_rows(stamps)
    assert (np.diff(stamps[kept]) > 0).all()


def test_positions_that_lie_close_together_have_directions_in_proportion():
    number = 25_000
    along = np.arange(number) * 1e-6
    with within(3.0):
        directions = track_directions(along, np.column_stack([along, along]), window=1.0)
    np.testing.assert_allclose(directions, np.pi / 4)


UNDER_A_LIMIT = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (4_000_000_000, 4_000_000_000))
from pathlib import Path
import numpy as np
from omninav.pipeline.tables import read_table, write_table
from omninav.stages.recordings.truth_file import read_trajectory
print(len(read_trajectory(Path("truth.csv")).stamps))
write_table(Path("frames").absolute(), {"x": np.ma.masked_invalid([1.0, np.nan])})
print(len(read_table(Path("frames.parquet").absolute())))
"""


def test_tables_are_read_and_written_under_a_limit_of_addresses_in_a_folder_whose_name_is_not_utf_8(tmp_path: Path):
    folder = tmp_path / os.fsdecode(b"caf\xe9")
    folder.mkdir()
    (folder / "truth.csv").write_text("t,x,y,yaw\n0,0,0,0\n1,1,0,0\n")
    done = subprocess.run(
        [sys.executable, "-c", UNDER_A_LIMIT], cwd=folder, capture_output=True, text=True, timeout=60, check=False
    )
    assert (done.returncode, done.stdout, done.stderr) == (0, "2\n2\n", "")


def test_a_command_without_memory_ends_in_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]):
    def command(arguments: list[str]) -> int:
        raise MemoryError

    monkeypatch.setattr("omninav.pipeline.cli.commands.stages.command", command)
    assert main(["stages"]) == 2
    assert capsys.readouterr().err == (
        "there is no memory left; close other programs, or raise the limit (`ulimit -v`)\n"
    )


@pytest.mark.parametrize("pattern", ["*/*/*/*/*/*/*/*.jpg", "**/*/*/*/*/*/*.jpg"])
def test_links_between_folders_of_images_are_not_followed_again_and_again(tmp_path: Path, pattern: str):
    for one in "abcdef":
        (tmp_path / one).mkdir()
        for other in "abcdef":
            (tmp_path / one / f"to_{other}").symlink_to(tmp_path / other)
    (tmp_path / "recording.yaml").write_text(f"frames: {{images: '{pattern}', period: 1}}\n")
    with within(), pytest.raises(BadInput, match="no image fits"):
        open_recording(str(tmp_path))


def test_a_table_of_parquet_unpacks_in_proportion_to_its_size(tmp_path: Path):
    import pyarrow as pa
    import pyarrow.parquet as parquet

    zeros = pa.table({"tick": np.zeros(1_000_000, np.int64)})
    with parquet.ParquetWriter(tmp_path / "frames.parquet", zeros.schema) as writer:
        for _ in range(20):
            writer.write_table(zeros)
    with within(2.0, 150_000_000), pytest.raises(BadInput, match="unpacks to more than a table of its size holds"):
        read_table(tmp_path / "frames.parquet")


HEADER = "std_msgs/Header header\nstring format\nuint8[] data\n"
OTHERS = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
}
TYPES: dict[str, dict[str, str]] = {
    "a long array": {"": "std_msgs/Empty[4000000000] more\n", "std_msgs/Empty": ""},
    "arrays in arrays": {
        "": "a/A[1000] more\n",
        "a/A": "a/B[1000] more\n",
        "a/B": "a/C[1000] more\n",
        "a/C": "uint8[0] x",
    },
    "a long array of texts": {"": "string[4000000000] more\n"},
    "pairs of pairs": {"": "a/P0 more\n", "a/P40": "uint8[0] x"}
    | {f"a/P{n}": f"a/P{n + 1} x\na/P{n + 1} y\n" for n in range(40)},
}


@pytest.mark.parametrize("kind", TYPES)
def test_of_a_message_type_with_arrays_that_multiply_nothing_is_read(tmp_path: Path, kind: str):
    parts = OTHERS | TYPES[kind]
    definition = HEADER + parts.pop("")
    for name, fields in parts.items():
        definition += f"{'=' * 80}\nMSG: {name}\n{fields}"
    message = b"\0\1\0\0" + struct.pack("<iII4sI4sII", 1, 0, 1, b"", 1, b"", 0, 4_000_000_000) + bytes(1000)
    with (tmp_path / "log.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("sensor_msgs/msg/CompressedImage", "ros2msg", definition.encode())
        channel = writer.register_channel("/camera/image/compressed", "cdr", schema)
        writer.add_message(channel, 10**9, message, 10**9)
        writer.finish()
    (tmp_path / "camera.yaml").write_bytes(made_logs.CAMERA)
    with within(), pytest.raises(BadInput, match="not one of its 1 images can be decoded"):
        open_recording(str(tmp_path / "log.mcap"))
