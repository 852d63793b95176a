"""A map of landmarks: `benchmarks/landmarks.py`, and of how many references where not of 300, 3800 and 10,000.

References lie 0.45 m apart along the aisles of a hall and see up to 500 points of the shelves beside them, each with a
look of its own, a tenth of them others in every image. Printed: processor seconds of each step of making the map, its
size, the largest memory; then milliseconds of a pose, median of 50 images between references, whole and in parts.
"""

import math
import resource
import sys
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context
from omninav.pipeline.engine.artifact import artifact_bytes
from omninav.stages.geometry.appearance.visual_words import root_descriptors
from omninav.stages.geometry.landmarks.bearing_pose import matched, poses_of
from omninav.stages.mapping.learned_landmarks import LearnLandmarks
from omninav.stages.mapping.learned_words import LearnVisualWords
from omninav.stages.sensor.landmark_pose import WORD_FEATURES, LandmarkPose, LandmarkPoseState
from omninav.stages.values.belief import Particles
from omninav.stages.values.landmarks import DESCRIPTOR_SCALE, Landmarks
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceEvent, ReferenceGraph

Array = npt.NDArray[np.float64]

SPACING_M, AISLE_M, LENGTH_M = 0.45, 5.0, 60.0
"""Distance of references along an aisle, of aisles, and the length of one, m."""
POINTS_PER_M = 120
"""Points of a metre of shelf, on either side of an aisle."""
REACH_M, FEATURES = 4.0, 500
"""Range of a camera (m), and the largest number of points that it finds."""
BEARING_SIGMA, LOOK_SIGMA = math.radians(0.08), 8.0
"""Noise of bearings (rad) and of the numbers of a descriptor."""


class Hall:
    """Points along shelves, with looks."""

    def __init__(self, references: int) -> None:
        self.rng = np.random.default_rng(0)
        each = round(LENGTH_M / SPACING_M)
        number = np.arange(references)
        aisle, place = number // each, number % each
        x = np.where(aisle % 2 == 0, place, each - 1 - place) * SPACING_M
        heading = np.where(aisle % 2 == 0, 0.0, math.pi)
        self.poses = np.column_stack([x, aisle * AISLE_M, heading + 0.2 * self.rng.standard_normal(references)])
        shelves = int(aisle[-1]) + 2
        count = round(shelves * LENGTH_M * POINTS_PER_M)
        shelf = self.rng.integers(0, shelves, count)
        along, across, up = (self.rng.uniform(*ends, count) for ends in ((0.0, LENGTH_M), (-0.5, 0.5), (-0.8, 1.2)))
        self.points = np.column_stack([along, (shelf - 0.5) * AISLE_M + across, up])
        self.points = self.points[np.lexsort((self.points[:, 0], shelf))]
        self.shelf = np.sort(shelf)
        self.looks = np.minimum(self.rng.gamma(0.6, 40.0, (count, 128)), 255).astype(np.uint8)

    def seen(self, pose: Array) -> LocalFeatures:
        """The features that a robot sees from a pose."""
        rng = self.rng
        near: list[npt.NDArray[np.int64]] = []
        for shelf in {round(pose[1] / AISLE_M), round(pose[1] / AISLE_M) + 1}:
            low, high = np.searchsorted(self.shelf, [shelf, shelf + 1])
            a, b = low + np.searchsorted(self.points[low:high, 0], [pose[0] - REACH_M, pose[0] + REACH_M])
            near.append(np.arange(a, b))
        rows = rng.permutation(np.concatenate(near))[:FEATURES]
        rays = self.points[rows] - [pose[0], pose[1], 0.0]
        cos, sin = math.cos(pose[2]), math.sin(pose[2])
        rays = rays @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        bearings = rays / np.linalg.norm(rays, axis=1, keepdims=True)
        bearings += BEARING_SIGMA * rng.standard_normal(bearings.shape)
        bearings /= np.linalg.norm(bearings, axis=1, keepdims=True)
        looks = np.clip(self.looks[rows] + LOOK_SIGMA * rng.standard_normal((len(rows), 128)), 0, 255)
        wrong = rng.random(len(rows)) < 0.1
        looks[wrong] = np.minimum(rng.gamma(0.6, 40.0, (int(wrong.sum()), 128)), 255)
        nothing = np.zeros((len(rows), 3), np.float32)
        return LocalFeatures(bearings, nothing[:, :2], looks.astype(np.uint8), nothing, np.ones(len(rows), np.float32))


def timed(call: Callable[..., Any], *arguments: Any) -> tuple[Any, float]:
    """The result of a call, and the processor time that it takes (s)."""
    began = time.process_time()
    return call(*arguments), time.process_time() - began


def megabytes() -> float:
    """Largest memory of this process so far."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def made(hall: Hall) -> ReferenceGraph:
    """The map of a hall; prints what it takes."""
    features = [hall.seen(pose) for pose in hall.poses]
    events = [ReferenceEvent(n, "far") for n in range(len(features))]
    number = len(features)
    nothing = np.zeros((number, 36, 20), np.float32)
    map = ReferenceGraph(hall.poses, nothing, "histograms", np.empty((0, 2), np.int64), "truth")
    before = megabytes()
    learned, of_words = timed(LearnVisualWords().step, Context("words"), features, events)
    out, of_landmarks = timed(LearnLandmarks().step, Context("landmarks"), features, events, map, learned.words)
    size = len(artifact_bytes(out.map)) / 1e6
    print(
        f"{number:6d} references: words {of_words:6.1f} s, landmarks {of_landmarks:6.1f} s, {size:6.1f} MB, "
        f"{len(out.map.landmarks):7d} landmarks, memory {before:.0f} -> {megabytes():.0f} MB",
        flush=True,
    )
    return out.map


def pose_times(hall: Hall, map: ReferenceGraph) -> None:
    """Prints what a pose takes, whole and in parts."""
    assert map.landmarks is not None
    stage, ctx, rng = LandmarkPose(), Context("landmark_pose"), np.random.default_rng(1)
    parts: dict[str, list[float]] = {"whole": [], "words": [], "candidates": [], "matching": [], "pose": []}
    errors, rows_seen = [], []
    landmarks = map.landmarks
    for row in rng.integers(0, len(map) - 1, 55).tolist():
        pose = map.poses[row] + rng.normal(0.0, [0.15, 0.15, 0.3])
        image = hall.seen(pose)
        belief = Particles(pose + rng.normal(0.0, 0.1, (200, 3)), np.full(200, 1 / 200))
        out, whole = timed(stage.step, ctx, LandmarkPoseState(), image, map, belief)
        _, words = timed(landmarks.words.similarities, image.descriptors[:WORD_FEATURES])
        rows, candidates = timed(landmarks.seen_by, stage._candidates(image, landmarks.words, map, belief))
        pairs, matching = timed(_matched, image, landmarks, rows)
        points = landmarks.points[rows[pairs.second]].astype(np.float64)
        bearings = np.ascontiguousarray(image.bearings[pairs.first])
        _, consensus = timed(poses_of, bearings, points, landmarks.sigma_rad, stage.min_inliers)
        for name, seconds in zip(parts, (whole, words, candidates, matching, consensus), strict=True):
            parts[name].append(seconds)
        rows_seen.append(len(rows))
        errors.append(math.inf if out.fix is None else float(np.hypot(*(out.fix.poses[0] - pose)[:2])))
    found = ", ".join(f"{name} {1000 * median(values[5:]):.2f}" for name, values in parts.items())
    print(f"        a pose (ms): {found}; {median(rows_seen):.0f} landmarks compared, error {median(errors):.4f} m")


def _matched(image: LocalFeatures, landmarks: Landmarks, rows: Any) -> Any:
    theirs = landmarks.descriptors[rows].astype(np.float32) / np.float32(DESCRIPTOR_SCALE)
    return matched(root_descriptors(image.descriptors), theirs)


def main() -> None:
    """Each number of references that was typed, or the usual ones."""
    made(Hall(40))  # compiled
    for number in [int(word) for word in sys.argv[1:]] or [300, 3800, 10_000]:
        hall = Hall(number)
        pose_times(hall, made(hall))


if __name__ == "__main__":
    main()
