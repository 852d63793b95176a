"""Keeps the last view, to which the next one is compared."""

from collections.abc import Callable

from omninav.pipeline import Context, State
from omninav.stages.geometry.arrays import Floats


class LastView(State):
    """The features (segments, bins) of the last view and the tick they are of; None before the first.

    `stages/geometry/landmarks/unbroken_view.py` compares two images by their local features.
    """

    values: Floats | None = None
    index: int = -1

    def similarity(self, ctx: Context, values: Floats, compare: Callable[[Floats], Floats]) -> float | None:
        """Gives the similarity of a view to the one before, at the best heading, and keeps the view in its place.

        `compare`: similarities of the view to another one. None where the tick before had no view, or was of another
        log, and of a view that is not divided around the robot, which changes as the robot turns.
        """
        follows = ctx.tick.index == self.index + 1 and not ctx.tick.first_of_log
        before, self.values, self.index = self.values if follows else None, values, ctx.tick.index
        if before is None or before.shape != values.shape or len(values) < 2:
            return None
        return float(compare(before).max())
