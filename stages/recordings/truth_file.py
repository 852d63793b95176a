"""Ground truth from a file beside a log: a trajectory in TUM format, or a CSV table."""

import re
from pathlib import Path

import numpy as np
import numpy.typing as npt

from omninav.pipeline.graph.problems import counted, cut
from omninav.pipeline.graph.small_files import read_small

from .plausibility import MotionLimits, believed
from .positions import track_directions
from .recording import Recording, UnreadableRecording
from .stamps import ascending, poses_near
from .tables import MAX_TABLE_BYTES, Angle, CsvTable, Length, Time, read_table

Array = npt.NDArray[np.float64]
Stamps = npt.NDArray[np.int64]
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
"""What the columns of a CSV table may be called, in small letters, without units."""
UNITS = {"time": ("ns", "us", "ms", "s"), "x": ("m", "cm", "mm"), "y": ("m", "cm", "mm"), "heading": ("rad", "deg")}
DEFAULT_UNITS = {"time": "s", "x": "m", "y": "m", "heading": "rad"}
TANGENT_S = 1.0
"""Standard deviation of the window over which a table without headings is read for the track's direction."""


def truth_from(
    recording: Recording, file: Path, clock_offset_s: float, max_gap_s: float, limits: MotionLimits
) -> Array:
    """The true poses (N, 3) that a file holds of a recording's images, interpolated at their times.

    An image taken at t is looked up at t + `clock_offset_s`; it has no truth where the file's nearest pose is more than
    `max_gap_s` from that (a row of NaN), which is counted as `no_truth`, and poses to which no robot gets as
    `impossible_motion`. Raises `UnreadableRecording` for a file that holds no trajectory, and where no image has a
    true pose.
    """
    stamps, poses = read_trajectory(file)
    likely = believed(stamps, poses, limits).rows
    shifted = recording.stamps + round(clock_offset_s * 1e9)
    truth = poses_near(stamps[likely], poses[likely], shifted, max_gap_s) if len(likely) > 1 else None
    if truth is None or not np.isfinite(truth).any():
        raise UnreadableRecording(
            f"{file}: none of the images of {recording.name} has a pose in it: its times are {_span(stamps)}, "
            f"the images' {_span(shifted)}; clocks that differ: nodes.source.truth_clock_offset_s=SECONDS"
        )
    for kind, number, noun, what in (
        ("impossible_motion", len(stamps) - len(likely), "pose", "not believed (nodes.source.limits)"),
        ("no_truth", int(np.isnan(truth[:, 0]).sum()), "image", f"without a pose within {max_gap_s:g} s"),
    ):
        if number:
            recording.dropped[kind] += number
            recording.details.setdefault(kind, f"{file}: {counted(number, noun)} {what}")
    return truth


def read_trajectory(file: Path) -> tuple[Stamps, Array]:
    """Ascending stamps (ns) and poses (N, 3) of a trajectory. Raises `UnreadableRecording` or another `BadInput`."""
    head = read_small(file, MAX_TABLE_BYTES)[:4096].decode("utf-8-sig", errors="replace")
    lines = [line for line in head.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if lines and "," not in lines[0] and len(lines[0].split()) == 8:
        times, poses = _tum(file)
    else:
        times, poses = _csv(file)
    known = [row for row, time in enumerate(times) if time is not None and np.isfinite(poses[row, :2]).all()]
    kept, _, _ = ascending([times[row] or 0 for row in known])
    rows = [known[number] for number in kept]
    stamps, poses = np.array([times[row] for row in rows], np.int64), poses[rows]
    if len(rows) < 2:
        raise UnreadableRecording(f"{file}: fewer than two rows with a time and a position")
    if np.isnan(poses[:, 2]).any():
        poses[:, 2] = track_directions((stamps - stamps[0]) / 1e9, poses[:, :2], TANGENT_S)
    return stamps, poses


def _tum(file: Path) -> tuple[list[int | None], Array]:
    """Rows of `timestamp x y z qx qy qz qw`, with lines of comments."""
    content = read_small(file, MAX_TABLE_BYTES).decode("utf-8-sig", errors="replace").splitlines()
    lines = {n: line.split() for n, line in enumerate(content, 1) if line.strip() and not line.lstrip().startswith("#")}
    for number, cells in lines.items():
        if len(cells) != 8:
            raise UnreadableRecording(f"{file}, line {number}: {len(cells)} numbers, expected time x y z qx qy qz qw")
    table = CsvTable(file, tuple(map(str, range(8))), list(lines.values()), list(lines))
    return _poses(table, {"time": 0, "x": 1, "y": 2, "qx": 4, "qy": 5, "qz": 6, "qw": 7}, DEFAULT_UNITS)


def _csv(file: Path) -> tuple[list[int | None], Array]:
    """A table with a header: time, x, y and, where it has one, a heading or a quaternion."""
    table = read_table(file)
    found: dict[str, int] = {}
    units = dict(DEFAULT_UNITS)
    for number, name in enumerate(table.names):
        plain = re.sub(r"\s*\[[^\]]*\]", "", name.strip().lstrip("#").strip().lower())
        unit = re.search(r"\[\s*(\w+)\s*\]", name.lower())
        for meaning, options in COLUMNS.items():
            bare, _, suffix = plain.rpartition("_")
            known = UNITS.get(meaning, ())
            short = bare if bare and suffix in known else plain
            if short in options and meaning not in found:
                found[meaning] = number
                written = unit[1] if unit else suffix if short == bare else ""
                if written in known:
                    units[meaning] = written
    missing = [meaning for meaning in ("time", "x", "y") if meaning not in found]
    if missing:
        raise UnreadableRecording(
            f"{file}: no column for {' and '.join(missing)} among {cut(', '.join(table.names))}; a trajectory is a CSV "
            "with time, x, y and heading (or qx, qy, qz, qw) in its first line, or a TUM file (time x y z qx qy qz qw)"
        )
    return _poses(table, found, units)


def _poses(table: CsvTable, columns: dict[str, int], units: dict[str, str]) -> tuple[list[int | None], Array]:
    times = table.nanoseconds(Time(columns["time"], units["time"]))  # type: ignore[arg-type]
    x, y = (table.numbers(Length(columns[axis], units[axis])) for axis in ("x", "y"))  # type: ignore[arg-type]
    heading = np.full(len(x), np.nan)
    if "heading" in columns:
        heading = table.numbers(Angle(columns["heading"], units["heading"]))  # type: ignore[arg-type]
    elif all(part in columns for part in ("qx", "qy", "qz", "qw")):
        qx, qy, qz, qw = (table.numbers(Length(columns[part], "m")) for part in ("qx", "qy", "qz", "qw"))
        heading = np.arctan2(2 * (qw * qz + qx * qy), qw * qw + qx * qx - qy * qy - qz * qz)
    return times, np.column_stack([x, y, heading])


def _span(stamps: Stamps) -> str:
    return f"{stamps[0] / 1e9:.3f} to {stamps[-1] / 1e9:.3f} s"
