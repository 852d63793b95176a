"""How well each place of a topological map explains the view."""

from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.belief import Likelihood
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.visual_distance import VisualDistances

Array = npt.NDArray[np.float64]


class PlaceLikelihood(Stage):
    """A falling function of the visual distance between the present view and each place's.

    Goedemé et al. 2007, section 5.3, equation 14, with `tail: gaussian`: P(z | x) falls as exp(-diss^2 / sigma^2).
    `spread` is sigma; null: the standard deviation of visual distance that the map was measured to have within its
    places. No place is less likely than `least` times one that looks the same: views are blocked, and one that shows
    nothing known says nothing.

    `tail: heavy` is 1 / (1 + diss^2 / sigma^2) instead. Beside the way of the tour, or where things have changed, every
    distance is many sigma, and by a Gaussian all are as unlikely as what has nothing in common; yet the place with the
    least of them is the right one.
    """

    spread: Annotated[float, Bounds(gt=0)] | None = None
    least: Annotated[float, Bounds(gt=0, le=1)] = 0.001
    tail: Literal["gaussian", "heavy"] = "heavy"

    class Out(Outputs):
        """One value per place."""

        likelihood: Likelihood

    def step(self, ctx: Context, distances: VisualDistances, map: TopologicalMap) -> Out:
        """Weigh all places."""
        sigma = map.spread if self.spread is None else self.spread
        values = place_likelihoods(distances.distances, sigma, self.least, self.tail)
        return self.Out(likelihood=Likelihood(values))


def place_likelihoods(distances: Array, sigma: float, least: float, tail: Literal["gaussian", "heavy"]) -> Array:
    """Of visual distances (P,), inf for nothing in common, lifted to [least, 1]: exp(-(d / sigma)^2), or as `tail`."""
    squares = np.square(distances / max(sigma, 1e-9))
    return least + (1.0 - least) * (np.exp(-squares) if tail == "gaussian" else 1.0 / (1.0 + squares))
