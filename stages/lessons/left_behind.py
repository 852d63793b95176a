"""A view is learned from when the robot has left it behind."""

import math
from dataclasses import field
from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.lesson import Lesson, Lessons
from omninav.stages.values.pose import UncertainMotion
from omninav.stages.values.views import WholeView


class Behind(State):
    """Lessons that wait, and how far the robot had driven when it saw each (m)."""

    lessons: list[Lesson] = field(default_factory=list)
    seen_at: list[float] = field(default_factory=list)
    driven: float = 0.0


class LeftBehind(Stage):
    """Each view waits, with the state it was seen in, until the robot has driven on for `metres`.

    A view that is learned at once tells the robot, one picture later, what it has just told the map: the map seems to
    confirm the belief, and holds the robot back at where it was (docs/experiments/cml_defaults.md). Gross, Koenig &
    Mueller 2005, section 2.1, delay by a short queue for the same reason; how far its length in pictures takes the
    robot depends on the camera's rate. States of any number of modes are learned. `longest`: no more views than these
    wait, however long the robot stands. What waits when a log ends is learned as the next one begins.
    """

    metres: Annotated[float, Bounds(ge=0)] = 4.0
    longest: Annotated[int, Bounds(ge=0)] = 500

    class Out(Outputs):
        """What has been left behind, in the order in which it was seen."""

        lessons: Lessons

    def step(
        self, ctx: Context, view: WholeView, state: GaussianMixture, model: UncertainMotion | None, behind: Behind
    ) -> Out:
        """Take one view in, and give out those that are left behind."""
        behind.driven += 0.0 if model is None else math.fabs(model.way[1])
        if len(state):
            behind.lessons.append(Lesson(view, state, ctx.tick.index))
            behind.seen_at.append(behind.driven)
        due = sum(1 for at in behind.seen_at if at <= behind.driven - self.metres)
        due = max(due, len(behind.lessons) - self.longest)
        if ctx.tick.first_of_log:
            due = max(due, sum(1 for lesson in behind.lessons if lesson.index < ctx.tick.index))
        ready, behind.lessons, behind.seen_at = behind.lessons[:due], behind.lessons[due:], behind.seen_at[due:]
        return self.Out(lessons=Lessons(tuple(ready)))
