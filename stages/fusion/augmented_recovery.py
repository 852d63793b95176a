"""Injects random particles when the belief explains the images less well than it used to."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.values.belief import Likelihood, Particles

from .uniform_recovery import resampled, weighed

SLOW, FAST = 0.01, 0.1
"""Weights of an image in the long average, alpha_slow, and in the short one, alpha_fast."""


class AugmentedRecoveryState(State):
    """Long and short average of how well the belief explains the images of a log, and their number."""

    slow: float = 0.0
    fast: float = 0.0
    images: int = 0


class AugmentedRecovery(Stage):
    """Augmented MCL: resamples at every image, and replaces particles where the likelihood has fallen.

    Thrun, Burgard & Fox 2005, Probabilistic Robotics, table 8.3: the share max(0, 1 - w_fast / w_slow) of the particles
    is drawn from the `proposals`; w_slow and w_fast are a long and a short exponential average of the mean likelihood
    w_avg. The book has uniform proposals; with `proposals=similarity` they are poses that the image suggests. Its w_avg
    compares images only where a likelihood is absolute: here it is w / (w + m), with w the mean likelihood of the
    particles and m that of all poses of the map, the probability that belief rather than chance explains the image,
    new or not.
    """

    number: Annotated[int, Bounds(ge=1)] = 5000
    """Particles."""

    class Out(Outputs):
        """The belief after the image."""

        belief: Particles

    def step(
        self,
        ctx: Context,
        particles: Particles,
        likelihood: Likelihood,
        proposals: Particles | None,
        averages: AugmentedRecoveryState,
    ) -> Out:
        """Fuse prediction and observation."""
        explained = probability_explained(particles, likelihood)
        averages.images = 1 if ctx.tick.first_of_log else averages.images + 1
        equal = 1.0 / averages.images  # plain means at first: a belief all over the map explains unusually little
        averages.slow += max(SLOW, equal) * (explained - averages.slow)
        averages.fast += max(FAST, equal) * (explained - averages.fast)
        share = max(0.0, 1.0 - averages.fast / averages.slow) if averages.slow > 0.0 else 0.0
        wanted = 0 if proposals is None else int(share * self.number)
        poses = resampled(ctx, particles, weighed(ctx, particles, likelihood), self.number, wanted, proposals)
        return self.Out(belief=Particles(poses, np.full(self.number, 1.0 / self.number)))


def probability_explained(particles: Particles, likelihood: Likelihood) -> float:
    """The probability that the belief rather than chance explains an image, both being as likely before: in [0, 1]."""
    values = likelihood.values
    if likelihood.mean_likelihood is None or not values.size:
        return 1.0
    full = np.power(values, 1.0 / max(likelihood.novelty, 1e-3))
    mean = float(np.average(full, weights=particles.weights))
    total = mean + likelihood.mean_likelihood
    return mean / total if math.isfinite(total) and total > 0.0 else 1.0
