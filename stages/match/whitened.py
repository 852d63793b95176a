"""Similarity by the angle between views, after whitening by the map's own."""

from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Stage
from omninav.stages.geometry.appearance.segments import cosine_similarities
from omninav.stages.geometry.arrays import Floats, Ints
from omninav.stages.values.features import SegmentFeatures
from omninav.stages.values.maps import ReferenceGraph

from .reference_match import ReferenceMatch

SHRINKAGE = 0.01
"""Share of the mean variance that is added to each, so that directions without any are not blown up."""


class Whitening(NamedTuple):
    """`mean` (D,) is subtracted, and the rest multiplied by `weights` (D, K), strongest direction first."""

    mean: Floats
    weights: Floats

    def of(self, vectors: Floats) -> Floats:
        """Vectors (..., D), whitened and brought to length 1: (..., K) float32; zeros stay zeros."""
        white = (vectors - self.mean) @ self.weights
        lengths = np.linalg.norm(white, axis=-1, keepdims=True)
        return np.asarray(white / np.where(lengths > 0.0, lengths, 1.0), np.float32)


def learned_whitening(vectors: npt.NDArray[np.floating], components: int) -> Whitening:
    """Whitening by the K strongest principal components of vectors (N, D); K is at most D.

    Jégou & Chum 2012 (Negative evidences and co-occurrences in image retrieval: the benefit of PCA and whitening). A
    component's largest number is positive.
    """
    values = vectors.astype(np.float64)
    mean = values.mean(axis=0)
    centred = values - mean
    variances, directions = np.linalg.eigh(centred.T @ centred / len(values))
    strongest = np.argsort(-variances, kind="stable")[:components]
    axes = directions[:, strongest]
    axes = axes * np.sign(np.take_along_axis(axes, np.abs(axes).argmax(axis=0)[None], axis=0))
    weights = axes / np.sqrt(np.maximum(variances[strongest], 0.0) + SHRINKAGE * variances.mean() + 1e-12)
    return Whitening(mean.astype(np.float32), weights.astype(np.float32))


MAX_LEARNED = 1024
"""References, at even steps, that a whitening is learned from."""


class WhitenedMatch(ReferenceMatch, Stage):
    """Similarity by the cosine of the angle between whole views whose segments are whitened by the map's references.

    A network that was trained elsewhere gives vectors that are all alike in a place of which it has seen no image.
    Whitening by the segments of the map's own references (Jégou & Chum 2012) leaves what differs there. It follows
    from the references alone, so that a map carries its own. 1 is the same direction; 0 a right angle or more. Raises
    BadInput where the map has other features.
    """

    components: Annotated[int, Bounds(ge=1)] = 64
    """Principal components that are kept."""

    def setup(self, ctx: Context) -> None:
        """Nothing learned yet: the map comes with the first image."""
        self._learned: tuple[ReferenceGraph, int, Whitening] | None = None

    def compare(self, map: ReferenceGraph, features: SegmentFeatures, chosen: Ints | None) -> Floats:
        if not len(map):
            return np.zeros((0 if chosen is None else len(chosen), self.headings), np.float32)
        whitening = self._whitening(map)
        some = whitening.of(np.asarray(map.features[:] if chosen is None else map.features[chosen], np.float32))
        return cosine_similarities(some, whitening.of(features.values), self.headings)

    def compare_view(self, map: ReferenceGraph, features: SegmentFeatures, view: Floats) -> Floats:
        if not len(map):
            return np.zeros((1, self.headings), np.float32)
        whitening = self._whitening(map)
        return cosine_similarities(whitening.of(view[None]), whitening.of(features.values), self.headings)

    def _whitening(self, map: ReferenceGraph) -> Whitening:
        """Learned once, and again where the map has grown."""
        if self._learned is None or self._learned[0] is not map or self._learned[1] != len(map):
            rows = np.unique(np.linspace(0, len(map) - 1, min(len(map), MAX_LEARNED)).astype(np.int64))
            segments = np.asarray(map.features[rows]).reshape(-1, map.features.shape[2])
            self._learned = map, len(map), learned_whitening(segments, self.components)
        return self._learned[2]
