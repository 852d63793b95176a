"""Moves particles by odometry: turn, go, turn, each with its own noise."""

import math
from typing import Annotated

import numba
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.se2 import wrap
from omninav.stages.values.belief import Particles
from omninav.stages.values.pose import Motion

Array = npt.NDArray[np.float64]


def turn_go_turn(x: float, y: float, turn: float) -> tuple[float, float, float]:
    """A motion as a turn towards its goal, a way along it (negative: backwards), and the rest of the turn.

    Going backwards is kept as such, so that the first turn stays within 90 degrees.
    """
    way = math.hypot(x, y)
    if way < 1e-9:
        return 0.0, 0.0, turn
    first = math.atan2(y, x)
    if abs(first) > math.pi / 2:
        first, way = float(wrap(first + math.pi)), -way
    return first, way, float(wrap(turn - first))


@numba.njit(cache=True, nogil=True)
def moved(poses: Array, motion: tuple[float, float, float], sigmas: tuple[float, float, float], noise: Array) -> Array:
    """Poses (N, 3) after turn, way, turn, with `noise` (3, N) of unit variance scaled by `sigmas`."""
    out = np.empty_like(poses)
    for n in range(len(poses)):
        first = poses[n, 2] + motion[0] + sigmas[0] * noise[0, n]
        way = motion[1] + sigmas[1] * noise[1, n]
        last = first + motion[2] + sigmas[2] * noise[2, n]
        out[n, 0] = poses[n, 0] + way * np.cos(first)
        out[n, 1] = poses[n, 1] + way * np.sin(first)
        out[n, 2] = last - 2 * np.pi * np.floor((last + np.pi) / (2 * np.pi))
    return out


class RotationTranslationRotation(Stage):
    """Samples the motion model: turn, go, turn, with noise that grows with the way and with the turn.

    Variances grow with the way and the turn, so that many small motions are as uncertain as the one they make up,
    whatever the camera's rate: each turn has sigma^2 = (rotation_per_rotation^2 |turn| + rotation_per_metre^2 way) / 2
    + rotation_floor^2 / 2 (rad^2), the way sigma^2 = translation_per_metre^2 way + translation_per_rotation^2 |turn| +
    translation_floor^2 (m^2). The parameters are the standard deviations after 1 m or 1 rad: rad, rad, m, m; the floors
    hold per picture, also for a robot that stands. `turn` is the whole turn: a jitter of the wheels sideways
    is no turn. Without motion (the first picture of a log) the belief stays as it is.
    """

    rotation_per_rotation: Annotated[float, Bounds(ge=0)] = 0.05
    rotation_per_metre: Annotated[float, Bounds(ge=0)] = 0.05
    translation_per_metre: Annotated[float, Bounds(ge=0)] = 0.1
    translation_per_rotation: Annotated[float, Bounds(ge=0)] = 0.01
    rotation_floor: Annotated[float, Bounds(ge=0)] = 0.001
    translation_floor: Annotated[float, Bounds(ge=0)] = 0.001

    class Out(Outputs):
        """The belief after the motion, before the picture is looked at."""

        belief: Particles

    def step(self, ctx: Context, belief: Particles, motion: Motion | None) -> Out:
        """Move all particles."""
        if motion is None:
            return self.Out(belief=belief)
        way = turn_go_turn(motion.x, motion.y, motion.turn)
        noise = ctx.rng.standard_normal((3, len(belief.poses)))
        poses = moved(belief.poses, way, self.sigmas(way), noise)
        return self.Out(belief=Particles(poses, belief.weights, belief.aside))

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
