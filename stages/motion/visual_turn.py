"""Corrects the turns of odometry by the optical flow ahead of the robot and behind it."""

import math
from dataclasses import field, replace
from typing import Annotated, NamedTuple

import cv2
import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.arrays import Array, Bytes
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.image import Panorama
from omninav.stages.values.pose import AssumedMotion, Motion

from .odometry_noise_model import OdometryNoiseModel

FLOOR_DEG = 0.02
"""Smallest standard deviation of a turn seen in the images, degrees."""
EXPLAINED_SIGMAS = 2.0
"""Gap between the two turns that odometry explains, in its standard deviations."""
SIGMA_FACTOR = 3.0
"""Factor on the standard deviation of a visual turn that the scatter of the flow alone would tell."""
MAX_SMOOTHNESS = 2.7
"""Mean squared difference of pixels two columns apart over that of neighbours, above which odometry alone counts:
some 2 where each column has detail of its own, towards 4 where columns are interpolated."""
MAX_POINTS, POINT_QUALITY, POINT_DISTANCE_PX = 400, 0.003, 5
"""Corners that are tracked: how many, their quality against the best one, and their distance (pixels)."""
WINDOW_PX, LEVELS = 13, 3
"""Window (pixels) and pyramid levels of Lucas and Kanade's tracker."""
MAX_RETURN_PX = 0.5
"""A point that is tracked to the other image and back ends this close to where it began."""
EXPONENT = 12
"""Points count by this power of the cosine of their angle from the direction of driving: within some 35 degrees."""
MIN_POINTS = 10
"""Points that must be tracked there."""
ROUNDS = 10
"""Iterations of the robust fit."""


class VisualTurnState(State):
    """The last panorama in grey (rows, columns)."""

    grey: Bytes = field(default_factory=lambda: np.zeros((0, 0), np.uint8))


class VisualTurn(OdometryNoiseModel, Stage):
    """Gives a motion whose turn is that of odometry and that of the optical flow, each by its variance.

    Not in the papers. What bends a path is the heading, and what a camera sees ahead and behind tells turns far better
    than wheels do: to 0.15 degrees a step in the house, odometry to 0.6 (docs/experiments/cml_straightened.md).
    Of translation nothing is learned, but that half of the correction turns it. A gap between the two that odometry's
    noise (`OdometryNoiseModel`'s) does not explain counts as vision's, so that the farther a visual turn is from the
    measured one the less it is believed. Panoramas made of fewer columns than they have see turns that are none and
    are not asked.
    """

    max_sigma_deg: Annotated[float, Bounds(ge=0)] = 2.0
    """Its largest one, beyond which odometry alone counts; 0: always."""

    class Out(Outputs):
        motion: Motion | None = None

    def step(self, ctx: Context, panorama: Panorama, motion: Motion | None, before: VisualTurnState) -> Out:
        if not self.max_sigma_deg:
            return self.Out(motion=motion)
        grey = np.asarray(cv2.cvtColor(panorama.pixels, cv2.COLOR_BGR2GRAY), np.uint8)
        last, before.grey = before.grey, grey
        if motion is None or last.shape != grey.shape:
            return self.Out(motion=motion)
        if smoothness(grey) > MAX_SMOOTHNESS:
            ctx.count("turn_not_seen")
            return self.Out(motion=motion)
        model = self.model(motion)
        direction = model.steps[0] if abs(model.steps[1]) > 1e-9 else 0.0
        seen = turn_by_flow(last, grey, motion.turn, direction)
        sigma = math.hypot(SIGMA_FACTOR * seen.sigma, math.radians(FLOOR_DEG))
        if not sigma <= math.radians(self.max_sigma_deg):
            ctx.count("turn_not_seen")
            return self.Out(motion=motion)
        variance = model.sigmas[0] ** 2 + model.sigmas[2] ** 2
        gap = float(wrap(seen.turn - motion.turn))
        change = gap * variance / max(variance + sigma**2, (gap / EXPLAINED_SIGMAS) ** 2)
        cos, sin = math.cos(change / 2.0), math.sin(change / 2.0)
        turned = replace(
            motion,
            x=cos * motion.x - sin * motion.y,
            y=sin * motion.x + cos * motion.y,
            turn=float(wrap(motion.turn + change)),
        )
        if isinstance(turned, AssumedMotion):
            turned = replace(turned, sigma_turn=min(turned.sigma_turn, sigma))
        return self.Out(motion=turned)


class FlowTurn(NamedTuple):
    """A turn (rad, counter-clockwise) and its standard deviation (rad), inf where too little was tracked."""

    turn: float
    sigma: float


def turn_by_flow(before: Bytes, after: Bytes, turn: float, direction: float) -> FlowTurn:
    """The turn between two grey panoramas (rows, columns), all around, forward in the middle, clockwise.

    `turn`: a first guess (rad). `direction`: where the robot drove, from its heading (rad, counter-clockwise). Azimuths
    of points change by the turn and by parallax, which is nothing straight ahead and behind and has one sign on either
    side: a line in the sine of the angle from the direction of driving, fitted robustly where that is small, gives the
    turn. Correlating whole views (`turn_between`) takes parallax for turning where things are close.
    """
    columns = before.shape[1]
    shift = round(turn * columns / (2.0 * math.pi))
    azimuths, changes = _flow(before, np.roll(after, -shift, axis=1))
    angles = azimuths - direction
    weights = np.abs(np.cos(angles)) ** EXPONENT
    if weights.sum() < MIN_POINTS:
        return FlowTurn(turn, math.inf)
    rest, sigma = _line(np.sin(angles), changes, weights)
    return FlowTurn(2.0 * math.pi * shift / columns - rest, sigma)


def smoothness(view: Bytes) -> float:
    """Mean squared difference of pixels two columns apart over that of neighbours; 0 where all are equal."""
    values = view.astype(np.float32)
    near, far = (float(np.square(np.roll(values, step, axis=1) - values).mean()) for step in (1, 2))
    return far / near if near else 0.0


def _flow(before: Bytes, after: Bytes) -> tuple[Array, Array]:
    """Azimuths (N,) of points in the first panorama, and by how much they changed, counter-clockwise (rad)."""
    columns = before.shape[1]
    margin = max(columns // 9, 1)
    first, second = (
        cv2.resize(np.concatenate([view[:, -margin:], view, view[:, :margin]], axis=1), None, fx=2, fy=2)
        for view in (before, after)
    )
    points = cv2.goodFeaturesToTrack(first, MAX_POINTS, POINT_QUALITY, POINT_DISTANCE_PX)
    if points is None:
        return np.empty(0), np.empty(0)
    window = (WINDOW_PX, WINDOW_PX)
    room = np.empty_like(points)
    moved, found, _ = cv2.calcOpticalFlowPyrLK(first, second, points, room.copy(), winSize=window, maxLevel=LEVELS)
    back, returned, _ = cv2.calcOpticalFlowPyrLK(second, first, moved, room, winSize=window, maxLevel=LEVELS)
    gap = np.hypot(*(back - points)[:, 0].T)
    kept = (found[:, 0] > 0) & (returned[:, 0] > 0) & (gap < MAX_RETURN_PX)
    start, end = (each[kept, 0, 0].astype(np.float64) / 2.0 for each in (points, moved))
    unit = 2.0 * math.pi / columns
    return math.pi - unit * (start - margin + 0.5), -unit * (end - start)


def _line(sines: Array, changes: Array, weights: Array) -> tuple[float, float]:
    """The change at sine 0 of the line that fits best by Cauchy's loss, and its standard deviation."""
    design = np.column_stack([np.ones_like(sines), sines])
    kept = np.ones_like(sines)
    for _ in range(ROUNDS):
        weighted = design * (kept * weights)[:, None]
        normal = weighted.T @ design
        level, slope = np.linalg.solve(normal + 1e-12 * np.eye(2), weighted.T @ changes)
        gaps = np.abs(changes - level - slope * sines)
        order = np.argsort(gaps)
        share = np.cumsum(weights[order])
        scale = 1.5 * float(gaps[order][np.searchsorted(share, 0.5 * share[-1])]) + 1e-5
        kept = 1.0 / (1.0 + (gaps / scale) ** 2)
    return float(level), float(scale * math.sqrt(np.linalg.inv(normal + 1e-12 * np.eye(2))[0, 0]))
