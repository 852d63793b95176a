"""Resamples particles where belief and map agree; tracks both hypotheses where they do not."""

from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.odometry_motion import move_poses
from omninav.stages.geometry.probability.gaussians import density, drawn
from omninav.stages.geometry.probability.particles import systematic
from omninav.stages.values.belief import GaussianMixture, Particles
from omninav.stages.values.pose import UncertainMotion


class ConditionalResampling(Stage):
    """Resamples particles by the map's density where belief and map agree; otherwise tracks both.

    Porta & Kroese 2004, section 3.1. The map's hypothesis is p(y|x), equation 5: a mixture whose weights lambda w are
    normalised to sum 1, so that it is a density over poses in 1/(m^2 rad). The agreement sum_i pi_i p(y|x_i) has the
    same unit.

    * Agreement above `agree_above`: all particles are resampled by pi_i p(y|x_i) and get weight 1/N. This is what the
      paper describes. It is importance resampling (SIR), although the paper cites the auxiliary filter (erratum 15 in
      docs/papers.md).
    * Agreement below: 0.8 of the particles, chosen at random and not by weight (erratum 17a), stay with total weight
      0.8; the others are drawn from the hypothesis by lambda w and share the rest equally (erratum 17).
    * Without a hypothesis the belief stays as it is.
    """

    sampling: Literal["importance", "auxiliary"] = "importance"
    """Resampling where both agree: `auxiliary` is Pitt & Shephard's filter (1999), which needs `before` and `model`."""
    agree_above: Annotated[float, Bounds(ge=0)] = 1e-4
    """Agreement, 1/(m^2 rad), above which both agree; the paper gives 10^-4 without a unit (erratum 14)."""
    outlier_probability: Annotated[float, Bounds(ge=0, le=1)] = 0.0
    """Probability that a view matches one it has nothing to do with; the density becomes (1 - q) p(y|x) + q times the
    agreement, so that one false match does not end a belief. 0 is the paper's filter."""
    keep: Annotated[float, Bounds(ge=0, le=1)] = 0.8
    """Share of the particles that stays where belief and map disagree."""

    class Out(Outputs):
        belief: Particles

    def step(
        self,
        ctx: Context,
        particles: Particles,
        hypothesis: GaussianMixture | None,
        before: Particles | None = None,
        model: UncertainMotion | None = None,
    ) -> Out:
        if hypothesis is None or not len(hypothesis):
            return self.Out(belief=particles)
        shares = hypothesis.weights / hypothesis.weights.sum()
        likelihood = density(particles.poses, hypothesis.means, hypothesis.covariances, shares)
        agreement = float(particles.weights @ likelihood)
        if agreement > self.agree_above:
            ctx.count("agreed")
            if self.sampling == "auxiliary" and before is not None and model is not None:
                chosen = auxiliary_filter(before, model, hypothesis, self.outlier_probability * agreement, ctx.rng)
                if chosen is not None:
                    return self.Out(belief=chosen)
            likelihood = (1.0 - self.outlier_probability) * likelihood + self.outlier_probability * agreement
            rows = systematic(particles.weights * likelihood, len(particles.poses), float(ctx.rng.random()))
            return self.Out(belief=Particles(particles.poses[rows], np.full(len(rows), 1.0 / len(rows))))
        ctx.count("disagreed")
        return self.Out(belief=mix_with_hypothesis(particles, hypothesis, self.keep, ctx.rng))


def mix_with_hypothesis(
    particles: Particles, hypothesis: GaussianMixture, keep: float, rng: np.random.Generator
) -> Particles:
    """The share `keep` of the particles, chosen at random, and draws from the hypothesis for the rest.

    The kept particles have the total weight `keep` and their relative weights; the others share the rest equally.
    """
    number = len(particles.poses)
    kept = np.sort(rng.permutation(number)[: round(keep * number)])
    old = particles.weights[kept]
    drawn_poses = drawn(hypothesis.means, hypothesis.covariances, hypothesis.weights, number - len(kept), rng)
    share = len(kept) / number if old.sum() > 0.0 else 0.0
    weights = np.concatenate(
        [
            old * (share / old.sum()) if share else np.zeros(len(old)),
            np.full(len(drawn_poses), 1.0 / max(1, len(drawn_poses))),
        ]
    )
    weights[len(old) :] *= 1.0 - share
    return Particles(np.concatenate([particles.poses[kept], drawn_poses]), weights / weights.sum())


def auxiliary_filter(
    before: Particles, model: UncertainMotion, hypothesis: GaussianMixture, floor: float, rng: np.random.Generator
) -> Particles | None:
    """Particles after a motion and a view, by Pitt & Shephard's auxiliary filter (1999; erratum 15 in docs/papers.md).

    `before`: the belief before the motion. First stage: particle i is selected by pi_i p(y|mu_i), where mu_i is its
    pose after the motion without noise. The selected particles move with noise. Second stage: they get the weights
    p(y|x) / p(y|mu), so that the view counts once. `floor`, in 1/(m^2 rad), is added to p. None where p is 0 for all.
    """
    number = len(before.poses)
    first_stage = _likelihood(
        move_poses(before.poses, model.steps, model.sigmas, np.zeros((3, number))), hypothesis, floor
    )
    selection = before.weights * first_stage
    if not selection.sum() > 0.0:
        return None
    chosen = systematic(selection, number, float(rng.random()))
    poses = move_poses(before.poses[chosen], model.steps, model.sigmas, rng.standard_normal((3, number)))
    weights = _likelihood(poses, hypothesis, floor) / first_stage[chosen]
    total = float(weights.sum())
    return Particles(poses, weights / total) if total > 0.0 else None


def _likelihood(poses: Array, hypothesis: GaussianMixture, floor: float) -> Array:
    shares = hypothesis.weights / hypothesis.weights.sum()
    return density(poses, hypothesis.means, hypothesis.covariances, shares) + floor
