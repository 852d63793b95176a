"""A room of points with looks of their own, and a map of it with its landmarks."""

import functools

import numpy as np
from made_tour import Landmarks as Points

from omninav.pipeline import Context
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.mapping.learned_landmarks import LearnLandmarks
from omninav.stages.mapping.learned_words import LearnVisualWords
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.maps import ReferenceEvent, ReferenceGraph
from omninav.stages.values.pose import Pose

SIZE = (12.0, 6.0)
REACH_M = 3.0
"""Range of the robot's camera (m): less than the room, so that its ends look different."""
HEIGHT_M = 0.9
"""The camera's height over the floor, where the points' z is 0."""
FEW = np.empty((0, 2), np.int64)
"""No edges."""


@functools.cache
def room(seed: int = 0, number: int = 600) -> Points:
    """Points scattered over the room."""
    return Points(np.random.default_rng(seed).uniform([0, 0, 0], [*SIZE, 2.2], (number, 3)))


def tour_poses(step: float = 0.4) -> np.ndarray:
    """Poses (N, 3) there and back along the room, 1 m apart, turning all the way."""
    x = np.arange(1.0, SIZE[0] - 1.0, step)
    xy = np.concatenate([np.column_stack([x, np.full(len(x), 2.5)]), np.column_stack([x[::-1], np.full(len(x), 3.5)])])
    return np.column_stack([xy, wrap(0.7 * np.arange(len(xy)))])


def seen_from(points: Points, pose: np.ndarray) -> LocalFeatures:
    """Exact bearings of the points around a pose."""
    return points.seen(Pose(*pose.tolist()), REACH_M)


def graph_of(poses: np.ndarray) -> ReferenceGraph:
    """References whose appearance says nothing."""
    steps = np.column_stack([np.arange(len(poses) - 1), np.arange(1, len(poses))]).astype(np.int64)
    return ReferenceGraph(poses, np.zeros((len(poses), 12, 4), np.float32), "histograms", steps, "truth")


def with_landmarks(
    map: ReferenceGraph, features: list[LocalFeatures | None], taken: list[bool] | None = None
) -> ReferenceGraph:
    """The map with the landmarks that the references' features give; `taken`: which images are references."""
    events = [ReferenceEvent(n, "far") if each else None for n, each in enumerate(taken or [True] * len(features))]
    words = LearnVisualWords(words=300).step(Context("words"), features, events).words
    return LearnLandmarks().step(Context("landmarks"), features, events, map, words).map


@functools.cache
def mapped_room() -> ReferenceGraph:
    """The map of `room()` that the tour gives."""
    poses = tour_poses()
    return with_landmarks(graph_of(poses), [seen_from(room(), pose) for pose in poses])
