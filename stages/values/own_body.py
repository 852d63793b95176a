"""Parts of a camera's image in which a robot sees itself."""

import math
from collections.abc import Sequence
from dataclasses import field, replace
from typing import Annotated

import numpy as np

from omninav.pipeline import Shape, Value
from omninav.stages.geometry.arrays import Array, Bools, Ints

from .local_features import LocalFeatures
from .maps import ReferenceEvent


class OwnBody(Value):
    """Parts of an image in which a robot sees itself: `cells` (R, C), of `side` pixels each.

    `size`: columns and rows of the image (pixels); `log`: the log that it is of.
    """

    cells: Annotated[Bools, Shape("R", "C")] = field(default_factory=lambda: np.zeros((1, 1), np.bool_))
    side: float = math.inf
    size: tuple[int, int] = (0, 0)
    log: int = 0

    def found_in(self, width: int, height: int) -> bool:
        """Tells whether there is any, in images of this size (pixels)."""
        return self.size == (width, height) and bool(self.cells.any())

    def hides(self, pixels: Array) -> Bools:
        """Which pixels (..., 2) are of it: (...,)."""
        return np.asarray(self.cells[self.rows_and_columns(pixels)], np.bool_)

    def rows_and_columns(self, pixels: Array) -> tuple[Ints, Ints]:
        """The cells of pixels (..., 2); of those beside the image the nearest."""
        rows, columns = self.cells.shape
        found = np.nan_to_num(pixels / self.side).astype(np.int64)
        return np.clip(found[..., 1], 0, rows - 1), np.clip(found[..., 0], 0, columns - 1)

    def without(self, features: LocalFeatures) -> LocalFeatures:
        """The features that are not of it."""
        if not self.cells.any():
            return features
        kept = features.chosen(np.flatnonzero(~self.hides(features.points)))
        if features.columns is None:
            return kept
        shown = ~self.hides(features.columns.points).any(axis=1)
        return replace(kept, columns=features.columns.chosen(np.flatnonzero(shown)))


def references_without_body(
    features: Sequence[LocalFeatures | None], events: Sequence[ReferenceEvent | None], body: Sequence[OwnBody | None]
) -> list[LocalFeatures | None]:
    """Features of a tour's images that became references, but for those of the robot's `body` as found by its end."""
    kept = without_body(features, body)
    return [each for each, event in zip(kept, events, strict=True) if event is not None]


def without_body(
    features: Sequence[LocalFeatures | None], body: Sequence[OwnBody | None]
) -> list[LocalFeatures | None]:
    """Features of images but for those of the robot's `body` as the last image of the same log shows it."""
    last = {each.log: each for each in body if each is not None}
    whose = [OwnBody() if each is None else last[each.log] for each in body or [None] * len(features)]
    return [None if each is None else own.without(each) for each, own in zip(features, whose, strict=True)]
