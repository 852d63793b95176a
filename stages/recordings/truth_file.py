"""Ground truth from a file beside a log: a trajectory in TUM format, or a CSV table."""

import math
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from omninav.pipeline import counted, cut, read_small
from omninav.stages.geometry.arrays import Array

from . import tables
from .plausibility import MotionLimits, believed
from .positions import track_directions
from .recording import Recording, UnreadableRecording
from .stamps import Stamps, ascending_rows, poses_near, within

NANOSECONDS = ("nsec", "nsecs", "nanosec", "nanosecs", "nanoseconds")
"""Columns with what comes after whole seconds, as in the stamps of ROS."""
MIN_UNTURNED_M = 1.0
"""A robot that drives further than this along both axes without turning at all is one whose orientation is not known
(m)."""
COLUMNS = {
    "time": ("t", "time", "timestamp", "stamp", "sec", "seconds"),
    "x": ("x", "px", "pos_x", "position_x", "tx", "p_rs_r_x", "truth_x"),
    "y": ("y", "py", "pos_y", "position_y", "ty", "p_rs_r_y", "truth_y"),
    "heading": ("heading", "yaw", "theta", "psi", "truth_heading"),
    "qx": ("qx", "q_x", "orientation_x", "q_rs_x"),
    "qy": ("qy", "q_y", "orientation_y", "q_rs_y"),
    "qz": ("qz", "q_z", "orientation_z", "q_rs_z"),
    "qw": ("qw", "q_w", "orientation_w", "q_rs_w"),
}
"""Accepted names of a CSV table's columns, in small letters, without units."""
DELIMITERS: tuple[tables.Delimiter, ...] = (",", ";", "\t")
"""Signs between a table's columns, by the first that its header has; else blanks."""
QUATERNION = ("qx", "qy", "qz", "qw")
LIKE_HEADING = re.compile(r"heading|hdg|yaw|theta|(?<![a-z])psi(?![a-z])|azimuth|bearing|orientation|rotation|quat")
NO_HEADING = re.compile(r"rate|vel|speed|acc|std|sigma|var|cov|err|dot")
"""Names of columns that may hold a heading, and those among them that hold its speed or its error."""
UNITS = {"time": tables.TIMES, "x": tables.LENGTHS, "y": tables.LENGTHS, "heading": tables.ANGLES}
DEFAULT_UNITS: dict[str, Any] = {"time": "s", "x": "m", "y": "m"}
MAX_TILT_DEG, MAX_TILTED = 60.0, 0.05
"""Tilt that no robot on a floor or a hillside has (degrees), and the share of a file's orientations that may have it.
With w first, headings become tilts, so that a drive in all directions has it in half of them."""
NO_ROTATION = "whose quaternion is shorter than 0.5 or longer than 2"
Rows = tuple[Stamps, Array, int, list[str]]
"""Content of a file: times (ns), poses (N, 3), how many of them are impossible, and doubts."""
TANGENT_S = 1.0
"""Standard deviation of the window over which a table without headings is read for the track's direction."""


class Trajectory(NamedTuple):
    """Ascending stamps (ns) and poses (N, 3) of a file; how many rows were `impossible`, and `lost` by what they lack;
    and `doubts`, in sentences."""

    stamps: Stamps
    poses: Array
    impossible: int
    lost: dict[str, int]
    doubts: list[str]


def truth_from(
    recording: Recording, file: Path, clock_offset_s: float, max_gap_s: float, limits: MotionLimits
) -> tuple[Array, list[str]]:
    """The true poses (N, 3) that a file holds of a recording's images, interpolated at their times; and doubts.

    An image taken at t is looked up at t + `clock_offset_s`; it has no truth before the file's first pose, after its
    last, at a jump, and more than `max_gap_s` from the nearest (a row of NaN), which is counted as `no_truth`, poses to
    which no robot gets as `impossible_motion`, orientations whose quaternion is no rotation as `impossible_pose`, and
    rows that lack something as `bad_truth_row`. Raises `UnreadableRecording` for a file that holds no trajectory, and
    where no image has a true pose.
    """
    stamps, poses, impossible, lost, doubts = read_trajectory(file)
    likely, jumps, _ = believed(stamps, poses, limits)
    shifted = recording.stamps + round(clock_offset_s * 1e9)
    begun = stamps[likely[jumps]]
    truth = poses_near(stamps[likely], poses[likely], shifted, max_gap_s, begun) if len(likely) > 1 else None
    unlikely = len(stamps) - len(likely)
    fast = f"of {len(stamps):,} beyond {limits.speed:g} m/s or {limits.turn:.3g} rad/s (nodes.source.limits)"
    if too_fast := 2 * unlikely > len(stamps):
        fast += "; are they centimetres or millimetres? A TUM file is in metres, a CSV's columns may be x_mm and y_mm"
    if too_fast and within(shifted, stamps).any():
        raise UnreadableRecording(f"{file}: {counted(unlikely, 'pose')} {fast}")
    if truth is None or not np.isfinite(truth).any():
        raise UnreadableRecording(
            f"{file}: none of the images of {recording.name} has a pose in it: its times are {_span(stamps)}, "
            f"the images' {_span(shifted)}; clocks that differ: "
            "nodes.source.truth_clock_offset_s=SECONDS, the file's clock minus the log's"
        )
    far = f"before its first pose, after its last, at a jump or more than {max_gap_s:g} s from all"
    for kind, number, noun, what in (
        ("bad_truth_row", sum(lost.values()), "row", f"left out: {_listed(lost)}"),
        ("impossible_pose", impossible, "orientation", NO_ROTATION),
        ("impossible_motion", unlikely, "pose", fast),
        ("no_truth", int(np.isnan(truth[:, 0]).sum()), "image", far),
    ):
        if number:
            recording.dropped[kind] += number
            recording.details.setdefault(kind, f"{file}: {counted(number, noun)} {what}")
    return truth, doubts


def read_trajectory(file: Path) -> Trajectory:
    """The trajectory in a file. Raises `UnreadableRecording` or another `BadInput`."""
    times, poses, impossible, doubts = trajectory_rows(file)
    placed, timed, headed = np.isfinite(poses[:, :2]).all(axis=1), times != tables.NO_TIME, np.isfinite(poses[:, 2])
    if not headed[placed & timed].any():  # one heading that is missing costs its own row, not the others' headings
        headed[:] = True
    known = np.flatnonzero(placed & timed & headed)
    rows = known[ascending_rows(times[known])]
    if 2 * len(rows) < len(known):  # its rows are in another order, as in one that begins with the last pose
        known = known[np.argsort(times[known], kind="stable")]
        rows = known[ascending_rows(times[known])]
    late = "not later than the row before"
    if 2 * len(rows) < len(known):
        late = "whose times repeat those of others (are they written with too few digits?)"
    lost = {
        "without x or y": int((~placed).sum()) - impossible,
        "without a time": int((placed & ~timed).sum()),
        "without a heading": int((placed & timed & ~headed).sum()),
        late: len(known) - len(rows),
    }
    lost = {what: number for what, number in lost.items() if number}
    if len(rows) < 2:
        without = f"; {counted(impossible, 'orientation')} {NO_ROTATION}" if impossible else ""
        without += f"; of its {counted(len(times), 'row')} {_listed(lost)}" if lost else ""
        raise UnreadableRecording(f"{file}: fewer than two rows with a time and a pose{without}")
    stamps, poses = times[rows], poses[rows]
    if np.isnan(poses[:, 2]).any():
        poses[:, 2] = track_directions((stamps - stamps[0]) / 1e9, poses[:, :2], TANGENT_S)
        doubts = [*doubts, "it has no headings; they are the direction of travel"]
    return Trajectory(stamps, poses, impossible, lost, [f"{file}: {doubt}" for doubt in doubts])


def trajectory_rows(file: Path) -> Rows:
    """The rows of a file as they are, in TUM's format or a CSV table. Raises `BadInput`."""
    head = read_small(file, tables.MAX_TABLE_BYTES)[:4096].decode("utf-8-sig", errors="replace")
    lines = [line for line in head.splitlines() if line.strip()]
    rows = [line for line in lines if not line.lstrip().startswith("#")]
    if rows and "," not in rows[0] and len(rows[0].split()) == 8 and re.search(r"\d", rows[0]):
        return _tum(file)
    blank: tables.Delimiter = " "
    return _csv(file, next((sign for sign in DELIMITERS if lines and sign in lines[0]), blank))


def _tum(file: Path) -> Rows:
    """Rows of `timestamp x y z qx qy qz qw`, with lines of comments."""

    def rows() -> Iterator[tuple[int, list[str]]]:
        for number, line in enumerate(tables.text_lines(file), 1):
            cells = line.split()
            if not cells or cells[0].startswith("#"):
                continue
            if len(cells) != 8:
                what = f"{len(cells)} numbers, expected time x y z qx qy qz qw"
                raise UnreadableRecording(f"{file}, line {number}: {what}")
            yield number, cells

    names = ("time", "x", "y", "z", "qx", "qy", "qz", "qw")
    columns = {name: number for number, name in enumerate(names) if name != "z"}
    return _poses(
        tables.table_of(file, names, rows()), columns, DEFAULT_UNITS, "the times of a TUM file are in seconds"
    )


def _csv(file: Path, delimiter: tables.Delimiter) -> Rows:
    """A table with a header: time, x, y and, where it has one, a heading or a quaternion."""
    table = tables.read_table(file, delimiter=delimiter)
    found, units = _columns(table)
    missing = [meaning for meaning in ("time", "x", "y") if meaning not in found]
    if missing:
        raise UnreadableRecording(
            f"{file}: no column for {' and '.join(missing)} among {cut(', '.join(table.names))}; a trajectory is a CSV "
            "with time, x, y and heading (or qx, qy, qz, qw) in its first line, or a TUM file (time x y z qx qy qz qw)"
        )
    turned = [table.names[found[part]] for part in QUATERNION if part in found]
    if "heading" not in found and len(turned) < len(QUATERNION):
        likely = [name for name in table.names if LIKE_HEADING.search(name.lower())]
        unread = turned + [name for name in likely if not NO_HEADING.search(name.lower())]
        if unread:
            raise UnreadableRecording(
                f"{file}: {cut(', '.join(unread))} may tell of headings, but is none by its name: a heading, counter-"
                "clockwise from x, is a column yaw or yaw_deg, a quaternion qx, qy, qz and qw; rename it or drop it"
            )
    return _poses(table, found, units, "a column of times in other units is called time_ns, time_us or time_ms")


def _columns(table: tables.CsvTable) -> tuple[dict[str, int], dict[str, Any]]:
    """Columns by their meaning, and the units that their names state. Raises `UnreadableRecording` for others."""
    found: dict[str, int] = {}
    units = dict(DEFAULT_UNITS)
    unknown: dict[str, str] = {}
    for number, name in enumerate(table.names):
        plain, *rest = re.split(r"[\[(]", name.lower().strip("# "), maxsplit=1)
        plain, bracketed = plain.strip().replace(" ", "_"), "".join(rest).strip(" ])")
        bare, _, suffix = plain.rpartition("_")
        for meaning, options in COLUMNS.items():
            known = UNITS.get(meaning, {})
            short = bare if bare and tables.unit_named(suffix) in known else plain
            if short not in options or meaning in found:
                continue
            written = tables.unit_named(bracketed or (suffix if short == bare else "")) if known else ""
            if written and written not in known:
                unknown[meaning] = f"column {cut(name)}: {cut(bracketed)} is none of its units, {', '.join(known)}"
                continue
            found[meaning] = number
            if written:
                units[meaning] = written
    for meaning, what in unknown.items():
        if meaning not in found:  # else another column has it, in a unit that is known
            raise UnreadableRecording(f"{table.path}: {what}; convert it, or rename the column")
    return found, units


def _poses(table: tables.CsvTable, columns: dict[str, int], units: dict[str, Any], cure: str) -> Rows:
    """The poses in a table. `cure`: advice where times are too large to be in their unit."""
    try:
        times = table.nanoseconds(tables.Time(columns["time"], units["time"]))
    except tables.OutOfProportion as error:
        raise UnreadableRecording(f"{error}; {cure}") from None
    rest = next((row for row, name in enumerate(table.names) if name.lower() in NANOSECONDS), None)
    if rest is not None and table.names[columns["time"]].lower().startswith("sec"):
        known = times != tables.NO_TIME
        times[known] += np.nan_to_num(table.numbers(tables.Length(rest, "m")))[known].astype(np.int64)
    x, y = (table.numbers(tables.Length(columns[axis], units[axis])) for axis in ("x", "y"))
    heading, impossible = np.full(len(x), np.nan), 0
    doubts: list[str] = []
    if "heading" in columns:
        heading = table.numbers(tables.Angle(columns["heading"], units.get("heading", "rad")))
        most = float(np.abs(heading).max(where=np.isfinite(heading), initial=0.0))
        if "heading" not in units and most > 2 * math.pi:
            name = table.names[columns["heading"]]
            doubts.append(
                f"headings of up to {most:.3g} are read as radians; degrees are a column {cut(name + '_deg')}"
            )
    elif all(part in columns for part in QUATERNION):
        qx, qy, qz, qw = (table.numbers(tables.Length(columns[part], "m")) for part in QUATERNION)
        heading = np.arctan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
        placed = np.isfinite(x + y + heading)
        if len(np.unique(heading[placed])) == 1 and min(np.ptp(x[placed]), np.ptp(y[placed])) > MIN_UNTURNED_M:
            heading[:] = np.nan
        squares = qx * qx + qy * qy + qz * qz + qw * qw
        wrong = (squares < 0.25) | (squares > 4.0)  # as of the messages of a topic
        impossible = int(wrong.sum())
        x = np.where(wrong, np.nan, x)
        upright = (squares - 2 * (qx * qx + qy * qy))[squares > 0] / squares[squares > 0]  # cosine of the tilt
        tilted = float((upright < math.cos(math.radians(MAX_TILT_DEG))).mean()) if len(upright) else 0.0
        if tilted > MAX_TILTED:
            how = f"{tilted:.0%} of its orientations are tilted by more than {MAX_TILT_DEG:g} degrees"
            doubts.append(f"{how}: a robot is on its side, or a camera's frame; is w the first of their quaternions?")
    return times, np.column_stack([x, y, heading]), impossible, doubts


def _span(stamps: Stamps) -> str:
    return f"{stamps[0] / 1e9:.3f} to {stamps[-1] / 1e9:.3f} s"


def _listed(lost: dict[str, int]) -> str:
    return ", ".join(f"{number:,} {what}" for what, number in lost.items())
