"""Describes whole views by the low frequencies of their cosine transform."""

from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Stage
from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.values.image import Panorama
from omninav.stages.values.views import Coefficients

from .averaged_strip import AveragedStrip, turned_copies


def cosine_basis(size: int) -> Array:
    """The orthonormal cosine basis (DCT-II): (size, size), row k the wave of frequency k."""
    waves = np.cos(np.pi / size * np.outer(np.arange(size), np.arange(size) + 0.5))
    waves[0] *= np.sqrt(0.5)
    return np.asarray(waves * np.sqrt(2.0 / size))


def lowest_frequencies(rows: int, columns: int, number: int, mean: bool) -> tuple[Ints, Ints]:
    """The first `number` frequencies (down, across) of a transform, by their sum, then by the one down.

    `mean`: whether the first one is (0, 0).
    """
    down, across = np.divmod(np.arange(rows * columns), columns)
    order = np.lexsort((down, down + across))[0 if mean else 1 :][:number]
    return down[order], across[order]


class CosineTransform(AveragedStrip, Stage):
    """Describes a view by the first coefficients of the orthonormal discrete cosine transform of its averaged panorama.

    Porta & Kröse 2004, section 3: a standard compression without training images. Distances are root sums of squares
    over the strip. The paper compares views as they are (`headings` 1): the transform of a turned panorama never
    matches. With more headings a view matches at any of them and tells the turn.
    """

    coefficients: Annotated[int, Bounds(ge=1)] = 128
    """Coefficients of each channel, from the lowest frequency on."""
    mean: bool = False
    """Whether the first coefficient (DC), the image's brightness, is among them (erratum 19 in docs/papers.md)."""

    def __post_init__(self) -> None:
        """Headings are whole columns apart, and there are as many coefficients as asked for."""
        super().__post_init__()
        if self.coefficients > self.rows * self.columns - (not self.mean):
            raise ValueError(
                f"coefficients: a strip of {self.rows} x {self.columns} has fewer than {self.coefficients}"
            )

    def setup(self, ctx: Context) -> None:
        self._down, self._across = lowest_frequencies(self.rows, self.columns, self.coefficients, self.mean)
        self._vertical = cosine_basis(self.rows)[: self._down.max() + 1]
        waves = cosine_basis(self.columns)[: self._across.max() + 1]
        self._turned = turned_copies(waves, self.headings)

    def step(self, ctx: Context, panorama: Panorama) -> AveragedStrip.Out:
        strip = self.strip(panorama)
        columns = np.tensordot(self._vertical, strip, axes=(1, 0))  # (frequencies down, columns, channels)
        waves = np.tensordot(self._turned, columns, axes=(2, 1))  # (headings, across, down, channels)
        # In C order, as a cache gives it back: in another, products with it would differ in their last bit.
        turned: Floats = waves[:, self._across, self._down].reshape(self.headings, -1).astype(np.float32, order="C")
        return self.Out(view=Coefficients(turned[0].copy(), turned))
