"""Causes for which a stretch of a drive was not tracked, by fixed rules over the evidence of each image."""

import math
from collections.abc import Callable, Iterable
from functools import partial
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from omninav.pipeline import counted
from omninav.stages.geometry.plane.se2 import chain, compose
from omninav.stages.values.conflicts import FOREIGN
from omninav.stages.values.stretches import Stretch

from .stretches import GAP_M, GAP_SHARE, MIN_PART, NEAR_M, NEAR_SCALES, Log, Part, median, parts

DARK, LIGHT_RATIO = 0.1, 2.0
"""Brightness of dark images; factor between two lights: a stop of exposure, which a camera makes up for by itself."""
STILL, CHANGING = 1e-3, 0.97
"""Motion (m, rad) below which odometry stands still, between images that correlate less than this with the ones before
(`InputConflicts`)."""
CONFLICT_IMAGES = 128
"""Images before a finding on which it rests (`InputConflicts`)."""
SPEED_FACTOR, FIRST_SEEN = 1.5, 3
"""A robot was carried that is seen farther off than it can have driven at this multiple of its largest speed, in the
median of this many first images that clearly show it elsewhere (a single one may mislead)."""
PAUSES = 5.0
"""Usual intervals after which an image is missing."""
DISTINCT_LEAD = 0.7
"""Lead at which a best match counts half (`ConfidenceMonitor`)."""
FEW_LANDMARKS, FOUND_ELSEWHERE = 24.0, 0.05
"""Landmarks below which an image has few, and share of the images of another place that have any
(`ConfidenceMonitor`)."""
MAX_AGREEING = 0.1
"""Share of images that bear the estimate out in a map of another place, at most: best matches are there by chance."""
MAX_AT_ESTIMATE = 0.5
"""Share of best matches at an estimate that was never sure, at most: more of them show that it is of this map."""
CHECK_IMAGES = "check the log for lost images; if it has all of them, the robot was carried"
"""Advice on a robot that is elsewhere than it can have driven."""
FIRST_IMAGES = 10
"""Images that an estimate may take from anywhere."""


class Verdict(NamedTuple):
    """A cause in a few words, with the numbers that show it, and with what to do."""

    cause: str
    evidence: str
    advice: str = ""


def stretches(logs: Iterable[Log], lost_m: float) -> list[Stretch]:
    """Stretches of all logs of a drive that were not tracked, each with its cause.

    `lost_m`: position error above which a sure estimate is wrong, where truth is known.
    """
    found: list[tuple[Part, Verdict]] = []
    for part in (part for log in logs for part in parts(log, lost_m)):
        verdict = verdict_on(part)
        if found and (before := found[-1][0]).goes_on_with(part) and found[-1][1] == verdict:
            found.pop()
            part = Part(part.log, before.first, part.last, part.state)
        found.append((part, verdict))
    told = [explained(part, verdict) for part, verdict in found]
    for row, ((before, first), (part, again)) in enumerate(pairwise(found)):
        if again == first and part.log is before.log:  # in another state
            told[row + 1] = explained(part, Verdict(again.cause, f"as in {told[row].images}"))
    return told


def verdict_on(part: Part) -> Verdict:
    """The cause that the first rule gives that has one."""
    return next(found for rule in RULES if (found := rule(part)) is not None)


def explained(part: Part, verdict: Verdict) -> Stretch:
    """A stretch with its cause."""
    error = median(part["position_error_m"])
    off = "" if math.isnan(error) else f"; by ground truth the estimate was off by {error:.2f} m (median)"
    seconds, frames = part["time_s"], part["frame"].astype(int)
    return Stretch(
        int(part["log"][0]), int(frames[0]), int(frames[-1]), float(seconds[0]), float(seconds[-1]), part.metres,
        part.state, verdict.cause, verdict.evidence + off, verdict.advice,
    )  # fmt: skip


def says_nothing(part: Part) -> Verdict | None:
    """Images are dark, blank, noise, or missing."""
    if part.state != "blind":
        return None
    light, usual = part.median("brightness"), part.usual_brightness
    if math.isnan(light):
        return Verdict("no image", "no image could be used")
    words = f"brightness {light:.2f}, contrast {part.median('contrast'):.3f} of 1"
    if part.log.known("features"):
        words += f", {part.median('features'):.0f} features"
    if light < DARK:
        before = "" if math.isnan(usual) else f"; else {usual:.2f}"
        return Verdict("dark images", f"the images are too dark to show anything ({words}{before})", "give more light")
    look = f"look at them: omninav camera look log=LOG frame={int(part['frame'][0])}"
    return Verdict("images without content", f"the images show nothing, or noise ({words})", look)


def inputs_conflict(part: Part, foreign: bool = False) -> Verdict | None:
    """Inputs do not fit each other. `foreign`: images and map, which a way off the map looks like too."""
    until = part.last + 1 + (CONFLICT_IMAGES if part.state == "unsure" and not foreign else 0)
    found = (text for text in part.log.conflicts[part.first : until] if text and text.startswith(FOREIGN) == foreign)
    said = next(found, "")
    if not said or part.state == "jumped":
        return None
    sentence, _, check = said.replace("; check ", ": check ").partition(": check ")
    agree = f", though {100 * part.landmarks_agree:.0f} % of the images have landmarks at the estimate"
    sentence += agree if part.landmarks_agree >= 0.5 else ""
    return Verdict("inputs that do not fit", sentence, check and f"check {check}")


def moved_unmeasured(part: Part) -> Verdict | None:
    """The robot was found elsewhere than odometry leads from where images last agreed with the estimate."""
    log, jumped = part.log, part.state == "jumped"
    agreed = np.flatnonzero(log.agrees)
    earlier, later = agreed[agreed < part.first], agreed[agreed > part.last - jumped]
    if part.state == "searching" or not len(earlier) or not len(later) or not log.known("motion_x"):
        return None
    before, found = int(earlier[-1]), int(later[0])
    rows = slice(before + 1, found + 1)
    leads = compose(log.estimates[before], chain(log.motion[rows])[-1])
    steps = np.hypot(*log.motion[:, :2].T)
    gap, driven = math.dist(leads[:2], log.estimates[found, :2]), float(steps[rows].sum())
    if gap < GAP_M + GAP_SHARE * driven:
        return None
    seconds, intervals = float(log["time_s"][found] - log["time_s"][before]), np.diff(log["time_s"])
    words = (
        f"image {int(log['frame'][found])} is the first to agree with the estimate again, {gap:.1f} m from where "
        f"odometry leads from image {int(log['frame'][before])} ({driven:.1f} m in {seconds:.1f} s)"
    )
    paused = float(intervals[before:found].max())
    if paused > PAUSES * np.median(intervals):
        return Verdict("carried elsewhere", f"{words}; no image came for {paused:.1f} s", CHECK_IMAGES)
    still = (np.abs(log.motion[rows]).max(axis=1) < STILL) & (log["correlation"][rows] < CHANGING)
    if still.sum() >= MIN_PART:
        words += f"; odometry stood still in {int(still.sum())} images that differ"
        return Verdict("odometry stood still", words, "check the wheels' driver and `topics.odometry`")
    away = np.where(np.isfinite(log["landmarks_away_m"]), log["landmarks_away_m"], log["match_away_m"])
    clear = np.isfinite(log["landmarks_away_m"]) | (log["lead_against"] > DISTINCT_LEAD)
    seen = [row for row in range(before + 1, found) if clear[row]][:FIRST_SEEN]
    leaps = []
    if seen:
        metres = float(np.median(away[seen]))
        shown = f"images up to {int(log['frame'][seen[-1]])} show the robot {metres:.1f} m from the estimate, but "
        leaps.append((seen[-1], metres, shown))
    for by, metres, shown in [*leaps, (found, gap, "")]:
        can = SPEED_FACTOR * float(steps.max()) * (by - before)
        if metres > log.gate + can:
            return Verdict("carried elsewhere", f"{words}; {shown}it can have driven only {can:.1f} m", CHECK_IMAGES)
    return Verdict("odometry slipped", words, "check wheels and floor, and that odometry is in metres")


def not_recorded(part: Part) -> Verdict | None:
    """A run without `ImageEvidence`."""
    if part.log.known("match_lead") or part.state == "jumped":
        return None
    return Verdict("not recorded", "the run recorded no evidence, so the cause is unknown")


def off_the_map(part: Part) -> Verdict | None:
    """The estimate is off the map."""
    if part.state != "unsure" or part.log.off_map[part.first : part.last + 1].mean() < 0.5:
        return None
    words = (
        f"the estimate is {part.median('nearest_m'):.1f} m from the nearest image of the map (median), "
        f"{part.median('nearest_scales'):.1f} of its length scales"
    )
    return Verdict("off the map", words + landmarks_of(part), "add a tour that passes here: omninav map join MAP MAP")


def only_begun(part: Part) -> Verdict | None:
    """The first images of a drive, of which one alone shows too little."""
    if part.state != "searching" or part.last + 1 == len(part.log) or len(part) > FIRST_IMAGES:
        return None
    return Verdict("first images", f"the robot may start anywhere; {counted(len(part), 'image')} located it")


def other_light(part: Part) -> Verdict | None:
    """Images that are dark, or in another light than those in which the estimate is sure."""
    light, usual = part.median("brightness"), part.usual_brightness
    if not (light < DARK or light * LIGHT_RATIO < usual or light > usual * LIGHT_RATIO):
        return None
    words = f"the images have a brightness of {light:.2f} of 1 (median)"
    words += "" if math.isnan(usual) else f", {usual:.2f} where the estimate is sure"
    return Verdict("other light", words + landmarks_of(part), "learn the map from a tour in this light too")


def contradicted(part: Part) -> Verdict | None:
    """Images show the robot elsewhere; where the estimate never was sure, this is no cause."""
    if part.state == "searching":
        return None
    away = part["landmarks_away_m"] >= NEAR_M
    if away.mean() >= max(0.25, part.landmarks_agree):
        words = (
            f"landmarks of {100 * away.mean():.0f} % of the images (median {median(part['landmarks'][away]):.0f}) "
            f"agree on a pose elsewhere, {median(part['landmarks_away_m'][away]):.1f} m from the estimate"
        )
        return Verdict("images against the estimate", words)
    against = part["lead_against"] > DISTINCT_LEAD
    if against.mean() >= 0.25:
        words = (
            f"the best match of {100 * against.mean():.0f} % of the images is elsewhere, by a clear lead "
            f"({median(part['match_away_m'][against]):.1f} m from the estimate, median)"
        )
        return Verdict("images against the estimate", words)
    return None


def unlike_map(part: Part) -> Verdict | None:
    """Images that show nothing of the map, of a log in which hardly an image bears the estimate out."""
    said = any(text.startswith(FOREIGN) for text in part.log.conflicts[part.first : part.last + 1])
    never = part.state == "searching" and part.last + 1 == len(part.log) and not part.at_estimate > MAX_AT_ESTIMATE
    if part.log.agrees.mean() > MAX_AGREEING or part.landmarks_agree > FOUND_ELSEWHERE or not (said or never):
        return None
    if part.median("position_error_m") <= 2.0 * part.log.gate:  # by ground truth it was in the map
        return None
    words = (
        f"no image fits a place of the map: the best match leads those elsewhere by {part.median('match_lead'):.2f} "
        f"standard deviations (median), and {100 * part.at_estimate:.0f} % are at the estimate"
    )
    advice = "check that map= is of this place and made with this camera: omninav map show MAP"
    return Verdict("another place", words + landmarks_of(part), advice)


def few_landmarks(part: Part) -> Verdict | None:
    """Images bear the estimate out, but by few landmarks."""
    number, agree = part.median("landmarks"), part.landmarks_agree
    if not number < FEW_LANDMARKS or (part.at_estimate <= 0.5 and agree <= FOUND_ELSEWHERE):
        return None
    words = (
        f"{100 * part.at_estimate:.0f} % of best matches are at the estimate, and {100 * agree:.0f} % of the images "
        f"have landmarks there, but few: {number:.0f} (median)"
    )
    advice = "the place has changed, or camera.yaml is not this camera's: omninav camera look log=LOG"
    return Verdict("few landmarks", words, advice if part.median("nearest_scales") <= NEAR_SCALES else "")


def ambiguous(part: Part) -> Verdict | None:
    """Images that resemble several places."""
    lead = part.median("match_lead")
    if not lead < DISTINCT_LEAD:
        return None
    words = (
        f"the images resemble several places of the map: the best match leads those elsewhere by {lead:.2f} standard "
        f"deviations (median), and the belief's heaviest part holds {100 * part.median('estimate_weight'):.0f} %"
    )
    return Verdict("places that look alike", words + landmarks_of(part))


def unexplained(part: Part) -> Verdict:
    """The cause of what no rule explains."""
    words = f"the heaviest part of the belief holds {100 * part.median('estimate_weight'):.0f} % (median)"
    return Verdict("no cause found", words + landmarks_of(part))


RULES: tuple[Callable[[Part], Verdict | None], ...] = (
    says_nothing, inputs_conflict, only_begun, not_recorded, moved_unmeasured, unlike_map, off_the_map, other_light,
    contradicted, few_landmarks, partial(inputs_conflict, foreign=True), ambiguous, unexplained,
)  # fmt: skip
"""In the order in which causes hide each other: the first that applies is the cause."""


def landmarks_of(part: Part) -> str:
    """The share of images with a pose from landmarks at the estimate, as text; empty where none are looked for."""
    if not part.log.known("landmarks"):
        return ""
    return f"; {100 * part.landmarks_agree:.0f} % of the images have landmarks there"
