"""Keeps the last view, to which the next one is compared."""

from collections.abc import Callable

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, State

Floats = npt.NDArray[np.float32]


class LastView(State):
    """The features (segments, bins) of the image before; None at the first of a log."""

    values: Floats | None = None

    def similarity(self, ctx: Context, values: Floats, compare: Callable[[Floats], Floats]) -> float | None:
        """Similarity of a view to the one before, at the best heading, which it then takes the place of.

        `compare`: similarities of the view to a map (1, segments, bins) of that one alone.
        """
        before = None if ctx.tick.first_of_log else self.values
        self.values = values
        return None if before is None else float(compare(before[None]).max())
