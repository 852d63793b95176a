"""Colour histogram per segment of the panorama, in a colour space of choice."""

from typing import Annotated, Literal, cast

import cv2
import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Floats, Ints
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.image import Panorama, Pixels

from .grey_world import UnderGreyWorld
from .segment_edges import segment_edges

ColourSpace = Literal["rgb", "lab", "hsv"]
BinCount = Annotated[int, Bounds(ge=0, le=256)]
Level = Annotated[int, Bounds(ge=0, le=255)]
Ranges = tuple[tuple[Level, Level], tuple[Level, Level], tuple[Level, Level]]

CONVERSIONS = {"lab": cv2.COLOR_BGR2Lab, "hsv": cv2.COLOR_BGR2HSV}
LEVELS = {"rgb": (256, 256, 256), "lab": (256, 256, 256), "hsv": (180, 256, 256)}


@compiled(nogil=True)
def _count(pixels: Pixels, edges: Ints, bins: Ints, sizes: Ints, offsets: Ints, joint: bool, length: int) -> Floats:
    segments = len(edges) - 1
    counts = np.zeros((segments, length), np.float32)
    for j in range(segments):
        here = np.zeros(length, np.int64)
        for row in range(pixels.shape[0]):
            for column in range(edges[j], edges[j + 1]):
                cell = 0
                for channel in range(3):
                    if sizes[channel] == 0:
                        continue
                    b = bins[channel, pixels[row, column, channel]]
                    if joint:
                        cell = cell * sizes[channel] + b
                    else:
                        here[offsets[channel] + b] += 1
                if joint:
                    here[cell] += 1
        total = here.sum()
        for b in range(length):
            counts[j, b] = here[b] / total
    return counts


def colour_histograms(
    pixels: Pixels,
    segments: int,
    space: ColourSpace,
    bins: tuple[int, int, int],
    joint: bool = False,
    ranges: Ranges | None = None,
) -> Floats:
    """Histograms of a colour space's channels per segment, each segment's summing to 1: (segments, bins) float32.

    `bins` per channel in the space's order (rgb: red, green, blue), 0 leaves one out: equal steps of all its levels, or
    of those from the lowest to the highest in `ranges`; what is beyond counts in the first and the last bin.
    `joint` False: one histogram per channel behind each other, with equal shares of the mass; True: one over all
    channels, the first slowest. `pixels` are blue-green-red.
    """
    converted = pixels[..., ::-1] if space == "rgb" else cv2.cvtColor(pixels, CONVERSIONS[space])
    sizes = np.array(bins, dtype=np.int64)
    spans = ranges or tuple((0, levels - 1) for levels in LEVELS[space])
    table = np.stack(
        [
            np.clip((np.arange(256) - low) * n // (high - low + 1), 0, max(n - 1, 0))
            for n, (low, high) in zip(bins, spans, strict=True)
        ]
    )
    offsets = np.concatenate([[0], np.cumsum(sizes)[:-1]]).astype(np.int64)
    length = int(np.prod(sizes[sizes > 0])) if joint else int(sizes.sum())
    edges = segment_edges(pixels.shape[1], segments)
    counted: Floats = _count(np.ascontiguousarray(cast(Pixels, converted)), edges, table, sizes, offsets, joint, length)
    return counted


class ColourHistogram(UnderGreyWorld, Stage):
    """Describes a panorama by a histogram of a colour space's channels per segment.

    Gross & Koenig 2004, section 2: the authors "experimentally studied several color spaces" before they settled on HSV
    (stage HsvHistogram, which also leaves out noisy hues). Each segment sums to 1, so that intersections are in [0, 1].
    """

    segments: Annotated[int, Bounds(ge=1)] = 36
    """Equal parts of the panorama."""
    space: ColourSpace = "rgb"
    """rgb, lab or hsv, as OpenCV converts 8-bit images."""
    bins: tuple[BinCount, BinCount, BinCount] = (8, 8, 8)
    """Bins per channel; 0 leaves a channel out."""
    joint: bool = False
    """One histogram over all channels instead of one per channel."""
    ranges: Ranges | None = None
    """[lowest, highest] level of each channel that the bins cover; null: all levels. In seven simulated worlds 96 % of
    Lab's a and b are from 80 to 183."""

    class Out(Outputs):
        features: SegmentHistograms

    def __post_init__(self) -> None:
        """Refuses settings that leave no channel, and ranges that do not go upwards."""
        if not any(self.bins):
            raise ValueError("bins: at least one channel needs bins; write bins: [8, 8, 8]")
        if any(low >= high for low, high in self.ranges or ()):
            raise ValueError(
                "ranges: each is [lowest, highest]; write ranges: [[0, 255], [80, 183], [80, 183]], or null"
            )

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        pixels = self.constant(panorama.pixels)
        histograms = colour_histograms(pixels, self.segments, self.space, self.bins, self.joint, self.ranges)
        return self.Out(features=SegmentHistograms(histograms))
