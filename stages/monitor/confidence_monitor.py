"""Tells how probable it is that the estimate is right."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.appearance.visual_compass import angle_of_peak
from omninav.stages.geometry.arrays import Array, Bools
from omninav.stages.geometry.plane.se2 import compose, wrap
from omninav.stages.geometry.probability.particles import share_within
from omninav.stages.values.belief import Likelihood, Particles, PoseEstimate
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.confidence import (
    MIN_EMPTY,
    MIN_SEEN,
    MIN_SURE,
    PoseConfidence,
    TrackingState,
    WrongPoseAgreement,
)
from omninav.stages.values.conflicts import Conflicts
from omninav.stages.values.drive import pose_row
from omninav.stages.values.evidence import MatchLeads
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities
from omninav.stages.values.track import Track

from .consistency import consistency, goes_on, log_odds_of_right

MAX_IMAGES = 500
"""Images that are remembered, of a robot that stops or moves slowly."""
ELSEWHERE, TURNED = 2.0, math.radians(30.0)
"""A match is of another place than the best one beyond this many radii of agreement, or turned by more (rad)."""
STEEPNESS = 4
"""Power of the lead by which an image counts: as good as nothing at half of `DISTINCT_LEAD`, fully at twice."""
MEMORY = 20.0
"""Independent images after which one counts a third (1 / e)."""
DISTINCT_LEAD = 0.7
"""Lead of the best match over those elsewhere, in standard deviations of the similarity over the map's references,
at which an image counts half."""
STRENGTH = 20.0
"""Images from which on the share of agreements by chance is taken to be known."""
KIDNAPPING_PROBABILITY = 0.02
"""Probability per independent image, or per length scale driven without one, that the robot was carried elsewhere,
or found itself again."""

CARRIED_SINCE = 0.002
"""The same probability for the odds from landmarks: smaller, since the next sure pose reveals a kidnapping at once."""
FOUND_OF_LEFT_OUT, FOUND_ELSEWHERE = 0.5, 0.05
"""Share of images with a pose by landmarks: on another day, of those that the map's own images have; and elsewhere."""
HALF_FOUND = 5.0
"""Distance from the nearest reference, in length scales of the map, at which half as many images have one: in offices
and stores all do up to 1.5 m, and a third from 2 to 3 m."""
PLACES_ALIKE = 20.0
"""Places among which a wrong pose falls, one of which may be the estimate's: where the map looks like the image."""
OUTLIER_PROBABILITY = 0.002
"""Probability that a pose is wrong however many landmarks agree on it: they may have moved since the map was made."""
NEW_WITHOUT = 0.2
"""Share of an image without a sure pose that is new evidence: it is blurred, or shows what has changed or misleads,
where the one before was or did."""
SURE = 0.9
"""Probability of a pose by landmarks, or of the estimate by all of them, from which on the robot is on the map."""
SURE_TOGETHER = 4.6
"""Log odds of an estimate on which poses of fewer landmarks agree, from which on the same is known: 99 %."""
MIN_FEATURES = 100
"""Features of an image below which it proves nothing by showing no landmarks: it is dark or blurred."""
MAX_AGAINST = (1.0, 6.0)
"""Log odds that images without landmarks speak against an estimate, at most: on the map, where some of it has changed;
and before any was found, in what may be another building."""
FOUND_AT_FIRST = 0.95
"""Share of drives that landmarks find at once, in a map that finds all of its own left-out images."""


class ConfidenceMonitorState(State):
    """Places of the robot now if each of the last images had been taken at its best match: `places` (M, 3),
    the oldest first; how new each was: `novelties` (M,), and how much it still counts: `weights` (M,), 0 of a stretch
    that was driven without an image. `estimates` (M, 3) are the poses stated with these images, carried to now, and
    `contradictions` (M,) how much each image still counts against its own; `contradicted` is the last one's share.
    `sure`: the estimate was since the robot began; `localised`: it is; `empty`: images in a row that show nothing.
    `geometry`: log odds of right by landmarks; `found`: these have shown that the robot is on the map; `missed`: until
    then, how surely the images so far would have shown some there, 0 to 1.
    """

    places: Array = field(default_factory=lambda: np.zeros((0, 3)))
    novelties: Array = field(default_factory=lambda: np.zeros(0))
    weights: Array = field(default_factory=lambda: np.zeros(0))
    estimates: Array = field(default_factory=lambda: np.zeros((0, 3)))
    contradictions: Array = field(default_factory=lambda: np.zeros(0))
    contradicted: float = 0.0
    geometry: float = 0.0
    found: bool = False
    missed: float = 0.0
    sure: bool = False
    localised: bool = False
    empty: int = 0

    def forget(self) -> None:
        """Forget all: the robot may be anywhere."""
        self.places, self.estimates = np.zeros((0, 3)), np.zeros((0, 3))
        self.novelties, self.weights, self.contradictions = np.zeros(0), np.zeros(0), np.zeros(0)
        self.contradicted, self.geometry, self.found, self.missed = 0.0, 0.0, False, 0.0

    def told(self, probability: float) -> TrackingState:
        """The state that follows from the confidence; a robot that is not localised does not become so by images that
        show nothing."""
        empty = self.empty >= MIN_EMPTY
        self.localised = probability >= MIN_SURE and (self.localised or not empty)
        if not self.localised:
            return "lost" if self.sure else "searching"
        self.sure = True
        return "blind" if empty else "tracking"

    def move(self, motion: Motion) -> None:
        """Carry all poses along with the robot."""
        both = compose(np.concatenate((self.places, self.estimates)), np.array((motion.x, motion.y, motion.turn)))
        self.places, self.estimates = both[: len(self.places)], both[len(self.places) :]

    def add(self, place: Array, estimate: Array, novelty: float, weight: float, contradiction: float) -> None:
        """Remember an image; the older ones count less by what this one counts, 1 / e after `MEMORY` full ones."""
        fading = math.exp(-max(weight, contradiction) / MEMORY)
        self.places = np.concatenate((self.places, place[None]))[-MAX_IMAGES:]
        self.estimates = np.concatenate((self.estimates, estimate[None]))[-MAX_IMAGES:]
        self.novelties = np.concatenate((self.novelties, (novelty,)))[-MAX_IMAGES:]
        self.weights = np.concatenate((self.weights * fading, (weight,)))[-MAX_IMAGES:]
        self.contradictions = np.concatenate((self.contradictions * fading, (contradiction,)))[-MAX_IMAGES:]


class ConfidenceMonitor(Stage):
    """The probability that the estimate is within a tolerance of the truth, from images and belief.

    A filter follows its images, so a sharp belief may be a wrong one. Each image by itself, without any
    belief, resembles one reference most; odometry carries the places of the last images' best matches to now. How many
    of them agree with the estimate is compared with how many agree with a wrong one by chance, which the map's own
    images tell (`LearnWrongPoseAgreement`): the odds that the estimate is in the right place at all. That probability
    times the belief's share within the tolerance is the confidence.

    An image counts as much as it does in the filter (the likelihood's novelty), and the more, the farther its best
    match leads all matches elsewhere: one that resembles many places supports none. It may still show where the
    robot is not: it counts against its estimate, the more, the farther its best match leads all those around the
    estimate, and fully if it is the first to do so, since it then repeats none before it. A way without images
    raises the probability that the robot was carried elsewhere, as images do.

    Landmarks count more than any similarity: a sure pose by them outweighs all appearance, for or against
    the estimate, and an image without one counts against it, the more, the more of the map's own images have one: the
    robot may be nowhere on the map. So until one is found, in images that have features, appearance is not believed
    either: it agrees with itself in another building too. Where `track` reports that the robot was carried, all that
    was known before is forgotten. Where the estimate jumps away from what landmarks said was right, that speaks against
    it.

    How well it does, and where the defaults are from: docs/experiments/confidence.md.
    """

    within_m: Annotated[float, Bounds(gt=0)] = 0.5
    """Tolerance in position (m)."""
    within_deg: Annotated[float, Bounds(gt=0, le=180)] = 10.0
    """Tolerance in heading."""

    right_in_conflict: Annotated[float, Bounds(ge=0, le=1)] = 0.2
    """Factor of the confidence while inputs mislead that do not fit each other: images then agree on what is wrong."""

    class Out(Outputs):
        """The probability that the estimate is right; `leads` of an image that was compared with the map."""

        confidence: PoseConfidence
        leads: MatchLeads | None = None

    def step(
        self,
        ctx: Context,
        recent: ConfidenceMonitorState,
        belief: Particles,
        estimate: PoseEstimate,
        map: ReferenceGraph,
        length_scale: LengthScale,
        when_wrong: WrongPoseAgreement,
        similarities: Similarities | None = None,
        likelihood: Likelihood | None = None,
        motion: Motion | None = None,
        conflicts: Conflicts | None = None,
        restart: Reinitialise | None = None,
        fix: LandmarkFix | None = None,
        features: LocalFeatures | None = None,
        track: Track | None = None,
    ) -> Out:
        """One image, or a tick without one. `likelihood`: of the same image, for its novelty; `features`: in which
        landmarks were looked for."""
        if ctx.tick.first_of_log or restart is not None:
            recent.forget()
            recent.sure, recent.localised, recent.empty = False, False, 0
        elif motion is not None:
            recent.move(motion)
        if track is not None and track.carried:
            recent.forget()
        pose = np.array(pose_row(estimate.pose))
        gate, radians, new = max(self.within_m, length_scale.metres), math.radians(self.within_deg), 0.0
        leads, seen = None, features is None or len(features) >= MIN_SEEN
        jumped = len(recent.estimates) > 0 and not goes_on(recent.estimates[-1], pose, gate, radians)
        if similarities is not None and similarities.values.size and seen:
            novelty = 1.0 if likelihood is None else likelihood.novelty
            leads = leads_of_best(similarities, map, pose, ELSEWHERE * gate)
            distinct, against = share_counted(leads.over_elsewhere), share_counted(leads.over_estimate)
            repeated = recent.contradicted > 0.5 and not jumped
            new = 1.0 if against > 0.5 and not repeated else novelty
            recent.contradicted = against
            recent.add(leads.place, pose, new, novelty * distinct, new * against)
        elif motion is not None and (blind := math.hypot(motion.x, motion.y) / length_scale.metres) > 0.0:
            new = min(1.0, blind)
            recent.add(pose, pose, new, 0.0, 0.0)
        agreeing = consistency(recent.places, pose, gate, radians)
        disagreeing = np.maximum(
            recent.weights * (1.0 - agreeing),
            recent.contradictions * consistency(recent.estimates, pose, gate, radians),
        )
        odds = log_odds_of_right(
            recent.weights * agreeing, disagreeing, recent.novelties,
            when_wrong.share, STRENGTH, KIDNAPPING_PROBABILITY,
        )  # fmt: skip
        if map.landmarks is not None:
            few = features is None or len(features) < MIN_FEATURES
            looked_for, most = 0.0 if few else map.landmarks.found_rate, MAX_AGAINST[0 if recent.found else 1]
            if recent.found:  # it may have left the mapped way; before, that would excuse every other building
                nearest = float(np.hypot(*(map.poses[:, :2] - pose[:2]).T).min(initial=math.inf))
                looked_for *= share_found(nearest / length_scale.metres)
            if jumped and (fix is None or float(fix.probabilities.sum()) < 0.5):
                recent.geometry = min(recent.geometry, -recent.geometry)  # it was said of the pose that this one left
            recent.geometry, sure = by_landmarks(recent.geometry, fix, looked_for, pose, (gate, radians), new, most)
            recent.found |= sure >= SURE or recent.geometry >= SURE_TOGETHER
            recent.missed = 0.0 if recent.found else max(recent.missed, looked_for)
            odds = min(odds, (1.0 - recent.missed) * odds) + math.log(1.0 - FOUND_AT_FIRST * recent.missed)
            odds = (1.0 - sure) * odds + recent.geometry
        right_place = 1.0 / (1.0 + math.exp(-odds))
        if conflicts is not None and conflicts.misleading:
            right_place *= self.right_in_conflict
        probability = right_place * mass_within(belief, pose, self.within_m, radians)
        of_mode = max(probability, right_place * min(1.0, estimate.mode_weight))
        recent.empty = 0 if similarities is not None and seen else recent.empty + 1
        return self.Out(confidence=PoseConfidence(probability, recent.told(of_mode), of_mode), leads=leads)


def by_landmarks(
    before: float,
    fix: LandmarkFix | None,
    found_rate: float,
    pose: Array,
    gate: tuple[float, float],
    novelty: float,
    max_against: float,
) -> tuple[float, float]:
    """Log odds that an estimate (3,) is right by landmarks, after those `before`, and how sure this image's are.

    `found_rate`: share of the map's images whose landmarks give a pose; `gate`: agreement of poses (m, rad); `novelty`:
    how new the image is; `max_against`: log odds of images without a pose against the estimate, at most. A wrong pose
    is in one of `PLACES_ALIKE`, so that few landmarks that agree with the estimate count much for it; but poses that
    are each rather wrong than right raise the odds to 50 at most, and an image that is repeated counts as it is new.
    Where landmarks are elsewhere, as much as the pose may be wrong speaks against the estimate. As far as a pose is
    sure, it stands for all that was known before, as the robot may have been carried elsewhere.
    """
    probability = 1.0 / (1.0 + math.exp(-before))
    probability += (0.5 - probability) * CARRIED_SINCE * novelty
    kept = math.log(probability / (1.0 - probability))
    if fix is None:
        found = FOUND_OF_LEFT_OUT * found_rate
        against = min(0.0, math.log((1.0 - found) / (1.0 - FOUND_ELSEWHERE)))
        return max(kept + NEW_WITHOUT * novelty * against, min(kept, -max_against)), 0.0
    sure = min(float(fix.probabilities.sum()), 1.0 - OUTLIER_PROBABILITY)
    agreeing = float(fix.probabilities @ consistency(fix.poses, pose, *gate))
    elsewhere = max(sure - agreeing, 0.0)
    wrong = (1.0 - sure) * (agreeing / PLACES_ALIKE + elsewhere) / (agreeing + elsewhere)
    by_chance = max(wrong, OUTLIER_PROBABILITY)
    told = math.log((agreeing + by_chance) / (elsewhere + by_chance))
    bound = math.log(1.0 / KIDNAPPING_PROBABILITY)
    if sure < 0.5:  # however many agree: one wall misleads all images that show it
        told = min(told, max(0.0, bound - kept))
    limited = kept + sure * (min(max(kept, -bound), bound) - kept)
    # What misleads an image misleads the next one as well; a belief that agrees came from other evidence too.
    if told > 0.0:
        return max(limited + novelty * told, kept + sure * (told - kept)), sure
    return limited + (sure + (1.0 - sure) * NEW_WITHOUT * novelty) * told, sure


def share_found(distance: float) -> float:
    """The share of images with a pose by landmarks at a distance from the nearest reference, in length scales."""
    return float(2.0 ** -((min(distance, 1e3) / HALF_FOUND) ** 4))


def share_counted(lead: float) -> float:
    """Share of an image that counts, 0 to 1, whose best match leads others by this many standard deviations."""
    return 1.0 / (1.0 + (DISTINCT_LEAD / max(lead, 1e-9)) ** STEEPNESS)


def best_place(similarities: Similarities, map: ReferenceGraph) -> Array:
    """The pose (3,) of a robot that is where the most similar reference was taken, turned as the view is."""
    values = similarities.values
    row = int(similarities.best.argmax())
    reference = row if similarities.candidates is None else int(similarities.candidates[row])
    place: Array = map.poses[reference].copy()
    place[2] += angle_of_peak(values[row]) if values.shape[1] > 1 else 0.0
    return place


def leads_of_best(similarities: Similarities, map: ReferenceGraph, pose: Array, elsewhere_m: float) -> MatchLeads:
    """The leads of the most similar reference over others, and over those near an estimated pose (3,).

    Elsewhere: beyond this many metres, or seen from another heading. Near the pose: within as many, seen from any.
    """
    best, compared = similarities.best, similarities.candidates
    places = map.poses if compared is None else map.poses[compared]
    turned = places[:, 2] + similarities.best_heading * (2.0 * math.pi / similarities.values.shape[1])
    row = int(best.argmax())
    away, from_pose = places - places[row], places - pose
    far = np.hypot(away[:, 0], away[:, 1]) > elsewhere_m
    far |= np.abs(wrap(turned - turned[row])) > TURNED
    near = np.hypot(from_pose[:, 0], from_pose[:, 1]) <= elsewhere_m
    return MatchLeads(best_place(similarities, map), _lead_over(far, similarities), _lead_over(near, similarities))


def _lead_over(rows: Bools, similarities: Similarities) -> float:
    others = similarities.best[rows]
    if not len(others):
        return 0.0
    lead = float(np.maximum.reduce(similarities.best)) - float(np.maximum.reduce(others))
    return lead / max(similarities.spread, 1e-9)


def mass_within(belief: Particles, pose: Array, metres: float, radians: float) -> float:
    """The share of a belief within a tolerance of a pose (3,)."""
    mass = share_within(belief.poses, belief.weights, pose, metres, radians)
    return min(1.0, mass / float(np.add.reduce(belief.weights)))
