"""A stage that raises an error at one seed, to see what a sweep does with a failing job."""

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.features.hsv_histogram import hsv_histograms
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.image import Panorama


class RaisesAtSeed(Stage):
    """The built-in colour histograms, and an error where `seed` is `raises_at`."""

    seed: int = 0
    """The seed of the run."""

    raises_at: int = 1
    """The seed at which the stage raises."""

    class Out(Outputs):
        features: SegmentHistograms

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        if self.seed == self.raises_at:
            raise RuntimeError(f"raises at seed {self.seed}, as configured")
        return self.Out(features=SegmentHistograms(hsv_histograms(panorama.pixels, 36)))
