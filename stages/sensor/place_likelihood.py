"""Likelihood of each place of a topological map, given the view."""

from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.values.belief import Likelihood
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.visual_distance import VisualDistances
from omninav.stages.values.visual_words import WordSimilarities

MIN_LIKELIHOOD = 0.001
"""Smallest likelihood of a place, over that of one that looks the same: views are blocked."""


class PlaceLikelihood(Stage):
    """Computes the likelihood of each place: it falls with the visual distance of its view to the present one.

    Goedemé et al. 2007, section 5.3, equation 14: P(z | x) falls as exp(-diss^2 / sigma^2). Beside the way of the tour,
    or where things have changed, every distance is many sigma, and by a Gaussian all are as unlikely as a place that
    has nothing in common; yet the one with the smallest distance is the right one. Hence the heavy tail by default.
    Where `words` are given the likelihood by visual words is a factor beside it.
    """

    sigma: Annotated[float, Bounds(gt=0)] | None = None
    """Standard deviation of visual distance; null: as it was measured on the map's views (`nodes.mapping.spread`)."""
    tail: Literal["gaussian", "heavy"] = "heavy"
    """`gaussian`: the paper's; `heavy`: 1 / (1 + diss^2 / sigma^2)."""

    word_contrast: Annotated[float, Bounds(ge=0)] = 20.0
    """Log likelihood (nats) by which words of cosine 1 are better than of cosine 0; 0: words do not count."""

    class Out(Outputs):
        likelihood: Likelihood

    def step(
        self, ctx: Context, distances: VisualDistances, map: TopologicalMap, words: WordSimilarities | None = None
    ) -> Out:
        sigma = map.spread if self.sigma is None else self.sigma
        values = place_likelihoods(distances.distances, sigma, MIN_LIKELIHOOD, self.tail)
        if words is not None:
            values = values * word_likelihoods(words.values, self.word_contrast, MIN_LIKELIHOOD)
        return self.Out(likelihood=Likelihood(values))


def place_likelihoods(
    distances: Array, sigma: float, min_likelihood: float, tail: Literal["gaussian", "heavy"]
) -> Array:
    """Likelihoods in [min_likelihood, 1] of visual distances (P,), inf for nothing in common."""
    squares = np.square(distances / max(sigma, 1e-9))
    return min_likelihood + (1.0 - min_likelihood) * (np.exp(-squares) if tail == "gaussian" else 1.0 / (1.0 + squares))


def word_likelihoods(similarities: Floats, contrast: float, min_likelihood: float) -> Array:
    """Likelihoods in [min_likelihood, 1] of the cosines (P,) of places' words: 1 for the most similar place."""
    best = float(similarities.max(initial=0.0))
    return min_likelihood + (1.0 - min_likelihood) * np.exp(contrast * (similarities.astype(np.float64) - best))
