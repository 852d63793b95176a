"""Descriptions of a view, segment by segment around the robot."""

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Value

FloatArray = npt.NDArray[np.float32]


class SegmentFeatures(Value):
    """A view described by equal segments of its panorama. `values`: (segments, bins) float32.

    Segment j covers the columns from j/segments to (j+1)/segments of the panorama, clockwise from straight behind.
    """

    values: FloatArray


class SegmentHistograms(SegmentFeatures):
    """Histograms per segment, each segment summing to 1 (so that an intersection lies in [0, 1]; erratum 20)."""


class SegmentColours(SegmentFeatures):
    """Mean colour per segment: (segments, 3), blue-green-red in 0..255."""
