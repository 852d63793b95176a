"""The first belief of a log where the map is learned during the drive."""

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.geometry.probability.gaussians import drawn, floored, moments
from omninav.stages.values.belief import GaussianMixture, Particles
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.pose import Pose
from omninav.stages.values.view_mixtures import ViewMixtures

from .first_pose import Where, first_pose, particles_around

INITIAL_SIGMA_M, INITIAL_SIGMA_DEG = 0.01, 0.5
"""Standard deviations of the pose at which a map is begun; 0.1 m and 0.1 rad where there is a map."""


@dataclass(kw_only=True, eq=False)
class GrowingPrior:
    """The first pose of a log: known while the map is empty, uniform over the map later. A mixin, beside `Stage`.

    All poses are relative to the pose at which a map is begun (Porta & Kroese 2004, section 3). Raises BadInput where
    `at` is `truth` and the log has no true pose.
    """

    at: Where = "uniform"
    """First pose: `uniform` (with an empty map the log's first true pose, else the origin; later anywhere in the map),
    `truth`, `origin`, or [x, y, heading, sigma_xy, sigma_heading] (m, rad)."""

    def known(
        self, map: ViewMixtures, truth: Pose | None, restart: Reinitialise | None = None
    ) -> tuple[Array, Array] | None:
        """The pose (3,) and its standard deviations (3,), or None where the belief is uniform over the map."""
        at = self.at if restart is None else restart.at or "uniform"
        if at == "uniform":
            if len(map):
                return None
            at = "origin" if truth is None else "truth"
        sigmas = (0.1, 0.1) if len(map) else (INITIAL_SIGMA_M, float(np.radians(INITIAL_SIGMA_DEG)))
        return first_pose(at, truth, sigmas)


class ParticlesInMap(GrowingPrior, Stage):
    """Draws the first particles of a log: around a known pose, or from the map with uniform headings.

    Positions are drawn from the components of all views by their weights: in a fused map all views count equally, in an
    adaptive one by their weights. Porta & Kroese 2004, section 3.
    """

    number: Annotated[int, Bounds(ge=1)] = 1000
    """Particles."""

    class Out(Outputs):
        """The belief to begin with; absent at all later images."""

        belief: Particles | None = None

    def step(self, ctx: Context, map: ViewMixtures, truth: Pose | None, restart: Reinitialise | None = None) -> Out:
        """Give the first belief, also where a running robot is to start again (`restart`)."""
        if not ctx.tick.first_of_log and restart is None:
            return self.Out()
        known = self.known(map, truth, restart)
        if known is not None:
            return self.Out(belief=particles_around(*known, self.number, ctx.rng))
        poses = drawn(map.means, map.covariances, map.weights, self.number, ctx.rng)
        poses[:, 2] = ctx.rng.uniform(-np.pi, np.pi, self.number)
        return self.Out(belief=Particles(poses, np.full(self.number, 1.0 / self.number)))


class MixtureInMap(GrowingPrior, Stage):
    """Gives the first Gaussian of a log: at a known pose, or with the map's moments and an unknown heading.

    Mean and covariance of x, y are those of the components of all views; the heading has the standard deviation of a
    uniform distribution, pi / sqrt(3).
    """

    class Out(Outputs):
        """The belief to begin with; absent at all later images."""

        belief: GaussianMixture | None = None

    def step(self, ctx: Context, map: ViewMixtures, truth: Pose | None, restart: Reinitialise | None = None) -> Out:
        """Give the first belief, also where a running robot is to start again (`restart`)."""
        if not ctx.tick.first_of_log and restart is None:
            return self.Out()
        known = self.known(map, truth, restart)
        if known is None:
            mean, covariance, _ = moments(map.means, map.covariances, map.weights)
            covariance[2, :2] = covariance[:2, 2] = 0.0
            covariance[2, 2] = np.pi**2 / 3.0
        else:
            mean, covariance = known[0].copy(), np.diag(known[1] ** 2)
            mean[2] = wrap(mean[2])
        covariance = floored(covariance, (INITIAL_SIGMA_M, INITIAL_SIGMA_M, float(np.radians(INITIAL_SIGMA_DEG))))
        return self.Out(belief=GaussianMixture(mean[None], covariance[None], np.ones(1)))
