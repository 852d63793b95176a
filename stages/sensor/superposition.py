"""Poses from which the current view may be seen, from the map's similar views."""

from typing import Literal

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours, NoveltyThreshold


class Superposition(Stage):
    """Adds up the mixtures of the map's views that resemble the current one, weighted by similarity.

    p(x|y) is the sum over views j and components k of lambda_j w_jk times a Gaussian (Porta & Kroese 2004, equation 5;
    Gross, Koenig & Mueller 2005, section 2.2). Neither the components' own weights w_jk (erratum 13) nor lambda_j = S_j
    are normalised: many similar views weigh more than one. Headings are turned by the robot's turn against its heading
    in each view, and covariances stay as they are (erratum 12). Components without weight (just inserted) do not count.
    Absent where no view is similar.
    """

    views: Literal["all", "nearest"] = "all"
    """All similar views, or the nearest only (the crisp 1-of-N mapping)."""
    extent: bool = False
    """Widen each view's components in x and y by the distance over which views of this drive come to differ as much
    (from the novelty threshold's metres), since a view looks similar over some distance. Neither paper has it; without,
    a view learned once, at a well-known pose, pulls a robot metres away to that pose."""

    class Out(Outputs):
        """Poses from which the view may be seen; weights need not sum to 1."""

        hypothesis: GaussianMixture | None = None

    def step(
        self, ctx: Context, neighbours: Neighbours | None, map: ViewMixtures, threshold: NoveltyThreshold | None = None
    ) -> Out:
        if neighbours is None or not len(neighbours.rows):
            return self.Out()
        number = 1 if self.views == "nearest" else len(neighbours.rows)
        place = np.full(len(map), -1, np.int64)
        place[neighbours.rows[:number]] = np.arange(number)
        of_row = place[map.owner]
        chosen = np.flatnonzero(of_row >= 0)
        weights = neighbours.similarities[of_row[chosen]] * map.weights[chosen]
        chosen, weights = chosen[weights > 0.0], weights[weights > 0.0]
        means, covariances = map.means[chosen], map.covariances[chosen]
        means[:, 2] = wrap(means[:, 2] + neighbours.turns[of_row[chosen]])
        if self.extent and threshold is not None and threshold.distance > 0.0:
            extents = neighbours.distances / threshold.distance * threshold.metres
            covariances[:, [0, 1], [0, 1]] += (extents[of_row[chosen]] ** 2)[:, None]
        return self.Out(hypothesis=GaussianMixture(means, covariances, weights) if len(weights) else None)
