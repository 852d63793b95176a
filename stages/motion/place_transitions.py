"""Spreads the belief over places from one image to the next."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.place_graph import links_between
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.topological_map import TopologicalMap

TELEPORT_PROBABILITY = 0.01
"""Probability of being at any place next, so that a robot that was carried is found."""


class PlaceTransitions(Stage):
    """Predicts the place: near ones are more probable than far ones, by a Gaussian over the links between them.

    Goedemé et al. 2007, section 5.2, equation 13: P(x_t | x_t-1) falls as exp(-dist^2 / sigma^2), dist the least number
    of links on the way, 0 where there is no way, normalised for each place that the robot comes from, since places have
    more or fewer neighbours (erratum 32 in docs/papers.md).
    """

    sigma_links: Annotated[float, Bounds(gt=0)] | None = None
    """sigma; null: the standard deviation of dist over the map, as in the paper."""

    class Out(Outputs):
        belief: PlaceBelief

    def setup(self, ctx: Context) -> None:
        self._map: TopologicalMap | None = None
        self._probabilities = np.zeros((0, 0))

    def step(self, ctx: Context, belief: PlaceBelief, map: TopologicalMap) -> Out:
        if self._map is not map:
            self._map = map
            self._probabilities = transitions(
                links_between(map.links, len(map)), self.sigma_links, TELEPORT_PROBABILITY
            )
        return self.Out(belief=PlaceBelief(belief.probabilities @ self._probabilities, belief.poses))


def transitions(links: Array, sigma_links: float | None, teleport_probability: float) -> Array:
    """Probability to go from each place (rows) to each (columns), from the links between them: (P, P)."""
    known = links[np.isfinite(links)]
    sigma = (float(known.std()) if sigma_links is None else sigma_links) or 1.0
    probabilities: Array = np.exp(-np.square(links / sigma))
    probabilities /= probabilities.sum(axis=1, keepdims=True)
    return (1.0 - teleport_probability) * probabilities + teleport_probability / max(len(links), 1)
