"""Mean colour per segment of the panorama."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.arrays import Floats
from omninav.stages.values.features import SegmentColours
from omninav.stages.values.image import Panorama, Pixels

from .grey_world import UnderGreyWorld
from .segment_edges import segment_edges


def mean_colours(pixels: Pixels, segments: int) -> Floats:
    """Mean blue, green, red (0..255) of each segment's columns over all rows: (segments, 3) float32."""
    edges = segment_edges(pixels.shape[1], segments)
    columns = pixels.sum(axis=0, dtype=np.uint32)
    sums = np.add.reduceat(columns, edges[:-1], axis=0)
    means: Floats = (sums / (np.diff(edges)[:, None] * pixels.shape[0])).astype(np.float32)
    return means


class MeanRgb(UnderGreyWorld, Stage):
    """Describes a panorama by the mean colour of each segment (blue-green-red, 0..255).

    Gross & Koenig 2004, section 2: "mean RGB", the feature used before the histograms.
    """

    segments: Annotated[int, Bounds(ge=1)] = 36
    """Equal parts of the panorama."""

    class Out(Outputs):
        features: SegmentColours

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        return self.Out(features=SegmentColours(mean_colours(self.constant(panorama.pixels), self.segments)))
