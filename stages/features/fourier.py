"""Describes whole views by spectra around the robot."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.spectra import packed
from omninav.stages.geometry.arrays import Complex, Floats
from omninav.stages.values.image import Panorama
from omninav.stages.values.views import Spectrum

from .averaged_strip import Channels, Contrast, averaged_strip

BANDS = 8
"""Bands from top to bottom; each band and channel is a signal of its own."""
FREQUENCIES = 8
"""Coefficients kept of each signal, with the mean."""


def spectrum_around(strip: Floats, frequencies: int, mean: bool = True) -> Complex:
    """The lowest coefficients of each row and channel of a strip (rows, columns, channels) around the robot.

    Gives (rows * channels, frequencies), divided by sqrt(columns) so that sums of squares are those of the strip
    (Parseval). `mean` False makes the first, the mean, 0.
    """
    rows, columns, channels = strip.shape
    signals = np.moveaxis(strip, 2, 1).reshape(rows * channels, columns)
    spectrum: Complex = np.fft.rfft(signals.astype(np.float64), axis=1)[:, :frequencies] / np.sqrt(columns)
    if not mean:
        spectrum[:, 0] = 0.0
    return spectrum


class SegmentSpectrum(Stage):
    """Describes a view by Fourier coefficients of segment colours around the robot.

    Gross, Koenig & Müller 2005, section 2.2: "a Fourier transformation over averaged local view-segments". Magnitudes
    do not change when the robot turns; the turn between two views follows from circular cross-correlation.
    """

    segments: Annotated[int, Bounds(ge=2 * FREQUENCIES - 2)] = 36
    """Segments around the robot, the samples of each signal."""
    mean: bool = True
    """Whether the mean, the brightness of the band, counts; else it is 0."""
    channels: Channels = "colour"
    """`brightness`, or `colour` (blue, green, red)."""
    contrast: Contrast = "local"
    """`none`: grey levels, as perhaps in the paper; `local`: standard deviations (`averaged_strip`)."""

    class Out(Outputs):
        view: Spectrum

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        strip = averaged_strip(panorama.pixels, BANDS, self.segments, self.channels, self.contrast)
        spectrum = spectrum_around(strip, FREQUENCIES, self.mean)
        return self.Out(view=Spectrum(packed(spectrum), len(spectrum), self.segments))
