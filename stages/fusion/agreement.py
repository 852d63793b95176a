"""Keeps particles where belief and map agree; where they do not, follows both."""

from typing import Annotated, Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.probability.gaussians import density, drawn
from omninav.stages.geometry.probability.particles import systematic
from omninav.stages.values.belief import GaussianMixture, Particles
from omninav.stages.values.pose import UncertainMotion

from .auxiliary import auxiliary

Array = npt.NDArray[np.float64]


class Agreement(Stage):
    """Resamples particles by the map's density where the two agree; else tracks both.

    Porta & Kroese 2004, section 3.1. The map's hypothesis is p(y|x), equation 5: a mixture, whose weights, lambda w,
    are made to sum to 1, so that it is a density over poses in 1/(m^2 rad). `agreement`, sum_i pi_i p(y|x_i), is then
    one too; `agree_above` holds for metres and radians (the paper gives 10^-4 without units: erratum 14).

    * Above it: all particles are drawn anew by pi_i p(y|x_i) and weigh 1/N. This is what the paper describes; it is
      importance resampling (SIR, `sampling: importance`), although it cites the auxiliary filter (erratum 15).
      `sampling: auxiliary` is that filter (`fusion/auxiliary.py`); it needs the belief before the motion, and `model`.
    * Below it: the share `keep` of the particles, chosen at random and not by weight (erratum 17a), stays and weighs
      `keep`; the others are drawn from the hypothesis, by lambda w, and weigh the rest, each alike (erratum 17).
    * Without hypothesis the belief stays as it is.

    `stray`: the chance that a view is like one it has nothing to do with. Then it says nothing about the pose, which
    may be any the belief has: the density becomes (1 - stray) p(y|x) + stray sum_i pi_i p(y|x_i), and the belief that
    one look-alike has spoken against is not lost at once. 0 is the paper's filter.
    """

    sampling: Literal["importance", "auxiliary"] = "importance"
    agree_above: Annotated[float, Bounds(ge=0)] = 1e-4
    keep: Annotated[float, Bounds(ge=0, le=1)] = 0.8
    stray: Annotated[float, Bounds(ge=0, le=1)] = 0.0

    class Out(Outputs):
        """The belief after the picture."""

        belief: Particles

    def step(
        self,
        ctx: Context,
        particles: Particles,
        hypothesis: GaussianMixture | None,
        before: Particles | None = None,
        model: UncertainMotion | None = None,
    ) -> Out:
        """Fuse prediction and hypothesis."""
        if hypothesis is None or not len(hypothesis):
            return self.Out(belief=particles)
        shares = hypothesis.weights / hypothesis.weights.sum()
        likelihood = density(particles.poses, hypothesis.means, hypothesis.covariances, shares)
        agreement = float(particles.weights @ likelihood)
        if agreement > self.agree_above:
            ctx.count("agreed")
            if self.sampling == "auxiliary" and before is not None and model is not None:
                chosen = auxiliary(before, model, hypothesis, self.stray * agreement, ctx.rng)
                if chosen is not None:
                    return self.Out(belief=chosen)
            likelihood = (1.0 - self.stray) * likelihood + self.stray * agreement
            rows = systematic(particles.weights * likelihood, len(particles.poses), float(ctx.rng.random()))
            return self.Out(belief=equally(particles.poses[rows]))
        ctx.count("disagreed")
        return self.Out(belief=both(particles, hypothesis, self.keep, ctx.rng))


def equally(poses: Array) -> Particles:
    """Particles that weigh alike."""
    return Particles(poses, np.full(len(poses), 1.0 / len(poses)))


def both(particles: Particles, hypothesis: GaussianMixture, keep: float, rng: np.random.Generator) -> Particles:
    """As many particles: the share `keep` of them, picked at random, and for the rest draws from the hypothesis.

    The kept ones weigh `keep` in all, as they did among themselves; the others the rest, each alike.
    """
    number = len(particles.poses)
    kept = np.sort(rng.permutation(number)[: round(keep * number)])
    old = particles.weights[kept]
    fresh = drawn(hypothesis.means, hypothesis.covariances, hypothesis.weights, number - len(kept), rng)
    share = len(kept) / number if old.sum() > 0.0 else 0.0
    weights = np.concatenate(
        [old * (share / old.sum()) if share else np.zeros(len(old)), np.full(len(fresh), 1.0 / max(1, len(fresh)))]
    )
    weights[len(old) :] *= 1.0 - share
    return Particles(np.concatenate([particles.poses[kept], fresh]), weights / weights.sum())
