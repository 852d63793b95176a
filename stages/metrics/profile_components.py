"""Variance of column segments' profiles that a few cosine coefficients keep, beside as many principal components."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Metrics, MetricSpec, MetricStage
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.local_features import VerticalSegments

COLOURS = 3
"""Entries of a segment's descriptor before its profile's coefficients."""
SPECS = {
    "profiles.least_ratio": MetricSpec(
        title="Least variance kept by cosines, of what principal components keep", better="higher"
    )
}


class ProfileComponents(MetricStage):
    """Measures how close a cosine transform comes to principal components on the profiles of column segments.

    Goedemé et al. 2007, section 3.3: "the best features to use" are principal components, which the cosine transform
    approximates without knowing the data. Components are fitted on the segments of the first half of the images, and
    both are measured on those of the second: under `profiles`, of the variance about the first half's mean the shares
    that the first 1 to 6 of 7 coefficients keep (`cosine`), and as many components (`principal`); `least_ratio`, the
    least of the six ratios of the two. A descriptor's seven coefficients are orthonormal and lack but the finest of a
    profile of eight points, so that its components follow from them. Gives nothing where either half shows no two
    segments, or the second none that varies.
    """

    def step(self, ctx: Context, vertical_segments: Sequence[VerticalSegments | None]) -> MetricStage.Out:
        shown = [each.descriptors[:, COLOURS:].astype(np.float64) for each in vertical_segments if each is not None]
        halves = shown[: len(shown) // 2], shown[len(shown) // 2 :]
        if any(sum(map(len, half)) < 2 for half in halves):
            return self.Out()
        known, new = (np.concatenate(half) for half in halves)
        varied = new - known.mean(axis=0)
        if not varied.any():
            return self.Out()
        cosine, principal = kept(varied), kept(varied @ components(known))
        ratio = np.divide(cosine, principal, out=np.full(len(cosine), np.inf), where=principal > 0.0)[:-1]
        found = {
            "segments": len(known) + len(new),
            "cosine": cosine[:-1].tolist(),
            "principal": principal[:-1].tolist(),
            "least_ratio": float(ratio.min()),
        }
        return self.Out(metrics=Metrics({"profiles": found}, SPECS))


def components(rows: Array) -> Array:
    """Principal components (D, D) of rows (N, D) as columns, that of the largest variance first."""
    _, vectors = np.linalg.eigh(np.cov(rows, rowvar=False))
    return vectors[:, ::-1]


def kept(rows: Array) -> Array:
    """Shares (D,) of the sum of squares of rows (N, D) in their first 1 to D columns."""
    squares = np.square(rows).sum(axis=0)
    return np.asarray(np.cumsum(squares) / squares.sum())
