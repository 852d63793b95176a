"""How the belief over places spreads from one picture to the next."""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.place_graph import links_between
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.topological_map import TopologicalMap

Array = npt.NDArray[np.float64]


class PlaceTransitions(Stage):
    """A robot goes to a near place rather than to a far one: a Gaussian of the links between them.

    Goedemé et al. 2007, section 5.2, equation 13: P(x_t | x_t-1) falls as exp(-dist^2 / sigma^2), dist the least number
    of links on the way, 0 where there is no way, normalised for each place that the robot comes from, since places have
    more or fewer neighbours (erratum 32). `spread` is sigma in links; null: the standard deviation of dist over the
    map, as in the paper. With a chance of `anywhere` it is at any place next, so that a robot that was carried is
    found.
    """

    spread: Annotated[float, Bounds(gt=0)] | None = None
    anywhere: Annotated[float, Bounds(ge=0, le=1)] = 0.01

    class Out(Outputs):
        """What is believed before the present view is looked at."""

        belief: PlaceBelief

    def setup(self, ctx: Context) -> None:
        """No map yet."""
        self._map: TopologicalMap | None = None
        self._chances = np.zeros((0, 0))

    def step(self, ctx: Context, belief: PlaceBelief, map: TopologicalMap) -> Out:
        """Spread a belief over the places that are near."""
        if self._map is not map:
            self._map = map
            self._chances = transitions(links_between(map.links, len(map)), self.spread, self.anywhere)
        return self.Out(belief=PlaceBelief(belief.probabilities @ self._chances, belief.poses))


def transitions(apart: Array, spread: float | None, anywhere: float) -> Array:
    """From each place (rows) to each (columns) the chance to go there, from the links between them: (P, P)."""
    known = apart[np.isfinite(apart)]
    sigma = (float(known.std()) if spread is None else spread) or 1.0
    chances: Array = np.exp(-np.square(apart / sigma))
    chances /= chances.sum(axis=1, keepdims=True)
    return (1.0 - anywhere) * chances + anywhere / max(len(apart), 1)
