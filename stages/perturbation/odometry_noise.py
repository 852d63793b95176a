"""Adds noise to the odometry, in nine levels."""

from dataclasses import replace
from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.plane.odometry_noise import Triple, add_odometry_noise
from omninav.stages.values.pose import Motion

LEVELS: tuple[Triple, ...] = (
    (0.0, 0.0, 0.0),
    (2.0, 1.0, 1.0),
    (5.0, 2.0, 2.0),
    (5.0, 5.0, 5.0),
    (10.0, 5.0, 5.0),
    (10.0, 10.0, 10.0),
    (15.0, 10.0, 10.0),
    (15.0, 15.0, 15.0),
    (20.0, 20.0, 20.0),
)
"""Noise levels up to that of figure 18. The paper prints only <10, 5, 5> and <20, 20, 20>; the others are ours."""


class NoisyOdometry(Stage):
    """Adds noise to each increment of motion: rotation, translation, rotation.

    Wolf, Burgard & Burkhardt 2005, section VI-D, figures 16 to 19. Erratum 46a in docs/papers.md: the paper gives no
    units; ours are those of `add_odometry_noise`. A simulated world takes a triple as `world.odometry.added=[10,5,5]`.
    Raises ValueError where `level` is not one of `levels`.
    """

    level: Annotated[int, Bounds(ge=0)] = 4
    """Which of `levels`, from 0, no noise."""
    levels: tuple[Triple, ...] = LEVELS
    """Standard deviations: distance (mm per sqrt(m)), turn (deg per sqrt(360 deg)), turn (deg per sqrt(m))."""

    class Out(Outputs):
        motion: Motion

    def __post_init__(self) -> None:
        """Refuse an unknown level."""
        if self.level >= len(self.levels):
            raise ValueError(f"there is no level {self.level}; the levels are 0 to {len(self.levels) - 1}")

    def step(self, ctx: Context, motion: Motion) -> Out:
        increment = [[motion.x, motion.y, motion.turn]]
        row = add_odometry_noise(increment, self.levels[self.level], ctx.rng.normal(size=(1, 3)))[0]
        x, y, turn = (float(value) for value in row)
        return self.Out(motion=replace(motion, x=x, y=y, turn=turn))
