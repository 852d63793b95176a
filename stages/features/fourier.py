"""Whole views by the spectrum of what stands around the robot."""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.spectra import packed
from omninav.stages.values.image import Panorama
from omninav.stages.values.views import Spectrum

from .averaged_strip import Channels, Contrast, averaged_strip

FloatArray = npt.NDArray[np.float32]
Complex = npt.NDArray[np.complex128]


def spectrum_around(strip: FloatArray, frequencies: int, mean: bool = True) -> Complex:
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
    """Fourier coefficients of the mean colours of segments around the robot.

    Gross, Koenig & Müller 2005, section 2.2, "a Fourier transformation over averaged local view-segments"; the sizes of
    the coefficients do not change when the robot turns, and the turn between two views is found by circular
    cross-correlation. The panorama is averaged to `segments` around the robot in `bands` from top to bottom; each band
    and channel is a signal of its own. `frequencies`: how many coefficients of each are kept, the mean among them;
    `mean` False leaves that out (it is 0), which is the brightness of the band. `contrast` none: in grey levels, as the
    paper may have had it; whole, local: in standard deviations (strip.averaged_strip).
    """

    segments: Annotated[int, Bounds(ge=2)] = 36
    bands: Annotated[int, Bounds(ge=1)] = 8
    frequencies: Annotated[int, Bounds(ge=2)] = 8
    mean: bool = True
    channels: Channels = "colour"
    contrast: Contrast = "local"

    class Out(Outputs):
        """The description of the view."""

        view: Spectrum

    def __post_init__(self) -> None:
        """A signal has no more frequencies than half its samples and one."""
        if self.frequencies > self.segments // 2 + 1:
            raise ValueError(f"frequencies: {self.segments} segments have {self.segments // 2 + 1} at most")

    def step(self, ctx: Context, panorama: Panorama) -> Out:
        """Describe one panorama."""
        strip = averaged_strip(panorama.pixels, self.bands, self.segments, self.channels, self.contrast)
        spectrum = spectrum_around(strip, self.frequencies, self.mean)
        return self.Out(view=Spectrum(packed(spectrum), len(spectrum), self.segments))
