"""Odometry made worse on purpose, in levels."""

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
"""Noise from none to that of figure 18. The paper prints only <10, 5, 5> and <20, 20, 20>: the others are ours."""


class NoisyOdometry(Stage):
    """Adds noise to each increment of motion: rotation, translation, rotation, as strong as one of nine levels.

    Wolf, Burgard & Burkhardt 2005, section VI-D, figures 16 to 19; erratum 46a: units are our reading, see `add_odometry_noise`.
    Each of `levels` is <way in mm per sqrt(m), turn in degrees per sqrt(360 degrees), turn in degrees per sqrt(m)>.
    Raises ValueError where there is no such level.
    """

    level: Annotated[int, Bounds(ge=0)] = 4
    levels: tuple[Triple, ...] = LEVELS

    class Out(Outputs):
        motion: Motion

    def __post_init__(self) -> None:
        """Refuse a level that is not there."""
        if self.level >= len(self.levels):
            raise ValueError(f"there is no level {self.level}; the levels are 0 to {len(self.levels) - 1}")

    def step(self, ctx: Context, motion: Motion) -> Out:
        """One increment."""
        increment = [[motion.x, motion.y, motion.turn]]
        row = add_odometry_noise(increment, self.levels[self.level], ctx.rng.normal(size=(1, 3)))[0]
        return self.Out(motion=Motion(*(float(value) for value in row)))
