"""Parts of panoramas that a robot's own body covers, and which show no turn."""

from dataclasses import field
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Shape, Value
from omninav.stages.geometry.arrays import Array, Bools, Floats

MIN_IMAGES, MAX_IMAGES = 6, 128
"""Images before any cell is told to be covered, and number of the last ones that count, about."""
USUAL, COVERED_SHARE = 0.75, 0.35
"""Quantile of the cells' standard deviations, and the share of it below which a cell is covered: of a body in the light
of the rooms 0.24 to 0.32, of uniform walls and floors 0.5 and more after a hundred images, 0.36 after forty."""


class CoveredCells(Value):
    """Mean grey and variance of the cells of the last `images`: (rows, columns) each."""

    images: Annotated[int, Bounds(ge=0)] = 0
    mean: Annotated[Array, Shape("R", "C")] = field(default_factory=lambda: np.zeros((0, 0)))
    variance: Annotated[Array, Shape("R", "C")] = field(default_factory=lambda: np.zeros((0, 0)))

    def seen(self, strip: Floats) -> "CoveredCells":
        """Add a strip (rows, columns); one of another size begins anew."""
        if strip.shape != self.mean.shape:
            return CoveredCells(1, strip.astype(np.float64), np.zeros(strip.shape))
        images, away = min(self.images + 1, MAX_IMAGES), strip - self.mean
        kept = 1.0 - 1.0 / images
        return CoveredCells(images, self.mean + away / images, kept * (self.variance + away**2 / images))

    def cells(self) -> Bools:
        """Which cells (rows, columns) change much less than most."""
        if self.images < MIN_IMAGES:
            return np.zeros(self.mean.shape, np.bool_)
        spread = np.sqrt(self.variance)
        return np.asarray(spread < COVERED_SHARE * np.quantile(spread, USUAL), np.bool_)

    def uncovered(self, strips: Floats) -> Floats:
        """Strips (N, rows, columns) whose covered cells have the mean of the rest of their row, and so show nothing."""
        covered = self.cells()
        if covered.shape != strips.shape[1:] or not covered.any():
            return strips
        shown = np.maximum(np.count_nonzero(~covered, axis=1), 1)[:, None]
        rest = np.where(covered, 0.0, strips).sum(axis=2, keepdims=True) / shown
        return np.where(covered, rest, strips).astype(np.float32)
