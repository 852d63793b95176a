"""Watches whether images, odometry, clock and map fit each other."""

import itertools
import math
from collections.abc import Callable, Collection
from dataclasses import field
from functools import cached_property, partial

import numpy as np

from omninav.pipeline import Context, Outputs, Stage, State, Tick
from omninav.stages.geometry.appearance.visual_compass import turns_and_correlations
from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.geometry.plane.mount import found_mount
from omninav.stages.geometry.plane.se2 import between, compose, distances_along, path_length, wrap, wrap_angle
from omninav.stages.geometry.plane.track_fit import agreement, track_fit
from omninav.stages.values.belief import PoseEstimate
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.conflicts import FOREIGN, Conflicts
from omninav.stages.values.drive import pose_row
from omninav.stages.values.image import Strip
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import AssumedMotion, AssumedPose, Motion, Pose
from omninav.stages.values.similarity import Similarities

from .confidence_monitor import best_place
from .covered_cells import CoveredCells
from .turn_fit import TurnFit, clipped, explained, turn_fit

INTERVAL_S = 0.25
"""Images that come sooner after the last one that was watched are left out (s)."""
WINDOW = 128
"""Images that are remembered."""
EVERY = 8
"""Images between two judgements; a finding is reported once two in a row agree."""
STANDS = 2
"""Judgements in a row that do not find it again, after which a finding holds no longer."""
COLUMNS = 14
"""Numbers that are remembered of an image."""


class Watched:
    """The last N images, from rows of `COLUMNS` numbers: their `times` (N,) in s; `odometry` (N, 3) with a heading that
    is not wrapped, and the path that it drove (`metres`) and turned, to either side (`radians`); best `matches` (N, 3)
    in the map (NaN without one), and whether each is `at_estimate` (N,) (NaN without one). Against the image before:
    `correlation` (N,), whether it is the `same` (N,), and `sure_turns` (N - 1,) seen (rad), NaN in images unlike it.
    `exact` (N, 3): estimates, NaN where they are not exact to `EXACT_M`, and which are: `is_exact` (N,)."""

    def __init__(self, rows: Array) -> None:
        self.times, self.odometry, self.matches = rows[:, 0], rows[:, 1:4], rows[:, 4:7]
        self.at_estimate, turns, self.correlation, self.same = rows[:, 7:11].T
        self.exact = rows[:, 11:]
        self.is_exact = np.isfinite(self.exact).all(axis=1)
        self.sure_turns = np.where(self.correlation[1:] > SURE_CORRELATION, turns[1:], np.nan)
        self.metres, self.radians = driven(self.odometry)

    @property
    def placed(self) -> tuple[Array, Array]:
        """Odometry's poses and the best matches, of images that have one: (M, 3), (M, 3)."""
        known = np.isfinite(self.matches).all(axis=1)
        return self.odometry[known], self.matches[known]

    @cached_property
    def turning(self) -> float:
        """Turning that is seen in the images, to either side (rad)."""
        seen = self.sure_turns
        return float(np.abs(clipped(seen[np.abs(seen) > SURE_TURN])).sum())

    @cached_property
    def turn_fit(self) -> TurnFit:
        """Fit of the turns seen in images to those of odometry."""
        return turn_fit(self.times, self.odometry[:, 2], self.sure_turns)

    @cached_property
    def mount(self) -> Array | None:
        """Pose (3,) of the camera against where the map has it, by the last exact estimates and odometry, where both
        halves of these show the same; else None."""
        rows = np.flatnonzero(self.is_exact)[-2 * MOUNT_IMAGES :]
        halves = rows[:-MOUNT_IMAGES], rows[-MOUNT_IMAGES:]
        first, mount = (found_mount(self.exact[half], self.odometry[half]) for half in halves)
        if first is None or mount is None or np.abs((mount - first) / (MOVED_M, MOVED_M, MOVED_RAD)).max() > 1.0:
            return None  # it was moved within these images, or estimates are off in some of them
        return mount


def driven(odometry: Array) -> tuple[float, float]:
    """Sum the steps of poses (N, 3): metres driven, and radians turned to either side."""
    steps = np.diff(odometry, axis=0)
    return float(np.hypot(steps[:, 0], steps[:, 1]).sum()), float(np.abs(steps[:, 2]).sum())


class InputConflictsState(State):
    """`stamp` (ns) and `pose` (3,) of the last watched image; `rows` (N, 14) of `Watched`, and the `strips` (rows,
    columns) of the last ones, of which all but the first are still to be compared with the one before; what is
    `covered` in them; the kind that the last judgement found; what was found, by its kind, and how many judgements ago
    each that holds was found last.
    """

    strips: list[Floats] = field(default_factory=list)
    covered: CoveredCells = field(default_factory=CoveredCells)
    stamp: int = 0
    pose: Array = field(default_factory=lambda: np.full(3, np.nan))
    rows: Array = field(default_factory=lambda: np.zeros((0, COLUMNS)))
    judged: int = 0
    suspected: str = ""
    found: dict[str, str] = field(default_factory=dict)
    standing: dict[str, int] = field(default_factory=dict)


class InputConflicts(Stage):
    """Reports which inputs do not fit each other, without ground truth, for as long as they do not.

    Motion seen in the images (turns between panoramas, and whether anything changes) is compared with odometry's, over
    the last `WINDOW` images; the track of single images' best matches in the map, without any belief, with odometry's
    track and with the estimate. A finding needs two judgements in a row (that the camera is frozen, none), is reported
    once, as a warning, with what to check, and holds until two judgements in a row do not find it. Where nothing
    measured the motion, it is not judged. Which conflicts are noticed after how many images, where the limits are
    from, and what cannot be noticed:
    docs/conflicts.md.
    """

    class Out(Outputs):
        """All that was found so far, and what of it still holds."""

        conflicts: Conflicts

    def step(
        self,
        ctx: Context,
        recent: InputConflictsState,
        strip: Strip | None = None,
        odometry: Pose | None = None,
        motion: Motion | None = None,
        similarities: Similarities | None = None,
        map: ReferenceGraph | None = None,
        length_scale: LengthScale | None = None,
        map_conflicts: Conflicts | None = None,
        estimate: PoseEstimate | None = None,
        restart: Reinitialise | None = None,
    ) -> Out:
        """One image, or a tick without one. `estimate`: where matches are not scattered by changed light."""
        of_map = () if map_conflicts is None else map_conflicts.sentences
        if ctx.tick.first_of_log or restart is not None:
            recent.rows, recent.pose, recent.judged = np.zeros((0, COLUMNS)), np.full(3, np.nan), 0
            recent.suspected, recent.standing, recent.covered = "", {}, CoveredCells()
        if sentence := leap(recent, ctx.tick, odometry):
            self._say(ctx, recent, "leap", sentence)
        recent.pose = pose_now(recent.pose, odometry, motion)
        is_due = not len(recent.rows) or not 0 <= ctx.tick.stamp - recent.stamp < INTERVAL_S * 1e9
        if strip is not None and is_known(recent.pose) and is_due:
            # nothing is compared with a map that is wrong by itself
            metres = math.inf if length_scale is None or of_map else length_scale.metres
            remember(recent, ctx.tick.stamp, strip.pixels)
            if similarities is not None and map is not None and min(similarities.values.shape) > 1:
                match = best_place(similarities, map)
                recent.rows[-1, 4:7], recent.rows[-1, 7] = match, lies_at(match, estimate, metres)
            if estimate is not None and np.trace(estimate.covariance[:2, :2]) < EXACT_M**2:
                recent.rows[-1, 11:] = pose_row(estimate.pose)
            if recent.rows[-1, 10] and (sentence := frozen(Watched(recent.rows), metres)):
                self._say(ctx, recent, "frozen", sentence)  # what is equal to the last bit needs no second judgement
            recent.judged += 1
            if not recent.judged % EVERY:
                compare_strips(recent)
                self._judge(ctx, recent, metres)
        kinds = sorted(recent.standing, key=HARMLESS.__contains__)  # those that mislead first
        standing = of_map + tuple([recent.found[kind] for kind in kinds])
        misleading = bool(of_map) or not recent.standing.keys() <= HARMLESS
        return self.Out(conflicts=Conflicts(of_map + tuple(recent.found.values()), standing, misleading))

    def _judge(self, ctx: Context, recent: InputConflictsState, length_scale_m: float) -> None:
        kind, sentence = judge(Watched(recent.rows), length_scale_m)
        if kind in ("", "displaced", "moved") and len(recent.rows) > LATE_IMAGES:  # what began midway
            lately = judge(Watched(recent.rows[-LATE_IMAGES:]), length_scale_m, ("misplacing", "late"))
            kind, sentence = lately if lately[0] else (kind, sentence)
        recent.standing = {each: ago + 1 for each, ago in recent.standing.items() if ago + 1 < STANDS or each == kind}
        others = set(recent.standing) - {"leap", "inconsistent", kind}
        others -= HARMLESS if kind not in HARMLESS else set()
        if kind and (kind in recent.standing or (kind == recent.suspected and not others)):
            self._say(ctx, recent, kind, sentence)
        recent.suspected = kind

    def _say(self, ctx: Context, recent: InputConflictsState, kind: str, sentence: str) -> None:
        recent.standing[kind] = 0
        if kind not in recent.found:
            recent.found[kind] = sentence
            ctx.warn(sentence)


def leap(recent: InputConflictsState, tick: Tick, odometry: Pose | None) -> str:
    """Tells if the clock leapt since the last image: much time went by, or less than none, yet the robot drove on as
    between other images, which no pause explains; else ""."""
    if odometry is None or isinstance(odometry, AssumedPose) or len(recent.rows) < MIN_BEFORE_LEAP:
        return ""
    seconds = (tick.stamp - recent.stamp) / 1e9
    if 0.0 <= seconds < MIN_LEAP_S:
        return ""
    before = Watched(recent.rows[-MIN_BEFORE_LEAP:])
    usual = float(np.median(np.diff(before.times)))
    if 0.0 <= seconds < LEAP_INTERVALS * usual:
        return ""
    step = between(before.odometry[-2], before.odometry[-1])
    driven = math.hypot(*step[:2])
    here = np.array((odometry.x, odometry.y, odometry.heading))
    gap = between(compose(before.odometry[-1], step), here)
    if driven < LEAP_MIN_M or math.hypot(*gap[:2]) > LEAP_GAP * driven or abs(gap[2]) > LEAP_GAP_RAD:
        return ""
    return (
        f"the clock leaps by {seconds - usual:.0f} s at image {tick.index}, while odometry drives on, {driven:.2f} m, "
        f"as in the {usual:.2f} s before: check the clock of the robot, or of what recorded it"
    )


def is_known(pose: Array) -> bool:
    """Tests whether a pose (3,) has a place and a heading."""
    return math.isfinite(pose[0] + pose[1] + pose[2])


def pose_now(before: Array, odometry: Pose | None, motion: Motion | None) -> Array:
    """Odometry's pose (3,) with a heading that is not wrapped; NaN where motion is only guessed, or not known."""
    if isinstance(odometry, AssumedPose) or isinstance(motion, AssumedMotion):
        return np.full(3, np.nan)
    known = is_known(before)
    if odometry is not None:
        heading = before[2] + wrap_angle(odometry.heading - before[2]) if known else odometry.heading
        return np.array((odometry.x, odometry.y, heading))
    if motion is None:
        return before
    start = before if known else np.zeros(3)
    moved = compose(start, np.array((motion.x, motion.y, motion.turn)))
    return np.array((moved[0], moved[1], start[2] + motion.turn))


def lies_at(match: Array, estimate: PoseEstimate | None, length_scale_m: float) -> float:
    """Tests whether a match (3,) is where the robot is believed to be: 1 or 0, NaN without an estimate."""
    if estimate is None:
        return math.nan
    away = match - np.array(pose_row(estimate.pose))
    return float(math.hypot(*away[:2]) < NEAR_SCALES * length_scale_m and abs(wrap(away[2])) < NEAR_RAD)


def remember(recent: InputConflictsState, stamp: int, pixels: Floats) -> None:
    """Add a row for an image; its comparison with the one before is left to `compare_strips`."""
    row = np.full((1, COLUMNS), np.nan)
    row[0, 0], row[0, 1:4], row[0, 10] = 0.0, recent.pose, 0.0
    if not len(recent.rows):
        recent.strips = []
    elif recent.strips[-1].shape == pixels.shape:
        row[0, 0] = recent.rows[-1, 0] + (stamp - recent.stamp) / 1e9
        row[0, 10] = float((recent.strips[-1] == pixels).all())
    recent.rows = np.concatenate((recent.rows, row))[-WINDOW:]
    recent.strips.append(pixels)
    recent.covered = recent.covered.seen(pixels)
    recent.stamp = stamp


def compare_strips(recent: InputConflictsState) -> None:
    """Compare the images since the last judgement with the ones before, all at once."""
    end = -len(recent.strips)
    for _, run in itertools.groupby(recent.strips, lambda strip: strip.shape):
        strips = np.stack(list(run))
        first, end = end, end + len(strips)
        if len(strips) > 1:
            seen = turns_and_correlations(recent.covered.uncovered(strips))
            recent.rows[first + 1 : end or None, 8:10] = np.column_stack(seen)
    recent.strips = recent.strips[-1:]


MIN_BEFORE_LEAP, MIN_LEAP_S, LEAP_INTERVALS = 8, 30.0, 20.0
"""Images before a leap of the clock, and what it is at least (s, and times the usual interval)."""
LEAP_MIN_M, LEAP_GAP, LEAP_GAP_RAD = 0.02, 0.5, math.radians(15.0)
"""A robot that drives on does at least this much between two images (m), and is at most this share of it and this angle
(rad) off from where the last step repeated leads."""
MIN_FROZEN, FROZEN_M, FROZEN_RAD = 3, 0.5, 0.5
"""Images that are equal to the last bit while odometry drives so far (m) or turns so much (rad) are one image."""
MIN_BLIND, BLIND_CORRELATION = 16, 0.15
"""Images that have less in common than this with the ones before show nothing, or noise."""
SURE_CORRELATION, SURE_TURN = 0.4, math.radians(3.0)
"""Turns are seen where images correlate so much, and above what parallax looks like (rad)."""
MIN_SEEN_TURN, MIN_LATE_TURN = math.pi / 2.0, math.pi
"""Least turning of the images, to either side, before turns are judged, and their delay (rad): at 95 degrees one was
found where there is none."""
STILL_M, STILL_RAD = 1e-3, 1e-3
"""Odometry that stays below these over all images stands still (m, rad)."""
NO_HEADING, WILD_TURNS, MIN_WILD_TURN = 0.05, 6.0, 4.0 * math.pi
"""Odometry's turning as a share of the seen one: below the first it has no heading, above the second (and so much
turning, rad) its headings are something else."""
OTHER_DRIVE, MIN_OTHER_TURN, SIMILAR = -0.1, 3.0 * math.pi, 1.5
"""Odometry of another drive explains less of the turning than this, once the images have turned so much (rad) and it as
much but for this factor: in sound drives of 23 simulated worlds, and every second or third image of some, -0.03 at
least, in a house with the odometry of another tour -0.2."""
EXPLAINED, REVERSED_AS_IS, DELAY_GAIN, MIN_DELAY_S = 0.5, 0.0, 0.1, 0.25
"""Share of the seen turning that must be explained; at most so much as it is where turns are reversed; so much more
than as it is where images are late, by at least this many seconds."""
MISPLACED_M = 0.5
"""A robot that drives this far within the delay of its images is not at the estimate: the confidence's tolerance
(m)."""
EXACT_M, MOUNT_IMAGES = 0.05, 22
"""Largest standard deviation of an estimate's position (m), and how many of the last of these, as well as how many
before them, must tell where the camera is."""
COMPARED_M, STEP_M, MAX_OFF = 6.0, 0.5, 0.4
"""Path over which exact estimates are compared with odometry, in steps of about so many metres, and by which share of a
step they may be off: in sound drives it is 0.03."""
MIN_INCONSISTENT, MAX_CAMERA_TURN = 3, math.radians(120.0)
"""Smallest number of steps that are off, since a robot that is carried away once has one; and largest turn (rad) of all
of them that is laid to the camera's yaw: reversed images look like a larger one."""
MOVED_M, MOVED_RAD = 0.1, math.radians(8.0)
"""A camera that is this far (m) or turned this much (rad) from where the map has it was moved: in seven sound drives
0.03 m and 5.6 degrees are found at most, since odometry's errors bend long steps."""
DISPLACED_M = 0.4
"""Distance from which on, as from that turn on, poses come near the tolerances of their confidence, 0.5 m and 10
degrees."""
TRACK_SCALES, MIN_PAIRS, SHARE, GAIN = 3.0, 40, 0.45, 0.25
"""Matches must move this many length scales to count, in this many pairs, of which this share agrees on one relation
of the tracks, and so much less on the right one where that is mirrored."""
REVERSED = (np.array((1.0, 1.0, -1.0)), np.array((1.0, -1.0, -1.0)))
"""Factors that put right an odometry whose heading has the wrong sign, and one whose left is its right."""
CHANGING = 0.97
"""Images of a robot that drives correlate less with the ones before."""
MISSCALED_OCTAVES, MISTURNED = 0.4, math.radians(20.0)
"""A relation of tracks is a wrong one beyond these."""
MAX_ACROSS = 0.6
"""Largest share of the pairs on which a relation rests that lie across one step: a robot that stands, is carried off
and stands again has all of them there, one that drives a third."""
LATE_IMAGES = 48
"""Last images in which a delay is looked for where all of them show nothing."""
NEAR_SCALES, NEAR_RAD = 2.0, math.radians(30.0)
"""A match is at the estimate within this many length scales, turned by less than this (rad)."""
SCATTERED, ELSEWHERE = 0.05, 0.1
"""Largest shares, over a whole window, of pairs of matches that agree with odometry, and of matches at the estimate and
of exact estimates, with which images count as fitting no place of the map."""


def judge(watched: Watched, length_scale_m: float, kinds: Collection[str] = ()) -> tuple[str, str]:
    """The first conflict that is found, of these kinds or any, by its kind and in a sentence; ("", "") without one."""
    found = ((kind, JUDGEMENTS[kind](watched, length_scale_m)) for kind in kinds or JUDGEMENTS)
    return next((each for each in found if each[1]), ("", ""))


def frozen(watched: Watched, length_scale_m: float) -> str:
    """The camera gives one image again and again."""
    number = int(np.argmin(watched.same[::-1])) if not watched.same.all() else len(watched.same)
    metres, radians = driven(watched.odometry[-number - 1 :])
    if number < MIN_FROZEN or (metres < FROZEN_M and radians < FROZEN_RAD):
        return ""
    return (
        f"the camera is frozen: its last {number} images are one and the same, while odometry drove {metres:.1f} m "
        f"and turned {math.degrees(radians):.0f} degrees; check the camera's driver, and that each image is new"
    )


def blind(watched: Watched, length_scale_m: float) -> str:
    """Images that show nothing."""
    recent = watched.correlation[-MIN_BLIND:]
    if len(recent) < MIN_BLIND or not np.nanmedian(recent) < BLIND_CORRELATION:
        return ""
    return (
        f"images have nothing in common with the ones before (correlation {np.nanmedian(recent):.2f} over {len(recent)}"
        " images; a camera that moves has above 0.5): noise, an empty view, or bytes that are no image; look at them "
        "with `omninav camera look log=…`"
    )


def turned(watched: Watched, length_scale_m: float) -> str:
    """Turns that are seen against turns that are measured."""
    seen, turning, number = watched.sure_turns, watched.turning, len(watched.times) - 1
    if turning < MIN_SEEN_TURN:
        return ""
    over = f"over {number} images"
    images, measured = f"{math.degrees(turning):.0f} degrees", f"{math.degrees(watched.radians):.0f} degrees"
    if watched.metres < STILL_M and watched.radians < STILL_RAD:
        return (
            f"odometry stands still while the images turn by {images} {over}: check that its topic is the robot's own "
            "(`topics.odometry=…`) and that the wheels' driver runs"
        )
    if watched.radians < NO_HEADING * turning:
        return (
            f"odometry's heading does not change ({measured} {over}) while the images turn by {images}: check its "
            "orientation (a quaternion is x, y, z, w)"
        )
    fit = watched.turn_fit
    known = np.isfinite(seen)
    turns = np.diff(watched.odometry[:, 2])[known]
    if fit.explained < EXPLAINED:
        wild = float(np.abs(turns).sum())
        compared = f"odometry turns by {math.degrees(wild):.0f} degrees {over}, the images by {images}"
        if wild > max(WILD_TURNS * turning, MIN_WILD_TURN):
            return f"{compared}, and not together: check the unit of its heading (radians)"
        if fit.explained < OTHER_DRIVE and turning > MIN_OTHER_TURN and 1.0 / SIMILAR < wild / turning < SIMILAR:
            return f"{compared}, and not together: check that odometry and images are of one robot and one drive"
        return ""
    if fit.sign < 0 and fit.as_is < REVERSED_AS_IS:
        both = np.stack([clipped(seen[known]), clipped(turns)])
        correlation = float(both.prod(axis=0).sum() / np.linalg.norm(both, axis=1).prod())
        blame = whose(watched, length_scale_m)
        return f"the images turn against odometry's turns (correlation {correlation:.2f} {over}): {blame}"
    return ""


def late(watched: Watched, length_scale_m: float, min_metres: float = 0.0) -> str:
    """Images that show turns when odometry does not measure them; the robot drives at least this far (m)."""
    if watched.turning < MIN_LATE_TURN or watched.radians == 0.0:
        return ""
    fit = watched.turn_fit
    if fit.sign < 0 or fit.explained < EXPLAINED or fit.explained - fit.as_is < DELAY_GAIN:
        return ""
    driven = watched.metres * abs(fit.delay_s) / max(float(np.ptp(watched.times)), 1e-9)
    if abs(fit.delay_s) < MIN_DELAY_S or driven < min_metres:
        return ""
    return (
        f"the images show turns {abs(fit.delay_s):.1f} s {'after' if fit.delay_s > 0 else 'before'} odometry measures "
        f"them, in which the robot drives {driven:.2f} m (this explains {100 * fit.explained:.0f} % of their turning "
        f"over {len(watched.sure_turns)} images, no delay {100 * max(fit.as_is, 0.0):.0f} %): check that both are "
        "stamped by one clock, images when they are taken, or set `delay:` in camera.yaml"
    )


def turns_fit(watched: Watched) -> bool:
    """Tells whether odometry turns as the images do."""
    seen = watched.sure_turns
    known = np.isfinite(seen) & (np.abs(seen) > SURE_TURN)
    turns = np.diff(watched.odometry[:, 2])[known]
    return bool(np.abs(seen[known]).sum() > MIN_SEEN_TURN and explained(seen[known], turns) > EXPLAINED)


def whose(watched: Watched, length_scale_m: float) -> str:
    """Cause of turns that are reversed: matches of mirrored images fit no track, reversed or not."""
    odometry, matches = watched.placed
    fits = [track_fit(odometry * sign, matches, TRACK_SCALES * length_scale_m) for sign in REVERSED]
    if all(fit is not None and fit.pairs >= MIN_PAIRS for fit in fits):
        share = max(fit.as_is for fit in fits if fit is not None)
        if share > SHARE:
            return (
                f"the best matches in the map fit odometry once its turns are reversed ({100 * share:.0f} % of pairs "
                "of images), so its heading has the wrong sign (counter-clockwise is positive, x forward, y left)"
            )
        return (
            "the best matches in the map fit odometry in neither sense, so the images are mirrored or upside down: "
            "check the camera's mounting and driver (in camera.yaml the `sense` of a strip)"
        )
    return (
        "check whether the images are mirrored or upside down (in camera.yaml the `sense` of a strip), and the sign of "
        "odometry's heading (counter-clockwise is positive)"
    )


def moved(watched: Watched, length_scale_m: float, min_metres: float = MOVED_M) -> str:
    """The camera's place on the robot, by exact estimates against odometry; at least so far off where it was."""
    mount = watched.mount
    if mount is None:
        return ""
    if math.hypot(*mount[:2]) < min_metres and abs(mount[2]) < MOVED_RAD:
        return ""
    forward, left, turn = mount
    return (
        f"by landmarks and odometry over {2 * MOUNT_IMAGES} images the camera is {forward:+.2f} m forward, "
        f"{left:+.2f} m to the left and turned by {math.degrees(turn):+.0f} degrees from where it is in the map: check "
        "whether it was moved, `position` and `yaw` in camera.yaml, and that images are stamped when they are taken"
    )


def tracked(watched: Watched, length_scale_m: float) -> str:
    """The track of best matches against odometry's."""
    odometry, matches = watched.placed
    fit = track_fit(odometry, matches, TRACK_SCALES * length_scale_m)
    if fit is None or fit.pairs < MIN_PAIRS or fit.share < SHARE or fit.across > MAX_ACROSS:
        return ""
    agree = f"{100 * fit.share:.0f} % of {fit.pairs} pairs of images agree, as it is {100 * fit.as_is:.0f} %"
    if fit.mirrored and (fit.share - fit.as_is < GAIN or not turns_fit(watched)):
        return ""
    if fit.mirrored == "poses":
        return (
            f"the best matches drive through the map as in a mirror ({agree}), while odometry turns as the images do: "
            "the map's poses are mirrored; check its x, y and heading (counter-clockwise is positive)"
        )
    if fit.mirrored:
        return (
            f"the places of the best matches fit odometry's once that is mirrored ({agree}): check that left is y and "
            "positive in odometry, x and y not exchanged, and the map's poses likewise"
        )
    if math.log2(fit.scale) > MISSCALED_OCTAVES and np.nanmedian(watched.correlation) > CHANGING:
        return ""  # the robot stands still, and its best match goes back and forth
    if watched.metres < STILL_M:
        return (
            f"odometry stands still while the best matches in the map move on by {path_length(matches):.1f} m over "
            f"{len(matches)} images: check that its topic is the robot's own (`topics.odometry=…`) and that the "
            "wheels' driver runs"
        )
    if abs(math.log2(fit.scale)) > MISSCALED_OCTAVES:
        times = float(f"{1.0 / fit.scale:.2g}")
        return (
            f"odometry is about {times:g} times as long as the way between the best matches in the map ({agree}):"
            " check the unit of both (m), and the wheels' diameter"
        )
    if abs(fit.angle) > MISTURNED:
        return (
            f"the camera looks {math.degrees(-fit.angle):+.0f} degrees off from where odometry drives, by the best "
            f"matches in the map ({agree}): check `yaw` (or `column_of_forward`) in camera.yaml, and that odometry's "
            "x is forward"
        )
    return ""


def inconsistent(watched: Watched, length_scale_m: float) -> str:
    """Exact estimates that do not move as odometry does."""
    odometry, exact = watched.odometry[watched.is_exact], watched.exact[watched.is_exact]
    along = distances_along(odometry)
    ends = np.unique(np.floor((along - along[-1] + COMPARED_M) / STEP_M), return_index=True)[1]
    ends = ends[along[ends] >= along[-1] - COMPARED_M]
    if len(ends) <= MIN_INCONSISTENT:
        return ""
    measured, seen = (between(each[ends[:-1]], each[ends[1:]])[:, :2] @ (1.0, 1j) for each in (odometry, exact))
    turn = np.angle(np.exp(1j * (np.angle(seen) - np.angle(measured))).sum())  # of a camera, which others report
    off = np.abs(seen - measured * np.exp(1j * turn * (abs(turn) < MAX_CAMERA_TURN)))
    wrong = off > MAX_OFF * np.maximum(np.diff(along[ends]), STEP_M)
    if wrong.sum() < MIN_INCONSISTENT:
        return ""
    return (
        f"landmarks place {wrong.sum()} of {len(wrong)} images, some {STEP_M} m apart, elsewhere than odometry "
        "leads from one to the next: check that images are new, of this drive and in order, and that odometry is right"
    )


def foreign(watched: Watched, length_scale_m: float) -> str:
    """Images of another place than the map's."""
    odometry, matches = watched.placed
    believed = watched.at_estimate[np.isfinite(watched.at_estimate)]
    if len(believed) < WINDOW or watched.is_exact.mean() > ELSEWHERE:
        return ""  # in other light landmarks find the places that colours do not
    there, fit = float(believed.mean()), agreement(odometry, matches, length_scale_m)
    if fit.pairs < WINDOW or fit.share > SCATTERED or there > ELSEWHERE:
        return ""
    return (
        f"{FOREIGN}: of {len(believed)} best matches {100 * there:.0f} % are at the estimate, "
        f"and {100 * fit.share:.0f} % of {fit.pairs} pairs agree with odometry: check that the map is of"
        " this place, and was made with this camera and in a light like this"
    )


JUDGEMENTS: dict[str, Callable[[Watched, float], str]] = {
    "frozen": frozen,
    "blind": blind,
    "turned": turned,
    "misplacing": partial(late, min_metres=MISPLACED_M),
    "displaced": partial(moved, min_metres=DISPLACED_M),
    "tracked": tracked,
    "inconsistent": inconsistent,
    "foreign": foreign,
    "late": late,
    "moved": moved,
}
"""In the order in which causes hide each other."""
HARMLESS = frozenset(("leap", "late", "moved"))
"""Kinds for which poses are right within the tolerances of their confidence."""
