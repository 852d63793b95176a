"""Tells how probable it is that the estimate is right."""

import math
from dataclasses import field
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.appearance.visual_compass import angle_of_peak
from omninav.stages.geometry.plane.se2 import compose, wrap
from omninav.stages.geometry.probability.consistency import consistency, log_odds_of_right
from omninav.stages.geometry.probability.particles import are_within
from omninav.stages.values.belief import Likelihood, Particles, PoseEstimate
from omninav.stages.values.confidence import PoseConfidence, WrongPoseAgreement
from omninav.stages.values.conflicts import Conflicts
from omninav.stages.values.drive import pose_row
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.requests import Restart
from omninav.stages.values.similarity import Similarities

Array = npt.NDArray[np.float64]

MAX_IMAGES = 500
"""Images that are remembered, of a robot that stands or moves slowly."""
ELSEWHERE, TURNED = 2.0, math.radians(30.0)
"""A match is of another place than the best one beyond so many radii of agreement, or turned by more (rad)."""
STEEPNESS = 4
"""Power of the lead by which an image counts: as good as nothing at half of `distinct_lead`, fully at twice."""


class ConfidenceMonitorState(State):
    """Where the robot would be now if each of the last images had been taken where its best match was: `places` (M, 3),
    the oldest first; how new each was: `novelties` (M,), and how much it still counts: `weights` (M,), 0 of a stretch
    that was driven without an image."""

    places: Array = field(default_factory=lambda: np.zeros((0, 3)))
    novelties: Array = field(default_factory=lambda: np.zeros(0))
    weights: Array = field(default_factory=lambda: np.zeros(0))


class ConfidenceMonitor(Stage):
    """The probability that the estimate is within a tolerance of the truth, from images and belief.

    A filter follows whatever its images say, so a sharp belief may be a wrong one. Each image by itself, without any
    belief, resembles one reference most; odometry carries the places of the last images' best matches to now. How many
    of them agree with the estimate is compared with how many agree with a wrong one by chance, which the map's own
    images tell (`LearnWrongPoseAgreement`): the odds that the estimate is in the right place at all. That probability
    times the belief's share within the tolerance is the confidence.

    An image counts as much as it does in the filter (the likelihood's novelty), and the more, the farther its best
    match leads all matches elsewhere: one that resembles many places says nothing of any. A way without images raises
    the probability that the robot was carried elsewhere, as images do.

    How well it does, and where the defaults are from: docs/experiments/confidence.md.
    """

    within_m: Annotated[float, Bounds(gt=0)] = 0.5
    """Tolerance in position (m)."""
    within_deg: Annotated[float, Bounds(gt=0, le=180)] = 10.0
    """Tolerance in heading."""
    memory: Annotated[float, Bounds(ge=1)] = 20.0
    """Independent images after which one counts a third (1 / e)."""
    distinct_lead: Annotated[float, Bounds(gt=0)] = 0.7
    """Lead of the best match over those elsewhere, in standard deviations of the similarity over the map's references,
    at which an image counts half."""
    strength: Annotated[float, Bounds(gt=0)] = 20.0
    """From how many images the share of agreements by chance is taken to be known."""
    kidnapping_probability: Annotated[float, Bounds(ge=0, lt=1)] = 0.01
    """Probability per independent image, or per length scale driven without one, that the robot was carried elsewhere,
    or found itself again."""

    right_in_conflict: Annotated[float, Bounds(ge=0, le=1)] = 0.2
    """Factor of the confidence while inputs mislead that do not fit each other: images then agree on what is wrong."""

    class Out(Outputs):
        """The probability that the estimate is right."""

        confidence: PoseConfidence

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
        restart: Restart | None = None,
    ) -> Out:
        """One image, or a tick without one. `likelihood`: of the same image, for its novelty."""
        if ctx.tick.first_of_log or restart is not None:
            recent.places, recent.novelties, recent.weights = np.zeros((0, 3)), np.zeros(0), np.zeros(0)
        elif motion is not None:
            recent.places = compose(recent.places, np.array((motion.x, motion.y, motion.turn)))
        pose = np.array(pose_row(estimate.pose))
        gate, radians = max(self.within_m, length_scale.metres), math.radians(self.within_deg)
        if similarities is not None and similarities.values.size:
            lead = lead_of_best(similarities, map, ELSEWHERE * gate)
            distinct = 1.0 / (1.0 + (self.distinct_lead / max(lead, 1e-9)) ** STEEPNESS)
            novelty = 1.0 if likelihood is None else likelihood.novelty
            self._remember(recent, best_place(similarities, map), novelty, distinct)
        elif motion is not None and (blind := math.hypot(motion.x, motion.y) / length_scale.metres) > 0.0:
            self._remember(recent, pose, min(1.0, blind), 0.0)
        odds = log_odds_of_right(
            consistency(recent.places, pose, gate, radians), recent.weights, recent.novelties,
            when_wrong.share, self.strength, self.kidnapping_probability,
        )  # fmt: skip
        probability = mass_within(belief, pose, self.within_m, radians) / (1.0 + math.exp(-odds))
        if conflicts is not None and conflicts.misleading:
            probability *= self.right_in_conflict
        return self.Out(confidence=PoseConfidence(probability))

    def _remember(self, recent: ConfidenceMonitorState, place: Array, novelty: float, distinct: float) -> None:
        weight = novelty * distinct
        faded = recent.weights * math.exp(-weight / self.memory)
        recent.places = np.concatenate([recent.places, place[None]])[-MAX_IMAGES:]
        recent.novelties = np.concatenate([recent.novelties, [novelty]])[-MAX_IMAGES:]
        recent.weights = np.concatenate([faded, [weight]])[-MAX_IMAGES:]


def best_place(similarities: Similarities, map: ReferenceGraph) -> Array:
    """The pose (3,) of a robot that stands where the most similar reference was taken, turned as the view is."""
    values = similarities.values
    row = int(similarities.best.argmax())
    reference = row if similarities.candidates is None else int(similarities.candidates[row])
    turn = angle_of_peak(values[row]) if values.shape[1] > 1 else 0.0
    place: Array = map.poses[reference] + np.array((0.0, 0.0, turn))
    return place


def lead_of_best(similarities: Similarities, map: ReferenceGraph, elsewhere_m: float) -> float:
    """The lead of the most similar reference over the best one elsewhere, in standard deviations of the similarity over
    all that were compared. Elsewhere: beyond so many metres, or seen from another heading; 0 where all show one place.
    """
    weights, headings = similarities.sampling_weight, similarities.values.shape[1]
    best = similarities.best.astype(np.float64)
    places = map.poses[slice(None) if similarities.candidates is None else similarities.candidates]
    turned = places[:, 2] + similarities.best_heading * (2.0 * math.pi / headings)
    row = int(best.argmax())
    away = np.hypot(*(places - places[row])[:, :2].T)
    elsewhere = (away > elsewhere_m) | (np.abs(wrap(turned - turned[row])) > TURNED)
    if not elsewhere.any():
        return 0.0
    spread = math.sqrt(float(np.average(np.square(best - np.average(best, weights=weights)), weights=weights)))
    return float(best[row] - best[elsewhere].max()) / max(spread, 1e-9)


def mass_within(belief: Particles, pose: Array, metres: float, radians: float) -> float:
    """The share of a belief within a tolerance of a pose (3,)."""
    near = are_within(np.ascontiguousarray(belief.poses), pose, metres, radians)
    return min(1.0, float(belief.weights[near].sum() / belief.weights.sum()))
