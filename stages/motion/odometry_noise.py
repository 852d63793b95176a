"""How uncertain a motion by odometry is: what all stages that move a belief have in common."""

import math
from dataclasses import dataclass
from typing import Annotated

from omninav.pipeline import Bounds
from omninav.stages.geometry.plane.odometry_motion import turn_go_turn
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.pose import Motion, UncertainMotion


@dataclass(kw_only=True, eq=False)
class OdometryNoise:
    """Noise of a turn, a way and a turn that grows with the way and with the turn: a mixin, beside `Stage`.

    Variances grow with the way and the turn, so that many small motions are as uncertain as the one they make up,
    whatever the camera's rate: each turn has sigma^2 = (rotation_per_rotation^2 |turn| + rotation_per_metre^2 way) / 2
    + rotation_floor^2 / 2 (rad^2), the way sigma^2 = translation_per_metre^2 way + translation_per_rotation^2 |turn| +
    translation_floor^2 (m^2). The parameters are the standard deviations after 1 m or 1 rad: rad, rad, m, m; the floors
    hold per picture, also for a robot that stands. `turn` is the whole turn: a jitter of the wheels sideways
    is no turn.
    """

    rotation_per_rotation: Annotated[float, Bounds(ge=0)] = 0.05
    rotation_per_metre: Annotated[float, Bounds(ge=0)] = 0.05
    translation_per_metre: Annotated[float, Bounds(ge=0)] = 0.1
    translation_per_rotation: Annotated[float, Bounds(ge=0)] = 0.01
    rotation_floor: Annotated[float, Bounds(ge=0)] = 0.001
    translation_floor: Annotated[float, Bounds(ge=0)] = 0.001

    def model(self, motion: Motion) -> UncertainMotion:
        """A motion as turn, way, turn, with the standard deviation of each."""
        way = turn_go_turn(motion.x, motion.y, motion.turn)
        return UncertainMotion(way, self.sigmas(way))

    def sigmas(self, way: tuple[float, float, float]) -> tuple[float, float, float]:
        """Standard deviations of first turn (rad), way (m), second turn (rad)."""
        distance, turn = abs(way[1]), abs(float(wrap(way[0] + way[2])))
        rotation = math.sqrt(
            0.5
            * (self.rotation_per_rotation**2 * turn + self.rotation_per_metre**2 * distance + self.rotation_floor**2)
        )
        translation = math.sqrt(
            self.translation_per_metre**2 * distance
            + self.translation_per_rotation**2 * turn
            + self.translation_floor**2
        )
        return rotation, translation, rotation
