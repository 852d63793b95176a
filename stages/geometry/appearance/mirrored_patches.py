"""Descriptors of patches that one camera shows mirrored and another does not."""

from typing import TypeVar

import numpy as np

from omninav.stages.geometry.arrays import Bytes, Floats

Rows = TypeVar("Rows", Bytes, Floats)

SIFT_SHAPE = (4, 4, 8)
"""Cells of a SIFT descriptor across and along its orientation, and directions of gradients in each."""
FLIPPED = np.roll(np.arange(128).reshape(SIFT_SHAPE)[::-1, :, ::-1], 1, axis=2).ravel()
"""Places of a SIFT descriptor's numbers in that of the mirrored patch: cells are on the other side of the orientation,
and directions turn the other way."""


def mirrored_sift(descriptors: Rows) -> Rows:
    """SIFT descriptors (N, 128) of the same patches in a mirrored image; those of another length stay as they are."""
    return descriptors if descriptors.shape[1] != len(FLIPPED) else np.ascontiguousarray(descriptors[:, FLIPPED])
