"""Views as a turned robot has them."""

import numpy as np

from omninav.stages.geometry.arrays import Floats


def turned_view(view: Floats, turn: float) -> Floats:
    """A view as it looks to a robot turned counter-clockwise by `turn` radians: segments move up by turn n / 2 pi."""
    segments = len(view)
    shift = -turn * segments / (2 * np.pi)
    first, part = np.arange(segments) + int(np.floor(shift)), np.float32(shift - np.floor(shift))
    turned: Floats = view[first % segments] * (1 - part) + view[(first + 1) % segments] * part
    return turned
