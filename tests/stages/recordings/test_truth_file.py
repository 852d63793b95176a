"""Ground truth from files beside a log, from other messages, and from transforms."""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conflicting_logs import ticks
from made_logs import FRAMES, START, TRUTH, Made, messages, pose_at, pose_fields, write_mcap
from scipy.spatial.transform import Rotation

from omninav.pipeline import Context
from omninav.pipeline.mcap.message_types import make_message
from omninav.stages.recordings.opening import open_recording
from omninav.stages.recordings.recording import Recording, Topics
from omninav.stages.recordings.truth_file import read_trajectory
from omninav.stages.source.log import LogSource

from .conftest import refused

SECONDS = tuple(0.1 * number for number in range(101))


def tum(path: Path, shift_s: float = START / 1e9, seconds: tuple[float, ...] = SECONDS) -> Path:
    rows = ["# timestamp x y z qx qy qz qw"]
    for at in seconds:
        x, y, heading = pose_at(at)
        turned = " ".join(map(str, Rotation.from_euler("ZYX", [heading, 0.4, -0.3]).as_quat()))  # on a hillside
        rows.append(f"{at + shift_s:.9f} {x:.9f} {y:.9f} 0 {turned}")
    path.write_text("\n".join(rows))
    return path


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("timestamp,x,y,yaw", "{t:.6f},{x},{y},{h}"),
        (
            "#timestamp [ns], p_RS_R_x [m], p_RS_R_y [m], q_RS_w [], q_RS_x [], q_RS_y [], q_RS_z []",
            "{ns},{x},{y},{qw},0,0,{qz}",
        ),
        ("time_ms,x_mm,y_mm,heading_deg", "{ms},{x_mm},{y_mm},{deg}"),
        ("timestamp (ms),x (mm),y [mm],yaw (deg)", "{ms},{x_mm},{y_mm},{deg}"),
        ("time [milliseconds],pos x [km],pos y [km],Heading_Degrees", "{ms},{x_km},{y_km},{deg}"),
        ("time [min],x [meters],y (m),heading [°]", "{min},{x},{y},{deg}"),
        ("UTC,time [UTC],time_seconds,x,y,yaw [mils],yaw deg", "0,0,{t},{x},{y},0,{deg}"),
        ("time;x;y;yaw", "{t};{x};{y};{h}"),
        ("time\tx\ty\tyaw", "{t}\t{x}\t{y}\t{h}"),
        ("# time  x y   yaw", "{t}  {x} {y}   {h}"),
        ("time x y z qx qy qz qw", "{t} {x} {y} 0 0 0 {qz} {qw}"),
        ("time,x,y,yaw", "{iso},{x},{y},{h}"),
    ],
)
def test_tables_are_read_by_the_names_and_units_of_their_columns(tmp_path: Path, header: str, row: str) -> None:
    rows = [header]
    for at in SECONDS:
        x, y, h = pose_at(at)
        in_si = {"t": at, "x": x, "y": y, "h": h, "qw": math.cos(h / 2), "qz": math.sin(h / 2)}
        others = {"ns": round(at * 1e9), "ms": at * 1e3, "x_mm": x * 1e3, "y_mm": y * 1e3, "deg": math.degrees(h)}
        others["iso"] = f"1970-01-01T{'02' if at < 5 else '00'}:00:{at:09.6f}{'+02:00' if at < 5 else 'Z'}"
        others |= {"min": f"{at / 60:.15f}", "x_km": f"{x / 1e3:.15f}", "y_km": f"{y / 1e3:.15f}"}
        rows.append(row.format(**in_si, **others))
    (tmp_path / "truth.csv").write_text("\n".join(rows))
    stamps, poses, *_ = read_trajectory(tmp_path / "truth.csv")
    np.testing.assert_allclose(stamps, np.array(SECONDS) * 1e9, atol=1)
    np.testing.assert_allclose(poses, [pose_at(at) for at in SECONDS], atol=1e-9)


@pytest.mark.parametrize("others", ["", ",yaw", ",yaw_rate,heading_std"])
def test_a_table_without_headings_is_read_for_the_tracks_direction(tmp_path: Path, others: str) -> None:
    (tmp_path / "truth.csv").write_text(f"t,x,y{others}\n" + "\n".join(f"{n},{n},{n}" for n in range(9)))
    found = read_trajectory(tmp_path / "truth.csv")
    assert found.poses[:, 2] == pytest.approx(np.full(9, math.pi / 4))
    assert not found.lost
    assert ["no headings; they are the direction of travel" in doubt for doubt in found.doubts] == [True]


@pytest.mark.parametrize(
    ("row", "lost"),
    [
        ("4,4,0,", "without a heading"),
        ("4,,0,1.5", "without x or y"),
        (",4,0,1.5", "without a time"),
        ("3,4,0,1.5", "not later than the row before"),
        ("4 4 0 0 nan nan nan nan", "without a heading"),
    ],
)
def test_a_row_that_lacks_something_costs_itself_alone(tmp_path: Path, row: str, lost: str) -> None:
    tum = "," not in row
    rows = [f"{n} {n} 0 0 0 0 1 0" if tum else f"{n},{n},0,{math.pi}" for n in range(9)]  # it drives backward
    rows[4] = row
    (tmp_path / "truth.txt").write_text("\n".join(rows if tum else ["time,x,y,yaw", *rows]))
    found = read_trajectory(tmp_path / "truth.txt")
    assert found.lost == {lost: 1}
    assert found.poses == pytest.approx(np.array([(n, 0, math.pi) for n in range(9) if n != 4]))
    assert not found.doubts


def test_rows_that_were_lost_are_counted_with_what_they_lack(tmp_path: Path) -> None:
    rows = [f"{START / 1e9 + at},{pose_at(at)[0]},{pose_at(at)[1]},{pose_at(at)[2]}" for at in SECONDS]
    rows[50] = rows[50].rpartition(",")[0] + ","
    (tmp_path / "truth.csv").write_text("\n".join(["time,x,y,yaw", *rows]))
    ctx = Context("source")
    found = list(ticks(LogSource(log=str(write_mcap(tmp_path / "log.mcap")), truth=str(tmp_path / "truth.csv")), ctx))
    assert ctx.counts["bad_truth_row"] == 1
    assert ctx.details["bad_truth_row"].endswith("truth.csv: 1 row left out: 1 without a heading")
    for out in found:
        expected = pose_at((out.tick.stamp - START) / 1e9)
        assert out.truth is None or out.truth.heading == pytest.approx(expected[2], abs=2e-2)


@pytest.mark.parametrize("order", [slice(None, None, -1), np.random.default_rng(0).permutation(len(SECONDS))])
def test_rows_in_another_order_are_read_in_that_of_their_times(tmp_path: Path, order: Any) -> None:
    lines = tum(tmp_path / "truth.tum").read_text().splitlines()[1:]
    forward = read_trajectory(tmp_path / "truth.tum")
    (tmp_path / "truth.tum").write_text("\n".join(np.array(lines)[order].tolist()))
    other = read_trajectory(tmp_path / "truth.tum")
    np.testing.assert_array_equal(other.stamps, forward.stamps)
    np.testing.assert_array_equal(other.poses, forward.poses)
    assert not other.lost


@pytest.mark.parametrize("year", ["0001", "9999"])
def test_a_date_that_no_stamp_holds_is_refused(tmp_path: Path, year: str) -> None:
    rows = [f"{year}-01-01T00:00:0{number}.123456789Z,{number},0,0" for number in range(5)]
    (tmp_path / "truth.csv").write_text("\n".join(["time,x,y,yaw", *rows]))
    with refused(f"column 'time': '{year}-01-01T00:00:00.123456789Z' is out of all proportion"):
        read_trajectory(tmp_path / "truth.csv")
    (tmp_path / "truth.csv").write_text("\n".join(["time,x,y,yaw", *rows]).replace(year, "2026"))
    assert read_trajectory(tmp_path / "truth.csv").stamps[1] % 10**9 == 123_456_000


def test_times_of_too_few_digits_are_named(tmp_path: Path) -> None:
    rows = [f"{START / 1e9 + at:.6e} {at} 0 0 0 0 0 1" for at in SECONDS]
    (tmp_path / "truth.tum").write_text("\n".join(rows))
    with refused("100 whose times repeat those of others .are they written with too few digits"):
        read_trajectory(tmp_path / "truth.tum")


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("name,x,z\na,1,2\n", "no column for time and y among 'name, x, z'; a trajectory is a CSV with time, x, y"),
        ("1 2 3 0 0 0 0 1\n2 3\n", "line 2: 2 numbers, expected time x y z qx qy qz qw"),
        ("t,x,y\n1,2,3\n", "fewer than two rows"),
        ("t,x [ft],y [ft]\n", r"csv: column 'x \[ft\]': 'ft' is none of its units, m, cm, mm, km, in; convert it"),
        ("t (days),x,y\n", "'days' is none of its units, ns, us, ms, s, min"),
        ("t,x,y,yaw (mils)\n", r"column 'yaw \(mils\)': 'mils' is none of its units, rad, deg"),
        ("t,x,y,yaw_rate,headingDeg\n", "csv: 'headingDeg' may tell of headings.* from x, is a column yaw or yaw_deg"),
        ("t,x,y,robot.orientation.w\n", "'robot.orientation.w' may tell of headings.* a quaternion qx, qy, qz and qw"),
        ("t,x,y,qz,qw\n", "'qz, qw' may tell of headings"),
        ("t,x,y\n1,2,3\n1,2,3\n,2,3\n", "of its 3 rows 1 without a time, 1 not later than the row before"),
        ('time,x,y\n"1,25","2,5",3\n', r"csv, line 2: column 'time': '1,25' has a decimal comma, .* a point: 1\.25"),
        ("time,x,y,yaw\n1,2,3,0.5\n2,2,3,'0,5'\n".replace("'", '"'), "line 3: column 'yaw': '0,5' has a decimal comma"),
        (
            "t,x,y\n1700000000000000000,2,3\n",
            "line 2: column 't': .* out of all proportion.* called time_ns, time_us or",
        ),
        (
            "1700000000000000000 0 0 0 0 0 0 1\n",
            "line 1: column 'time': .* at most 4.6e.09 s; the times of a TUM file are in seconds",
        ),
        ("1 1 0 0 0 0 0 0\n" * 9, "9 orientations whose quaternion is shorter than"),
    ],
)
def test_what_is_no_trajectory_says_what_is_missing(tmp_path: Path, content: str, said: str) -> None:
    (tmp_path / "truth.csv").write_text(content)
    with refused(said):
        read_trajectory(tmp_path / "truth.csv")


def test_a_file_beside_the_log_takes_the_place_of_its_own_truth(tmp_path: Path) -> None:
    without = (made for made in messages() if made.topic != TRUTH)
    log = str(write_mcap(tmp_path / "log.mcap", without))
    gap = tuple(at for at in SECONDS if not 2.0 < at < 5.0)
    ctx = Context("source")
    source = LogSource(
        log=log, truth=str(tum(tmp_path / "truth.tum", 100.0, gap)), truth_clock_offset_s=100 - START / 1e9
    )
    found = list(ticks(source, ctx))
    assert len(found) == FRAMES
    known = [out for out in found if out.truth is not None]
    for out in known:
        expected = pose_at((out.tick.stamp - START) / 1e9)
        assert (out.truth.x, out.truth.y, out.truth.heading) == pytest.approx(expected, abs=2e-2)
    assert 0 < ctx.counts["no_truth"] == FRAMES - len(known)
    assert "before its first pose, after its last, at a jump or more than 0.5 s from all" in ctx.details["no_truth"]
    assert ctx.facts["odometry"] == "measured"
    assert source.inputs_digest() != LogSource(log=log).inputs_digest()


def test_where_the_truth_of_a_file_jumps_an_image_has_none(tmp_path: Path) -> None:
    rows = [f"{START / 1e9 + at - 0.05:.3f} {100 * (n > 48)} 0 0 0 0 0 1" for n, at in enumerate(SECONDS)]
    (tmp_path / "truth.tum").write_text("\n".join(rows))
    source = LogSource(log=str(write_mcap(tmp_path / "log.mcap")), truth=str(tmp_path / "truth.tum"))
    truths = [out.truth for out in ticks(source, Context("source"))]
    assert {truth.x for truth in truths if truth is not None} == {0.0, 100.0}
    assert [number for number, truth in enumerate(truths) if truth is None] == [9]


def test_clocks_that_do_not_meet_are_said_with_both_spans(tmp_path: Path) -> None:
    log = str(write_mcap(tmp_path / "log.mcap"))
    with refused(r"times are 0.000 to 10.000 s, the images' 17.*truth_clock_offset_s"):
        list(ticks(LogSource(log=log, truth=str(tum(tmp_path / "truth.tum", 0.0))), Context("source")))


@pytest.mark.parametrize("still", [0, 50])
def test_a_track_too_fast_for_a_robot_is_said_with_its_limit_and_perhaps_its_unit(tmp_path: Path, still: int) -> None:
    rows = [f"{START / 1e9 + at:.3f} {1000 * max(n - still, 0)} 0 0 0 0 0 1" for n, at in enumerate(SECONDS)]
    (tmp_path / "truth.tum").write_text("\n".join(rows))
    log, ctx = str(write_mcap(tmp_path / "log.mcap")), Context("source")
    source, said = LogSource(log=log, truth=str(tmp_path / "truth.tum")), "of 101 beyond 15 m/s or 12.6 rad/s"
    if still:  # the part that stands still is believed
        list(ticks(source, ctx))
        assert said in ctx.details["impossible_motion"]
        return
    with refused(f"truth.tum: 101 poses {said}.*; are they centimetres or millimetres"):
        list(ticks(source, ctx))


def replaced(kind: str, fields: str) -> Iterator[Made]:
    def change(made: Made) -> list[Made]:
        if made.topic != TRUTH:
            return [made]
        pose = pose_fields(*pose_at((made.stamp - START) / 1e9))
        transform = {"translation": pose["position"], "rotation": pose["orientation"]}
        stamped = {"transform": transform, "child_frame_id": "base"}
        content = {
            "transform": stamped,
            "covariance": {"pose": {"pose": pose}},
            "tf": {"transforms": [transform_of(made.stamp, transform, "base"), transform_of(made.stamp, {}, "arm")]},
        }[fields]
        return [made._replace(topic="/truth", msgtype=kind, content=make_message(kind, content, made.stamp))]

    return messages(change)


def transform_of(stamp: int, transform: dict, child: str) -> object:
    made = make_message("geometry_msgs/msg/TransformStamped", {"transform": transform, "child_frame_id": child}, stamp)
    made.header.frame_id = "map"
    return made


@pytest.mark.parametrize(
    ("kind", "fields", "truth"),
    [
        ("geometry_msgs/msg/TransformStamped", "transform", "/truth"),
        ("geometry_msgs/msg/PoseWithCovarianceStamped", "covariance", "/truth"),
        ("tf2_msgs/msg/TFMessage", "tf", "/truth:map:base"),
    ],
)
def test_truth_comes_from_any_message_that_holds_a_pose(
    tmp_path: Path, whole: Recording, kind: str, fields: str, truth: str
) -> None:
    path = str(write_mcap(tmp_path / "log.mcap", replaced(kind, fields)))
    np.testing.assert_allclose(open_recording(path, Topics(truth=truth)).truth, whole.truth, atol=1e-9)


def test_a_transform_that_is_not_there_is_said_with_those_that_are(tmp_path: Path) -> None:
    path = str(write_mcap(tmp_path / "log.mcap", replaced("tf2_msgs/msg/TFMessage", "tf")))
    with refused(r"no transform /truth:world:base; type .*: /truth:map:base, /truth:map:arm"):
        open_recording(path, Topics(truth="/truth:world:base"))
    with refused("/odom carries nav_msgs/msg/Odometry, not transforms"):
        open_recording(path, Topics(truth="/odom:map:base"))


def test_orientations_that_are_no_rotation_are_counted_and_left_out(tmp_path: Path) -> None:
    file, rows = tmp_path / "truth.tum", tum(tmp_path / "truth.tum", START / 1e9).read_text().splitlines()
    for number in (20, 21, 50):
        rows[number] = " ".join([*rows[number].split()[:4], "0 0 0 0"])
    file.write_text("\n".join(rows))
    ctx = Context("source")
    list(ticks(LogSource(log=str(write_mcap(tmp_path / "log.mcap")), truth=str(file)), ctx))
    assert ctx.counts["impossible_pose"] == 3


@pytest.mark.parametrize(
    ("row", "doubted"),
    [
        ("{t} {t} 0 0 0 0 {s} {c}", False),  # x y z w
        ("{t} {t} 0 0 {c} 0 0 {s}", True),  # w x y z
        ("{t} {t} 0 0 0.7071 0 0 0.7071", True),  # a camera that looks along its own z
        ("{t} {t} 0 0 0.1 0 0 0.99", False),  # a hillside
    ],
)
def test_a_robot_that_would_lie_on_its_side_is_said(tmp_path: Path, row: str, doubted: bool) -> None:
    turns = {t: 0.3 * t / 2 for t in range(21)}  # all around the circle
    lines = [row.format(t=t, s=f"{math.sin(half):.6f}", c=f"{math.cos(half):.6f}") for t, half in turns.items()]
    (tmp_path / "truth.tum").write_text("\n".join(lines))
    doubts = read_trajectory(tmp_path / "truth.tum").doubts
    assert [("is w the first" in doubt) for doubt in doubts] == [True] * doubted


@pytest.mark.parametrize(
    ("column", "values", "doubted"),
    [("yaw", (0.0, 90.0, 290.0), True), ("yaw", (0.0, 3.0, 6.2), False), ("yaw_rad", (0.0, 3.0, 9.0), False)],
)
def test_headings_beyond_a_turn_without_a_unit_are_said_with_what_to_write(
    tmp_path: Path, column: str, values: tuple[float, ...], doubted: bool
) -> None:
    rows = "\n".join(f"{n},{n},0,{value}" for n, value in enumerate(values))
    (tmp_path / "truth.csv").write_text(f"time,x,y,{column}\n{rows}\n")
    doubts = read_trajectory(tmp_path / "truth.csv").doubts
    assert len(doubts) == doubted
    assert all("up to 290 are read as radians; degrees are a column 'yaw_deg'" in doubt for doubt in doubts)


def test_a_doubt_about_true_poses_is_a_warning_of_the_run(tmp_path: Path) -> None:
    rows = "\n".join(f"{START / 1e9 + at},{pose_at(at)[0]},{pose_at(at)[1]},{20 * at}" for at in SECONDS)
    (tmp_path / "truth.csv").write_text(f"time,x,y,yaw\n{rows}\n")
    ctx = Context("source")
    list(ticks(LogSource(log=str(write_mcap(tmp_path / "log.mcap")), truth=str(tmp_path / "truth.csv")), ctx))
    assert sum("read as radians" in sentence for sentence in ctx.warnings) == 1


@pytest.mark.parametrize("is_known", [False, True])
def test_an_orientation_that_never_changes_is_none(tmp_path: Path, is_known: bool) -> None:
    corner = ((t, 0.5 * min(t, 8), 0.5 * max(t - 8, 0), t / 20 * is_known) for t in range(17))
    rows = (f"{START / 1e9 + t:.3f} {x} {y} 0 0 0 {math.sin(half)} {math.cos(half)}" for t, x, y, half in corner)
    (tmp_path / "truth.tum").write_text("\n".join(rows))
    found = read_trajectory(tmp_path / "truth.tum")
    assert any("direction of travel" in doubt for doubt in found.doubts) != is_known
    assert is_known or abs(found.poses[-2, 2] - math.pi / 2) < 0.2


def test_what_comes_after_whole_seconds_is_read(tmp_path: Path) -> None:
    rows = [f"{START // 10**9 + n // 2},{n % 2 * 500_000_000},{n},0,0" for n in range(6)]
    (tmp_path / "truth.csv").write_text("\n".join(["sec,nsec,x,y,yaw", *rows]))
    assert np.diff(read_trajectory(tmp_path / "truth.csv").stamps).tolist() == [500_000_000] * 5
