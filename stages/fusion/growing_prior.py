"""The first belief of a log where the map is learned on the way."""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.gaussians import drawn, floored, moments
from omninav.stages.values.belief import GaussianMixture, Particles
from omninav.stages.values.pose import Pose
from omninav.stages.values.view_mixtures import ViewMixtures

Array = npt.NDArray[np.float64]
Where = Literal["uniform", "truth", "origin"] | tuple[float, float, float, float, float]


@dataclass(kw_only=True, eq=False)
class GrowingPrior:
    """Where a log begins, at a known pose while the map is empty, anywhere in the map later: a mixin, beside `Stage`.

    All localisation is with respect to the pose at which a map is begun (Porta & Kroese 2004, section 3): with an empty
    map, `uniform` means the log's first true pose where it has one, else the origin, and that pose is certain to
    `begun_m` and `begun_deg`. With views in the map, `uniform` means anywhere that views were seen from. `truth`,
    `origin`, and x, y, heading with the standard deviations of position and heading (m, m, rad, m, rad) hold for every
    log; the first two with 0.1 m and 0.1 rad where there is a map. Raises BadInput where `truth` finds none.
    """

    at: Where = "uniform"
    begun_m: Annotated[float, Bounds(gt=0)] = 0.01
    begun_deg: Annotated[float, Bounds(gt=0)] = 0.5

    def known(self, map: ViewMixtures, truth: Pose | None) -> tuple[Array, Array] | None:
        """The pose (3,) and its standard deviations (3,), or None where the log may begin anywhere in the map."""
        at = self.at
        if at == "uniform":
            if len(map):
                return None
            at = "origin" if truth is None else "truth"
        metres, radians = (0.1, 0.1) if len(map) else (self.begun_m, float(np.radians(self.begun_deg)))
        if at == "origin":
            return np.zeros(3), np.array([metres, metres, radians])
        if at == "truth":
            if truth is None:
                raise BadInput("start: this log has no true pose at its first picture; use start=uniform")
            return np.array([truth.x, truth.y, truth.heading]), np.array([metres, metres, radians])
        return np.array(at[:3]), np.array([at[3], at[3], at[4]])


class ParticlesInMap(GrowingPrior, Stage):
    """The first particles of a log: around a known pose, or drawn from the map so far with any heading.

    With an empty map `start=uniform` begins at the log's first true pose, else at the origin (Porta & Kroese 2004,
    section 3). With views in it, particles are drawn from the places of all views by their weights, and their
    headings evenly. So in a fused map all views count alike, and in one that adapts those more that it trusts more.
    """

    number: Annotated[int, Bounds(ge=1)] = 1000

    class Out(Outputs):
        """The belief to begin with; absent at all later pictures."""

        belief: Particles | None = None

    def step(self, ctx: Context, map: ViewMixtures, truth: Pose | None) -> Out:
        """Give the first belief."""
        if not ctx.tick.first_of_log:
            return self.Out()
        known = self.known(map, truth)
        if known is None:
            poses = drawn(map.means, map.covariances, map.weights, self.number, ctx.rng)
            poses[:, 2] = ctx.rng.uniform(-np.pi, np.pi, self.number)
        else:
            poses = known[0] + ctx.rng.standard_normal((self.number, 3)) * known[1]
            poses[:, 2] = wrap(poses[:, 2])
        return self.Out(belief=Particles(poses, np.full(self.number, 1.0 / self.number)))


class MixtureInMap(GrowingPrior, Stage):
    """The first Gaussian of a log: a known pose, or one as wide as the map so far, with any heading.

    With an empty map `start=uniform` begins at the log's first true pose, else at the origin (Porta & Kroese 2004,
    section 3). With views in it, it is the Gaussian with the x, y moments of the places of all views; a heading of
    which nothing is known has the standard deviation of an even distribution, pi / sqrt(3).
    """

    class Out(Outputs):
        """The belief to begin with; absent at all later pictures."""

        belief: GaussianMixture | None = None

    def step(self, ctx: Context, map: ViewMixtures, truth: Pose | None) -> Out:
        """Give the first belief."""
        if not ctx.tick.first_of_log:
            return self.Out()
        known = self.known(map, truth)
        if known is None:
            mean, covariance, _ = moments(map.means, map.covariances, map.weights)
            covariance = floored(covariance, (self.begun_m, self.begun_m, float(np.radians(self.begun_deg))))
            covariance[2, :2] = covariance[:2, 2] = 0.0
            covariance[2, 2] = np.pi**2 / 3.0
        else:
            mean, covariance = known[0].copy(), np.diag(known[1] ** 2)
            mean[2] = wrap(mean[2])
        return self.Out(belief=GaussianMixture(mean[None], covariance[None], np.ones(1)))
