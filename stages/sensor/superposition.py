"""Where the present view may be seen from, by what the map knows of the views that look like it."""

from typing import Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.belief import GaussianMixture
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Neighbours, NoveltyThreshold

Array = npt.NDArray[np.float64]


def superposed(
    rows: npt.NDArray[np.int64], shares: Array, turns: Array, ways: Array, map: ViewMixtures
) -> tuple[Array, Array, Array]:
    """The mixtures of a map's views `rows` (J,), weighted by `shares` (J,), turned by `turns` (J,) rad.

    Returns means, covariances and weights of the components that weigh anything, in the order of the map. The turn is
    added to the headings; it leaves the covariances as they are (erratum 12). `ways` (J,) m: standard
    deviations by which each view's components are widened in x and y.
    """
    place = np.full(len(map), -1, np.int64)
    place[rows] = np.arange(len(rows))
    of_row = place[map.owner]
    chosen = np.flatnonzero(of_row >= 0)
    weights = shares[of_row[chosen]] * map.weights[chosen]
    chosen, weights = chosen[weights > 0.0], weights[weights > 0.0]
    means = map.means[chosen]
    means[:, 2] = wrap(means[:, 2] + turns[of_row[chosen]])
    covariances = map.covariances[chosen]
    covariances[:, [0, 1], [0, 1]] += (ways[of_row[chosen]] ** 2)[:, None]
    return means, covariances, weights


class Superposition(Stage):
    """Superposes the mixtures of the map's views near the present one, by how alike they are.

    p(x|y) is the sum over views j and components k of lambda_j w_jk times a Gaussian (Porta & Kroese 2004, equation 5;
    Gross, Koenig & Mueller 2005, section 2.2). `views`: all near ones, or the nearest alone (the crisp 1-of-N mapping).
    `normalise`: lambda_j = S_j / sum S, so that equation 5 is a density in 1/(m^2 rad) that can be compared with one in
    these units (erratum 14); without, lambda_j = S_j as Gross, Koenig & Mueller have it, and many near views weigh more
    than one. The components' own weights w_jk are not normalised (erratum 13). Headings are turned by how far the robot
    stands turned from its heading in each view (erratum 12). Components without weight (just inserted) say nothing.
    Absent where no view is near.

    `extent`: a view looks alike over some way, so that who sees it need not stand where it was learned. Its components
    are widened in x and y by the way over which views of this drive come to differ as much as these two do, as a
    standard deviation (port `limit`: its metres, for a view at the limit). Neither paper has it; without, a view that
    was learned once, at a state known well, pulls a robot metres away to that very place.
    """

    views: Literal["all", "nearest"] = "all"
    normalise: bool = False
    extent: bool = False

    class Out(Outputs):
        """Poses from which the view may be seen; weights need not sum to 1."""

        hypothesis: GaussianMixture | None = None

    def step(
        self, ctx: Context, neighbours: Neighbours | None, map: ViewMixtures, threshold: NoveltyThreshold | None = None
    ) -> Out:
        """Superpose what is near."""
        if neighbours is None or not len(neighbours.rows):
            return self.Out()
        number = 1 if self.views == "nearest" else len(neighbours.rows)
        shares = neighbours.similarities[:number]
        if self.normalise:
            total = float(shares.sum())
            shares = shares / total if total > 0.0 else np.full(number, 1.0 / number)
        rows = neighbours.rows[:number]
        ways = np.zeros(number)
        if self.extent and threshold is not None and threshold.distance > 0.0:
            ways = neighbours.distances[:number] / threshold.distance * threshold.metres
        means, covariances, weights = superposed(rows, shares, neighbours.turns[:number], ways, map)
        return self.Out(hypothesis=GaussianMixture(means, covariances, weights) if len(weights) else None)
