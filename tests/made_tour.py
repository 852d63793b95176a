"""Tours through a made-up world of landmarks, as the features that a robot would have seen."""

import itertools
import math
from typing import NamedTuple

import numpy as np

from omninav.pipeline import Context, Tick
from omninav.stages.mapping.loop_closure import LoopClosure
from omninav.stages.mapping.topological import TopologicalMapping
from omninav.stages.mapping.view_comparison import ViewComparison
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.local_features import GlobalDescriptor, LocalFeatures
from omninav.stages.values.pose import Pose
from omninav.stages.values.topological_map import LoopHypotheses, TopologicalMap


class Landmarks:
    """Landmarks at (N, 3) metres, each with a look of its own; those with one number in `same` look the same."""

    def __init__(self, where: np.ndarray, same: np.ndarray | None = None) -> None:
        rng = np.random.default_rng(7)
        self.where = where
        number = np.arange(len(where)) if same is None else same
        self.looks = rng.integers(0, 100, (len(where), 128)).astype(np.uint8)[number]
        self.colours = rng.uniform(-1.0, 1.0, (len(where), 3)).astype(np.float32)[number]

    def seen(self, pose: Pose, reach: float = 7.0) -> LocalFeatures:
        """What a robot sees within reach, in an order that says nothing."""
        gap = self.where - (pose.x, pose.y, 0.9)
        near = np.flatnonzero(np.hypot(gap[:, 0], gap[:, 1]) < reach)
        cos, sin = math.cos(pose.heading), math.sin(pose.heading)
        turned = gap[near] @ np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])
        bearings = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        sizes = np.full(len(near), 4.0, np.float32)
        return LocalFeatures(bearings, np.zeros((len(near), 2)), self.looks[near], self.colours[near], sizes)


def scattered(width: float, depth: float, number: int = 900) -> np.ndarray:
    """Landmarks anywhere over a floor."""
    rng = np.random.default_rng(3)
    return rng.uniform((0.0, 0.0, 0.0), (width, depth, 2.5), (number, 3))


def furnished_alike() -> Landmarks:
    """Landmarks of a floor of 40 m by 40 m, which around (20, 32) are those around (20, 8)."""
    where, look = scattered(40.0, 40.0), np.arange(900)
    here, there = (np.flatnonzero(np.hypot(where[:, 0] - 20.0, where[:, 1] - y) < 3.0) for y in (8.0, 32.0))
    number = min(len(here), len(there))
    where[there[:number]] = where[here[:number]] + (0.0, 24.0, 0.0)
    look[there[:number]] = look[here[:number]]
    return Landmarks(where, look)


def along(corners: list[tuple[float, float]], step: float) -> list[Pose]:
    """Poses every `step` metres along straight lines, looking ahead."""
    poses = []
    for (x, y), (u, v) in itertools.pairwise(corners):
        length, heading = math.hypot(u - x, v - y), math.atan2(v - y, u - x)
        for way in np.arange(0.0, length - 0.5 * step, step):
            share = way / length
            poses.append(Pose(x + share * (u - x), y + share * (v - y), heading))
    return poses


class Mapped(NamedTuple):
    """What the three stages make of a tour."""

    map: TopologicalMap
    hypotheses: LoopHypotheses
    views: ComparedViews


def mapped(
    world: Landmarks, tours: list[list[Pose]], truth: bool = True, known: TopologicalMap | None = None, **parameters
) -> Mapped:
    """The map of tours, an image a second; `parameters` are those of any of the three stages."""
    poses = [pose for tour in tours for pose in tour]
    logs = [log for log, tour in enumerate(tours) for _ in tour]
    seconds = [second for tour in tours for second in range(len(tour))]
    ticks = [
        Tick(row, 10**9 * (1000 * log + second), log, second, second == 0)
        for row, (log, second) in enumerate(zip(logs, seconds, strict=True))
    ]
    comparison, closure, mapping = (
        stage(**{key: parameters.pop(key) for key in list(parameters) if key in stage.__dataclass_fields__})
        for stage in (ViewComparison, LoopClosure, TopologicalMapping)
    )
    assert not parameters
    views = comparison.step(
        Context("views"),
        ticks=ticks,
        features=[world.seen(pose) for pose in poses],
        descriptor=[GlobalDescriptor(np.zeros(3, np.float32)) for _ in poses],
        odometry=poses,
        truth=poses if truth else [None] * len(poses),
        known=known,
    ).views
    found = closure.step(Context("loops"), views).hypotheses
    return Mapped(mapping.step(Context("mapping"), views, found, known).map, found, views)
