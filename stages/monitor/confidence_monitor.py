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
from omninav.stages.geometry.probability.evidence import evidence_novelty
from omninav.stages.values.belief import Particles, PoseEstimate
from omninav.stages.values.confidence import PoseConfidence, WrongPoseAgreement
from omninav.stages.values.drive import pose_row
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.requests import Restart
from omninav.stages.values.similarity import Similarities

Array = npt.NDArray[np.float64]

MIN_NOVELTY = 0.02
"""How much an image counts where the robot stands."""
MAX_IMAGES = 500
"""Images that are remembered, of a robot that stands or moves slowly."""


class ConfidenceMonitorState(State):
    """Where the robot would be now if each of the last images had been taken where its best match was: `places` (M, 3),
    the oldest first; how new each was: `novelties` (M,), and how much it still counts: `weights` (M,)."""

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

    How well it does, and where the defaults are from: docs/experiments/confidence.md.
    """

    within_m: Annotated[float, Bounds(gt=0)] = 0.5
    """Tolerance in position (m)."""
    within_deg: Annotated[float, Bounds(gt=0, le=180)] = 10.0
    """Tolerance in heading."""
    memory: Annotated[float, Bounds(ge=1)] = 20.0
    """Independent images after which one counts a third (1 / e)."""
    independence_distance: Annotated[float, Bounds(gt=0)] = 2.0
    """Distance driven, in length scales, after which an image is independent of the one before."""
    strength: Annotated[float, Bounds(gt=0)] = 20.0
    """From how many images the share of agreements by chance is taken to be known."""
    kidnapping_probability: Annotated[float, Bounds(ge=0, lt=1)] = 1e-3
    """Probability per independent image that the robot was carried elsewhere, or found itself again."""

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
        motion: Motion | None = None,
        restart: Restart | None = None,
    ) -> Out:
        """One image, or a tick without one."""
        if ctx.tick.first_of_log or restart is not None:
            recent.places, recent.novelties, recent.weights = np.zeros((0, 3)), np.zeros(0), np.zeros(0)
        elif motion is not None:
            recent.places = compose(recent.places, np.array((motion.x, motion.y, motion.turn)))
        if similarities is not None and similarities.values.size:
            driven = None if motion is None else math.hypot(motion.x, motion.y)
            novelty = evidence_novelty(driven, self.independence_distance * length_scale.metres, MIN_NOVELTY)
            self._remember(recent, best_place(similarities, map), novelty)
        pose = np.array(pose_row(estimate.pose))
        gate, radians = max(self.within_m, length_scale.metres), math.radians(self.within_deg)
        odds = log_odds_of_right(
            consistency(recent.places, pose, gate, radians), recent.weights, recent.novelties,
            when_wrong.share, self.strength, self.kidnapping_probability,
        )  # fmt: skip
        probability = mass_within(belief, pose, self.within_m, radians) / (1.0 + math.exp(-odds))
        return self.Out(confidence=PoseConfidence(probability))

    def _remember(self, recent: ConfidenceMonitorState, place: Array, novelty: float) -> None:
        faded = recent.weights * math.exp(-novelty / self.memory)
        recent.places = np.concatenate([recent.places, place[None]])[-MAX_IMAGES:]
        recent.novelties = np.concatenate([recent.novelties, [novelty]])[-MAX_IMAGES:]
        recent.weights = np.concatenate([faded, [novelty]])[-MAX_IMAGES:]


def best_place(similarities: Similarities, map: ReferenceGraph) -> Array:
    """The pose (3,) of a robot that stands where the most similar reference was taken, turned as the view is."""
    values = similarities.values
    row = int(values.max(axis=1).argmax())
    reference = row if similarities.candidates is None else int(similarities.candidates[row])
    turn = angle_of_peak(values[row]) if values.shape[1] > 1 else 0.0
    place: Array = map.poses[reference] + np.array((0.0, 0.0, turn))
    return place


def mass_within(belief: Particles, pose: Array, metres: float, radians: float) -> float:
    """The share of a belief within a tolerance of a pose (3,)."""
    away = belief.poses - pose
    near = (np.square(away[:, :2]).sum(axis=1) <= metres**2) & (np.abs(wrap(away[:, 2])) <= radians)
    return min(1.0, float(belief.weights[near].sum() / belief.weights.sum()))
