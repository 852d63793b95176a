"""Plots an image, its feature matrix of Haar integrals, and the histogram of that."""

from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Figure, Outputs, Stage, Tick
from omninav.pipeline.report.plot_style import plot
from omninav.stages.geometry.appearance.haar_integrals import Kernel, padded
from omninav.stages.values.image import Panorama, Pixels, Windows

CHANNELS = (("red", 2, "#D55E00"), ("green", 1, "#009E73"), ("blue", 0, "#0072B2"))


class FeatureMatrix(Stage):
    """Plots an image of the drive, its Haar integral at each pixel, and how often each value occurs per colour.

    Wolf, Burgard & Burkhardt 2005, figures 2 to 4; of windows the first.
    """

    frame: Annotated[int, Bounds(ge=0)] = 0
    """Frame of the log."""
    kernel: tuple[Annotated[float, Bounds(ge=0)], Annotated[float, Bounds(ge=0)]] = (3.0, 4.0)
    """Distances (px) of the kernel's two neighbours, as in `HaarIntegral`."""
    angles: Annotated[int, Bounds(ge=1)] = 36
    """Rotations over which the kernel is averaged."""
    root: bool = True
    """Whether the root of the product is averaged."""
    bins: Annotated[int, Bounds(ge=1)] = 32
    """Bins of the histogram that is drawn."""

    class Out(Outputs):
        """`figure`: absent at all other frames."""

        figure: Figure | None = None

    def step(self, ctx: Context, tick: Tick, panorama: Panorama | Windows) -> Out:
        """One frame."""
        if tick.frame != self.frame:
            return self.Out()
        kernel, circle = Kernel(self.kernel, self.angles, root=self.root), isinstance(panorama, Panorama)
        pixels = panorama.pixels if isinstance(panorama, Panorama) else panorama.pixels[0]
        means, cut = kernel.means(padded(pixels, kernel.margin + 1, False, circle)), kernel.margin
        rows, columns = means.shape[:2]
        means = means[cut : rows - cut, :] if circle else means[cut : rows - cut, cut : columns - cut]
        one, other = self.kernel
        return self.Out(
            figure=Figure(
                name="feature_matrix",
                title="Haar feature matrix",
                caption=f"The image of frame {tick.frame}; the mean over {self.angles} rotations of "
                f"{'the root of ' if self.root else ''}the product of the neighbours {one:g} and {other:g} pixels "
                "away, at right angles; and how often which mean occurs. Only the last is kept, all colours together.",
                content=_draw(pixels, means, self.bins),
                media_type="image/jpeg",
                order=41,
            )
        )


def _draw(pixels: Pixels, means: npt.NDArray[np.float32], bins: int) -> bytes:
    rows, columns = pixels.shape[:2]
    beside = columns < 2 * rows
    with plot(10.0, 3.0 if beside else 10.0 * 2 * rows / columns + 2.6, media_type="image/jpeg") as drawn:
        axes = drawn.canvas.subplots(1, 3) if beside else drawn.canvas.subplots(3, 1, height_ratios=[1, 1, 1])
        for panel, shown, title in ((axes[0], pixels / 255.0, "image"), (axes[1], means, "feature matrix")):
            panel.imshow(np.clip(shown[:, :, ::-1], 0.0, 1.0), interpolation="antialiased")
            panel.set_title(title)
            panel.set_axis_off()
        for name, channel, colour in CHANNELS:
            shares, edges = np.histogram(means[:, :, channel], bins=bins, range=(0.0, 1.0))
            axes[2].stairs(shares / max(int(shares.sum()), 1), edges, color=colour, label=name)
        axes[2].set_title("histogram")
        axes[2].set_xlabel("value of the feature matrix")
        axes[2].set_ylabel("share of pixels")
        axes[2].set_xlim(0.0, 1.0)
        axes[2].legend()
    return drawn.content
