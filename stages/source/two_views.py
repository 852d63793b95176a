"""Random problems of two views, to try what solves them."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Source, State, Tick
from omninav.stages.camera.rays import normalised
from omninav.stages.geometry.two_views.epipolar import turn_about_vertical
from omninav.stages.values.two_views import BearingPairs, RelativeView

PAIRS = 100
"""Pairs of bearings per problem."""
OUTLIER_RATIO = 0.5
"""Share of the bearings of view 2 that look anywhere on their part of the sphere instead."""


class TwoViewsState(State):
    """Number of problems so far."""

    problems: int = 0


class TwoViews(Source):
    """Makes pairs of views of random points around a camera, some paired wrongly: one problem per tick.

    The baseline is 1. Points are distributed uniformly over a part of the sphere around view 1.
    """

    problems: Annotated[int, Bounds(ge=1)] = 100
    """Number of problems."""
    noise_deg: Annotated[float, Bounds(ge=0)] = 0.1
    """Standard deviation of each bearing's error, along each of two directions across it."""
    max_elevation_deg: Annotated[float, Bounds(gt=0, le=90)] = 90.0
    """Largest elevation of points above or below the horizon, degrees."""
    min_distance: Annotated[float, Bounds(gt=0)] = 1.5
    """Smallest distance of a point from view 1, in baselines."""
    max_distance: Annotated[float, Bounds(gt=0)] = 6.0
    """Largest distance of a point from view 1, in baselines."""
    planar: bool = True
    """View 2 is a robot's that drove on a floor; else it was taken anywhere, turned anyhow."""

    class Out(Outputs):
        """`pairs`: the problem. `truth`: its answer; inliers are the pairs that are not wrong."""

        tick: Tick
        pairs: BearingPairs
        truth: RelativeView

    def length(self) -> int | None:
        """Problems in all."""
        return self.problems

    def step(self, ctx: Context, posed: TwoViewsState) -> Out | None:
        """The next problem; None when there were enough."""
        if posed.problems >= self.problems:
            return None
        rng, index = ctx.rng, posed.problems
        posed.problems += 1
        if self.planar:
            turn, along = rng.uniform(-math.pi, math.pi, 2)
            rotation = turn_about_vertical(turn)
            translation = np.array([math.cos(along), math.sin(along), 0.0])
        else:
            rotation, translation = _any_rotation(rng), self._directions(rng, 1, 90.0)[0]
        distance = rng.uniform(self.min_distance, self.max_distance, (PAIRS, 1))
        points = distance * self._directions(rng, PAIRS, self.max_elevation_deg)
        first, second = self._seen(rng, points), self._seen(rng, (points - translation) @ rotation)
        right = np.arange(PAIRS) >= round(OUTLIER_RATIO * PAIRS)
        second[~right] = self._directions(rng, PAIRS - int(right.sum()), self.max_elevation_deg)
        return self.Out(
            tick=Tick(index=index, stamp=index * 10**9, frame=index, first_of_log=index == 0),
            pairs=BearingPairs(first, second),
            truth=RelativeView(rotation, translation, right),
        )

    def _seen(self, rng: np.random.Generator, points: np.ndarray) -> np.ndarray:
        bearings = normalised(points)
        return normalised(bearings + math.radians(self.noise_deg) * rng.normal(size=bearings.shape))

    def _directions(self, rng: np.random.Generator, number: int, elevation_deg: float) -> np.ndarray:
        around = rng.uniform(-math.pi, math.pi, number)
        up = rng.uniform(-1.0, 1.0, number) * math.sin(math.radians(elevation_deg))
        level = np.sqrt(1.0 - up * up)
        return np.stack([level * np.cos(around), level * np.sin(around), up], axis=-1)


def _any_rotation(rng: np.random.Generator) -> np.ndarray:
    # A uniform unit quaternion as a matrix.
    w, x, y, z = normalised(rng.normal(size=4))
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
