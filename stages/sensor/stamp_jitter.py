"""Jitter of image stamps: the errors that each has by itself, beside a delay that all share."""

from dataclasses import replace

import numpy as np

from omninav.pipeline import Value
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import compose, turned, wrap

JITTERS_S = np.append(0.0, 0.005 * np.sqrt(2.0) ** np.arange(11))
"""Standard deviations of stamps that are held against each other, s."""
ODOMETRY_S = np.array([0.002, 0.004, 0.008, 0.016, 0.032, 0.064, 0.128, 0.256])
"""The same of the time by which an error of odometry makes a motion longer, s: in a path-traced house it is 0.024."""
PRIOR, SHOWN = 0.1, 0.2
"""Probability that stamps jitter, before anything was seen, and that from which on it counts."""
FORGOTTEN = 0.99
"""Factor of the log likelihood of the past at each image."""
MAX_SIGMA_S, MAX_OFF_S = 0.03, 0.5
"""Largest standard deviation of the time that a motion tells, and largest such time, s."""
MAX_TURN, MAX_APART_S = 1.0, 2.0
"""Turn (rad) and time (s) between two images above which no velocity is that of both."""
MIN_SHARE = 0.5
"""Smallest ratio of two consecutive velocities at which a stamp's error changes both motions by as much."""
MAX_SQUARE = 16.0
"""Largest squared residual, in its variance, that counts: beyond, a motion is wrong."""


class StampJitter(Value):
    """Likelihoods of standard deviations of stamps, by consecutive images whose poses were measured one by one.

    `pose` (3,), `covariance` (3, 3): of the last image, NaN where it has none. `velocity` (3,): of the last motion, in
    the map's frame, and `along` (3,), factors by which its error gave a time; NaN where it gave none. `hypotheses`
    (3, J, O): log likelihood, last residual and its variance, by `JITTERS_S` and `ODOMETRY_S`.
    """

    pose: Array
    covariance: Array
    velocity: Array
    along: Array
    hypotheses: Array

    @classmethod
    def unknown(cls) -> "StampJitter":
        """Gives the likelihoods before any image."""
        nothing = np.full(3, np.nan)
        hypotheses = np.zeros((3, len(JITTERS_S), len(ODOMETRY_S)))
        return cls(nothing, np.full((3, 3), np.nan), nothing, nothing, hypotheses)

    def interrupted(self) -> "StampJitter":
        """Gives them after an image without a sure pose."""
        return replace(self, pose=np.full(3, np.nan), along=np.full(3, np.nan))

    def seen(self, pose: Array, covariance: Array, moved: Array, seconds: float) -> "StampJitter":
        """Gives them after an image with `pose` (3,) and `covariance` (3, 3); `moved` (3,): by odometry since the last.

        The error of a motion, over its velocity, is the difference of two stamps' errors. So consecutive motions share
        one of them with opposite signs, as they share the error of a pose, whose covariance is known, and none of
        odometry. Their likelihood is that of a Gaussian sequence in which neighbours are correlated.
        """
        new = replace(self, pose=pose, covariance=covariance, along=np.full(3, np.nan))
        if np.isnan(self.pose[0]) or abs(moved[2]) > MAX_TURN or seconds > MAX_APART_S:
            return new
        missed = pose - compose(self.pose, moved)
        missed[2] = wrap(missed[2])
        velocity = turned(moved / seconds, pose[2] - 0.5 * moved[2])
        weighted = np.linalg.solve(covariance + self.covariance, velocity)
        information = float(weighted @ velocity)
        if information < MAX_SIGMA_S**-2:
            return new
        along = np.asarray(weighted / information)
        time = float(along @ missed)
        if abs(time) > MAX_OFF_S:
            return new
        jitter, odometry = np.square(JITTERS_S)[:, None], np.square(ODOMETRY_S)
        past, residual, spread = self.hypotheses
        variance = 1.0 / information + odometry + 2.0 * jitter
        off = np.full(variance.shape, time)
        if not np.isnan(self.along[0]):
            if not MIN_SHARE < along @ self.velocity < 1.0 / MIN_SHARE:
                return new
            gain = -(jitter + along @ self.covariance @ self.along) / spread
            variance = variance - gain**2 * spread
            off = off - gain * residual
        likelihood = FORGOTTEN * past - 0.5 * (np.log(variance) + np.minimum(off**2 / variance, MAX_SQUARE))
        return replace(new, velocity=velocity, along=along, hypotheses=np.stack([likelihood, off, variance]))

    def variance(self) -> float:
        """Expected variance of a stamp's error, s²; 0 as long as it is not `SHOWN`."""
        shares = self._shares()
        return float(shares @ np.square(JITTERS_S)) if shares[0] < 1.0 - SHOWN else 0.0

    def probability(self) -> float:
        """Probability that stamps jitter."""
        return 1.0 - float(self._shares()[0])

    def _shares(self) -> Array:
        # The probabilities of JITTERS_S: (J,).
        likelihood = self.hypotheses[0]
        shares = np.exp(likelihood - likelihood.max()).sum(axis=1)
        shares[0] *= 1.0 - PRIOR
        shares[1:] *= PRIOR / (len(JITTERS_S) - 1)
        return np.asarray(shares / shares.sum())
