"""The whole filter on a map of some thousand references: tracking near the belief, and a robot put elsewhere."""

from typing import NamedTuple

import numpy as np
import pytest
from made_references import references
from view_at_turn import turned_view

from omninav.pipeline import Context, Tick
from omninav.stages.candidates.index import IndexedCandidates
from omninav.stages.candidates.reference_index import BuildReferenceIndex, BuildReferenceIndexState
from omninav.stages.fusion.importance_resampling import ImportanceResampling
from omninav.stages.fusion.particle_prior import ParticlePrior
from omninav.stages.match.selective import SelectiveMatch
from omninav.stages.motion.rotation_translation_rotation import MeasuredNoise, RotationTranslationRotation
from omninav.stages.sensor.near_references import NearReferences
from omninav.stages.sensor.similarity_proposals import SimilarityProposals
from omninav.stages.values.belief import Likelihood
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion

SEGMENTS, BINS = 12, 16
LENGTH_SCALE = LengthScale(0.6)
STEP = Motion(0.3, 0.0, 0.0)


class Land:
    """A flat land whose look, segment by segment of the compass, changes smoothly over about a metre."""

    def __init__(self) -> None:
        rng = np.random.default_rng(0)
        self.waves = rng.normal(0, 1.0, (6, 2, SEGMENTS * BINS))
        self.phases = rng.uniform(0, 2 * np.pi, (6, SEGMENTS * BINS))

    def seen_from(self, pose: np.ndarray, noise: np.ndarray | None = None) -> np.ndarray:
        """Histograms (segments, bins) around a robot at a pose."""
        fields = sum(np.cos(pose[:2] @ wave + phase) for wave, phase in zip(self.waves, self.phases, strict=True))
        values = np.exp(fields.reshape(SEGMENTS, BINS) + (0 if noise is None else noise))
        return turned_view((values / values.sum(axis=1, keepdims=True)).astype(np.float32), float(pose[2]))

    def map(self) -> ReferenceGraph:
        """Parallel ways of 30 m, a reference every 0.4 m: over 3000."""
        rng = np.random.default_rng(1)
        along, across = np.meshgrid(np.arange(0, 30, 0.4), np.arange(0, 30, 0.7), indexing="ij")
        poses = np.column_stack([along.ravel(), across.ravel(), rng.uniform(-np.pi, np.pi, along.size)])
        return references(poses, np.stack([self.seen_from(pose) for pose in poses]))


LAND = Land()
MAP = LAND.map()
BUILD, BUILT = BuildReferenceIndex(), Context("reference_index")
BUILD.setup(BUILT)
INDEX = BUILD.step(BUILT, MAP, BuildReferenceIndexState()).index
MATCHING = Context("match")
MATCHING.read = frozenset({"similarities"})  # nobody asks for a calibration
DRIVE = [np.array([4.0 + 0.3 * k, 5.25, 0.0]) for k in range(30)]
ELSEWHERE = [np.array([24.15, 25.0 - 0.3 * k, -np.pi / 2]) for k in range(24)]


class Filtered(NamedTuple):
    """One drive through the filter: errors (m), and what the sensor said at each picture."""

    errors: np.ndarray
    said: list[Likelihood]
    compared: list[int]


def drive(path: list[np.ndarray], candidates: IndexedCandidates) -> Filtered:
    ctx = Context("filter", np.random.default_rng(0))
    motion, match, sensor = RotationTranslationRotation(), SelectiveMatch(), NearReferences()
    for stage in (motion, sensor, candidates):
        stage.setup(ctx)
    match.setup(MATCHING)
    noise, errors, said, compared = np.random.default_rng(9), [], [], []
    ctx.tick = Tick(0, 0, first_of_log=True)
    belief = ParticlePrior().step(ctx, MAP, None, LENGTH_SCALE).belief
    assert belief is not None
    for k, pose in enumerate(path):
        ctx.tick = Tick(k, k, first_of_log=k == 0)
        moved = STEP if k else None
        belief = motion.step(ctx, belief, moved, MeasuredNoise()).belief
        view = SegmentHistograms(LAND.seen_from(pose, noise.normal(0, 0.5, (SEGMENTS, BINS))))
        chosen = candidates.step(ctx, view, MAP, INDEX, belief, LENGTH_SCALE).candidates
        alike = match.step(MATCHING, view, MAP, chosen).similarities
        out = sensor.step(ctx, alike, belief, MAP, moved, LENGTH_SCALE)
        proposed = SimilarityProposals().step(ctx, out.field, MAP, LENGTH_SCALE).proposals
        belief = ImportanceResampling().step(ctx, belief, out.likelihood, proposed).belief
        estimate = belief.estimate().pose
        errors.append(np.hypot(estimate.x - pose[0], estimate.y - pose[1]))
        said.append(out.likelihood)
        compared.append(len(alike.values))
    return Filtered(np.array(errors), said, compared)


SOME, WHOLE = IndexedCandidates(), IndexedCandidates(compare_all_up_to=len(MAP))


def test_tracking_by_some_references_is_as_good_as_comparing_the_whole_map() -> None:
    few, all_ = drive(DRIVE, SOME), drive(DRIVE, WHOLE)
    assert len(MAP) > 3000
    assert all_.compared[-1] == len(MAP)
    assert max(few.compared[10:]) < 0.2 * len(MAP)
    assert np.median(all_.errors[5:]) < 0.25  # references stand 0.4 m and 0.7 m apart
    assert np.median(few.errors[5:]) < np.median(all_.errors[5:]) + 0.05
    # "Anywhere" is that of the whole map, on average over some pictures.
    ratio = [np.log(a.mean_likelihood / b.mean_likelihood) for a, b in zip(few.said[5:], all_.said[5:], strict=True)]  # type: ignore[operator]
    assert abs(np.mean(ratio)) < 0.3


@pytest.mark.parametrize("candidates", [SOME, WHOLE], ids=["some", "whole"])
def test_a_robot_that_is_put_elsewhere_is_found_within_ten_images(candidates: IndexedCandidates) -> None:
    errors = drive(DRIVE[:15] + ELSEWHERE, candidates).errors
    assert errors[10:15].max() < 0.5
    assert errors[15] > 10
    assert errors[15 + 10 :].max() < 0.5
