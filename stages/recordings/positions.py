"""Poses of a folder's images, from a table of positions: joined by time, with headings measured or of the track."""

import math
from math import pi

import numpy as np

from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.geometry.plane.se2 import distances_along, wrap

from .description import Description, Heading
from .plausibility import MotionLimits, believed
from .recording import UnreadableRecording
from .stamps import Stamps, ascending_rows, poses_near
from .tables import NO_TIME, Angle, CsvTable, Length

MAX_SKEW = 0.1
"""Difference of a rotation's cells from those of a rotation; files round to three digits."""
MAX_STEEP_DEG = 60.0
"""Slope of what points ahead of a robot, in the median (degrees)."""
MAX_FITTED = 1000
"""Positions that the direction at a point is fitted to: of eight seconds at 125 Hz."""
MIN_WAY, MIN_WAY_M, SURE = 10.0, 0.05, 4.0
"""Way over two windows below which a robot stands: in standard deviations of a position, but no more than so many
metres, and in standard deviations of the way."""
QUIET, QUIET_OF_MEAN = 0.25, 0.288
"""Quantile of the noise at all positions, which straight and standing parts show, and what it is of the mean there."""


def frame_poses(
    description: Description,
    where: str,
    frames: CsvTable | None,
    own: CsvTable | None,
    times: Stamps,
    limits: MotionLimits,
) -> tuple[Array, list[str]]:
    """Poses (N, 3) of all frames at their `times` (ns), NaN where there is none, and which rows are not believed.

    `frames` and `own`: the tables of the frames and of the positions alone, as far as there are any. Raises
    `UnreadableRecording`, naming `where` the description is.
    """
    positions = description.positions
    assert positions is not None
    table = own or frames
    if table is None:
        raise UnreadableRecording(f"{where}: positions.csv is missing: the table with positions")
    x = table.numbers(positions.x) + positions.offset_x
    y = table.numbers(positions.y) + positions.offset_y
    if own is None:
        track_times = times
    elif positions.time is None:
        raise UnreadableRecording(f"{where}: positions.time is missing: {own.path.name} is joined by time")
    else:
        track_times = own.nanoseconds(positions.time)
    known = np.flatnonzero((track_times != NO_TIME) & np.isfinite(x + y))
    rows = known[ascending_rows(track_times[known])]
    stamps, ascending = track_times[rows], len(rows)
    likely, jumps = np.arange(len(rows)), np.empty(0, np.int64)
    if own is not None or description.frames.time is not None:  # else nothing states how fast the robot was
        likely, jumps, _ = believed(stamps, np.column_stack([x[rows], y[rows], np.zeros(len(rows))]), limits)
    said = [f"{table.path.name}: row {row}: no robot gets to its position" for row in np.delete(rows, likely)]
    rows, stamps = rows[likely], stamps[likely]
    if len(rows) < 2:
        why = f"{np.sum(track_times == NO_TIME)} have no time, {np.sum(~np.isfinite(x + y))} no number for x or y"
        why += f", {len(known) - ascending} a time that is not later than the one before"
        raise UnreadableRecording(f"{table.path}: fewer than two of its {len(x)} rows have a position: {why}")
    track = np.column_stack([x[rows], y[rows], headings(description, table, rows, stamps, x[rows], y[rows])])
    poses = np.full((len(times), 3), np.nan)
    if own is None:
        poses[rows] = track
        return poses, said
    timed = np.flatnonzero(times != NO_TIME)
    shifted = times[timed] + round(positions.clock_offset * 1e9)
    sure = np.isfinite(track).all(axis=1)
    if sure.sum() < 2:
        raise UnreadableRecording(f"{table.path}: fewer than two rows with a heading")
    poses[timed] = poses_near(stamps[sure], track[sure], shifted, positions.max_gap, stamps[jumps])
    return poses, said


def headings(description: Description, table: CsvTable, rows: Ints, stamps: Stamps, x: Array, y: Array) -> Array:
    """Headings (K,) at rows of a table, of which stamps (ns) and positions (m) are given."""
    heading, tangent = description.heading, description.tangent
    if heading is not None and heading.rotation:
        return wrap(np.arctan2(*_forward(heading, table, rows)[:, 1::-1].T) + heading.offset)
    if heading is not None:
        assert heading.column is not None
        assert heading.unit is not None
        measured = table.numbers(Angle(heading.column, heading.unit))[rows]
        turned = measured if heading.sense == "counter_clockwise" else -measured
        return wrap(turned + (pi / 2 if heading.zero == "y" else 0.0) + heading.offset)
    along, points = (stamps - stamps[0]) / 1e9, np.column_stack([x, y])
    if tangent.unit == "m":
        along = distances_along(points)
    return track_directions(along, points, tangent.window, tangent.lag)


def _forward(heading: Heading, table: CsvTable, rows: Ints) -> Array:
    """Directions (K, 3) in the world of the axis that points ahead, at rows of a table.

    NaN in a row without a rotation. Raises `UnreadableRecording` where most have none, or most directions are steep.
    """
    cells = np.column_stack([table.numbers(Length(column, "m"))[rows] for column in heading.rotation])
    if len(heading.rotation) == 4:
        from scipy.spatial.transform import Rotation  # slow to import, and seldom needed

        wrong = abs(np.linalg.norm(cells, axis=1) - 1.0) > MAX_SKEW
        turns = Rotation.from_quat(np.where((wrong | ~np.isfinite(cells).all(axis=1))[:, None], 1.0, cells)).as_matrix()
        expected = "a unit quaternion (x, y, z, w)"
    else:
        turns = cells.reshape(-1, 3, 3)
        wrong = abs(turns @ turns.mT - np.eye(3)).max(axis=(1, 2)) > MAX_SKEW
        wrong |= np.linalg.det(turns) < 0.0
        expected = "a rotation matrix"
    wrong |= ~np.isfinite(cells).all(axis=1)
    if 2 * wrong.sum() > len(rows):
        row = int(np.flatnonzero(wrong)[0])
        found = ", ".join("no number" if np.isnan(cell) else f"{cell:g}" for cell in cells[row])
        where = f"{table.path}, line {table.lines[rows[row]]}"
        raise UnreadableRecording(f"{where}: its rotation is ({found}), expected {expected}")
    axis = "xyz".index(heading.forward[-1])
    ahead: Array = turns[:, :, axis] * (-1.0 if heading.forward[0] == "-" else 1.0)
    ahead[wrong] = np.nan
    steep = math.degrees(np.nanmedian(np.arcsin(np.clip(abs(ahead[:, 2]), 0.0, 1.0))))
    if steep > MAX_STEEP_DEG:
        raise UnreadableRecording(
            f"{table.path}: the axis {heading.forward} of its rotations is {steep:.0f} degrees from level (median), "
            "expected the one that points ahead, in a world whose z is up: heading.forward, and the order of "
            "heading.rotation"
        )
    return ahead


def track_directions(along: Array, positions: Array, window: float, lag: float = 0.0) -> Array:
    """Directions of a track: (N,) radians, counter-clockwise from x.

    `along` (N,): time or way at each of the `positions` (N, 2), never falling. At each point a straight line
    p(s) = p0 + v (s - s0), s0 = `along` - `lag`, is fitted to the positions within four windows with weights
    exp(-((s - s0) / window)^2 / 2), at even steps where there are more than `MAX_FITTED`; the direction is v's. Where
    nothing moves within the window by more than noise does, it is the last one known.
    """
    directions, noise = np.full(len(along), np.nan), _noise(along, positions)
    centres = np.clip(along - lag, along[0], along[-1])
    low = np.searchsorted(along, centres - 4 * window, side="left")
    high = np.searchsorted(along, centres + 4 * window, side="right")
    for point, centre in enumerate(centres):
        begin, end = min(low[point], len(along) - 2), max(high[point], 2)
        near = slice(begin, end, 1 + (end - begin - 1) // MAX_FITTED)
        s = along[near] - centre
        weights = np.exp(-0.5 * (s / window) ** 2) + 1e-12
        s = s - (weights @ s) / weights.sum()
        velocity = (weights * s) @ (positions[near] - positions[near].mean(axis=0))
        least = min(MIN_WAY_M, MIN_WAY * np.sqrt(noise[near].max())) / (2 * window) * (weights @ s**2)
        if np.hypot(*velocity) > max(1e-12, least, SURE * np.sqrt((weights * s) ** 2 @ noise[near])):
            directions[point] = np.arctan2(velocity[1], velocity[0])
    known = np.flatnonzero(np.isfinite(directions))
    if not len(known):
        return np.zeros(len(along))
    last = np.maximum.accumulate(np.where(np.isfinite(directions), np.arange(len(along)), -1))
    return directions[np.where(last < 0, known[0], last)]


def _noise(along: Array, positions: Array) -> Array:
    """Variances (N,) in m^2 of positions, along each axis, by how far each is from between its neighbours."""
    if len(along) < 3:
        return np.zeros(len(along))
    whole = along[2:] - along[:-2]
    share = np.divide(along[1:-1] - along[:-2], whole, out=np.full(len(whole), 0.5), where=whole > 0.0)[:, None]
    off = positions[1:-1] - (1.0 - share) * positions[:-2] - share * positions[2:]
    found = (off**2 / (1.0 + share**2 + (1.0 - share) ** 2)).mean(axis=1)
    found = np.minimum(found, np.quantile(found, QUIET) / QUIET_OF_MEAN)  # in curves there is more than noise
    return np.pad(found, 1, mode="edge")
