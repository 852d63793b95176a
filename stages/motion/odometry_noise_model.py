"""The noise of an odometry motion, shared by all stages that move a belief."""

import math
from dataclasses import dataclass
from typing import Annotated

from omninav.pipeline import Bounds
from omninav.stages.geometry.plane.odometry_motion import decompose_motion
from omninav.stages.geometry.plane.se2 import wrap_angle
from omninav.stages.values.pose import AssumedMotion, BridgedMotion, Motion, UncertainMotion

FLOOR_RAD, FLOOR_M = 0.001, 0.001
"""Standard deviations of heading (rad) and distance (m) added at each image, also of a stationary robot."""
UNMEASURED_RAD_S, UNMEASURED_M_S = 0.5, 0.5
"""Standard deviations of heading (rad) and distance (m) per second without believed odometry: half a slow turn, and
half of what an indoor robot may make."""


@dataclass(kw_only=True, eq=False)
class OdometryNoiseModel:
    """Noise of a rotation, a translation and a rotation that grows with distance and turn: a mixin, beside `Stage`.

    Variances are proportional to distance and turn, so that many small motions are as uncertain as their sum, whatever
    the camera's rate. Each rotation has sigma^2 = (rotation_per_rotation^2 |turn| + rotation_per_metre^2 distance +
    FLOOR_RAD^2) / 2 (rad^2); the translation has sigma^2 = translation_per_metre^2 distance +
    translation_per_rotation^2 |turn| + FLOOR_M^2 (m^2). Seconds without odometry add
    (UNMEASURED_RAD_S t)^2 / 2 and (UNMEASURED_M_S t)^2, and a guessed motion its own. `turn` is the sum of both
    rotations, so that wheel jitter sideways is no turn.
    """

    rotation_per_rotation: Annotated[float, Bounds(ge=0)] = 0.05
    """Standard deviation (rad) of the heading after a turn by 1 rad."""
    rotation_per_metre: Annotated[float, Bounds(ge=0)] = 0.05
    """Standard deviation (rad) of the heading after 1 m."""
    translation_per_metre: Annotated[float, Bounds(ge=0)] = 0.1
    """Standard deviation (m) of the distance after 1 m."""
    translation_per_rotation: Annotated[float, Bounds(ge=0)] = 0.01
    """Standard deviation (m) of the distance after a turn by 1 rad."""

    def model(self, motion: Motion) -> UncertainMotion:
        """A motion as rotation, translation, rotation, with the standard deviation of each."""
        steps = decompose_motion(motion.x, motion.y, motion.turn)
        more_turn, more_way = 0.0, 0.0
        if isinstance(motion, BridgedMotion):
            more_turn, more_way = (
                UNMEASURED_RAD_S * motion.unmeasured_s,
                UNMEASURED_M_S * motion.unmeasured_s,
            )
        elif isinstance(motion, AssumedMotion):
            more_turn, more_way = motion.sigma_turn, motion.sigma_m
        return UncertainMotion(steps, self.sigmas(steps, more_turn, more_way))

    def sigmas(
        self, steps: tuple[float, float, float], more_turn: float = 0.0, more_way: float = 0.0
    ) -> tuple[float, float, float]:
        """Standard deviations of the first rotation (rad), the translation (m) and the second rotation (rad).

        `more_turn` (rad) and `more_way` (m): standard deviations of what was not measured.
        """
        distance, turn = abs(steps[1]), abs(wrap_angle(steps[0] + steps[2]))
        rotation = math.sqrt(
            0.5 * (self.rotation_per_rotation**2 * turn + self.rotation_per_metre**2 * distance + FLOOR_RAD**2)
            + 0.5 * more_turn**2
        )
        translation = math.sqrt(
            self.translation_per_metre**2 * distance
            + self.translation_per_rotation**2 * turn
            + FLOOR_M**2
            + more_way**2
        )
        return rotation, translation, rotation
