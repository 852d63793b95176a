"""A stage that fails at one seed: what a sweep does with a failing job can be seen with it."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.features.hsv_histogram import hsv_histograms
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.image import Panorama


class RaisesAtSeed(Stage):
    """Colour histograms as ours, and an error where `seed` is `raises_at`."""

    seed: int = 0
    raises_at: int = 1

    class Out(Outputs):
        features: SegmentHistograms

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        if self.seed == self.raises_at:
            raise RuntimeError(f"this stage raises at seed {self.seed}, as it was told to")
        return self.Out(features=SegmentHistograms(hsv_histograms(panorama.pixels, 36)))
