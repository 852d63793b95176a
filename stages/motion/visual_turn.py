"""Corrects the turns of odometry by what the images show."""

import math
from dataclasses import field, replace
from typing import Annotated

import cv2
import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.geometry.arrays import Bytes
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.image import Panorama
from omninav.stages.values.pose import AssumedMotion, Motion

from .odometry_noise_model import OdometryNoiseModel
from .turn_by_flow import smoothness, turn_by_flow

FLOOR_DEG = 0.02
"""Smallest standard deviation of a turn seen in the images, degrees."""
EXPLAINED_SIGMAS = 2.0
"""Gap between the two turns that odometry explains, in its standard deviations."""
SIGMA_FACTOR = 3.0
"""Factor on the standard deviation of a visual turn that the scatter of the flow alone would tell."""
MAX_SMOOTHNESS = 2.7
"""Mean squared difference of pixels two columns apart over that of neighbours, above which odometry alone counts:
some 2 where each column has detail of its own, towards 4 where columns are interpolated."""


class VisualTurnState(State):
    """The last panorama in grey (rows, columns)."""

    grey: Bytes = field(default_factory=lambda: np.zeros((0, 0), np.uint8))


class VisualTurn(OdometryNoiseModel, Stage):
    """Gives a motion whose turn is that of odometry and that of the optical flow, each by its variance.

    Not in the papers. What bends a path is the heading, and what a camera sees ahead and behind tells turns far better
    than wheels do: to 0.15 degrees a step in the house, odometry to 0.6 (docs/experiments/cml_straightened.md).
    Of translation nothing is learned, but that half of the correction turns it. A gap between the two that odometry's
    noise (`OdometryNoiseModel`'s) does not explain counts as vision's, so that the farther a visual turn lies from the
    measured one the less it is believed. Panoramas made of fewer columns than they have see turns that are none and
    are not asked.
    """

    max_sigma_deg: Annotated[float, Bounds(ge=0)] = 2.0
    """Its largest one, beyond which odometry alone counts; 0: always."""

    class Out(Outputs):
        """The corrected motion."""

        motion: Motion | None = None

    def step(self, ctx: Context, panorama: Panorama, motion: Motion | None, before: VisualTurnState) -> Out:
        """Correct one motion."""
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
