"""Descriptions of a view, segment by segment around the robot."""

from typing import Annotated, ClassVar

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Shape, UnitRows, Value
from omninav.stages.geometry.appearance.segments import FeatureKind
from omninav.stages.geometry.arrays import Array, Floats


class SegmentFeatures(Value):
    """A view described by equal segments of its panorama. `values`: (segments, bins) float32.

    Segment j covers the columns from j/segments to (j+1)/segments of the panorama, clockwise from straight behind. A
    view that is described as a whole is one segment, and shows nothing of the robot's heading. `kind`: how segments of
    a class are compared, and what a map calls them.
    """

    kind: ClassVar[FeatureKind]

    values: Annotated[Floats, Shape("segments", "bins")]


class SegmentHistograms(SegmentFeatures):
    """Histograms per segment, each with a sum of at most 1, so that intersections are in [0, 1].

    Segments sum to 1 (erratum 20 in docs/papers.md) unless some of their pixels were left out: bins are shares of all
    pixels of a segment. Pixels left out do not count in a match that divides by the query's own sum (erratum 43).
    `directions` (segments,): the segments are separate images with these directions (radians, counter-clockwise from
    the robot's forward); None: they are equal parts of the circle. `scales`: the bins are that many histograms of equal
    length one after the other, of one image by the same kernels at growing size, each of which sums to at most 1.
    """

    kind = "histograms"

    directions: Annotated[Array | None, Shape("segments")] = None
    scales: Annotated[int, Bounds(ge=1)] = 1


class SegmentColours(SegmentFeatures):
    """Mean colour per segment: (segments, 3), blue-green-red in 0..255."""

    kind = "colours"


class SegmentDescriptors(SegmentFeatures):
    """A vector of any kind per segment, of length 1: a network's output for it, for example. (segments, D) float32."""

    kind = "descriptors"

    values: Annotated[Floats, Shape("segments", "bins"), UnitRows()]

    @classmethod
    def of(cls, vectors: npt.NDArray[np.floating]) -> "SegmentDescriptors":
        """Vectors (segments, D) of any length, brought to length 1; zeros stay zeros."""
        lengths = np.linalg.norm(vectors.astype(np.float64), axis=1, keepdims=True)
        return cls((vectors / np.where(lengths > 0.0, lengths, 1.0)).astype(np.float32))
