"""Local features along a made-up way: each view shares its features with those around it."""

import numpy as np

from omninav.stages.values.local_features import LocalFeatures

EACH, STEP = 40, 4


def seen_along(views: int, seed: int = 0) -> list[LocalFeatures]:
    """Views of a way of landmarks with looks of their own: from one view to the next a tenth of them are new."""
    rng = np.random.default_rng(seed)
    looks = rng.integers(0, 200, (views * STEP + EACH, 128))
    rows = [looks[n * STEP : n * STEP + EACH] + rng.integers(0, 6, (EACH, 128)) for n in range(views)]
    return [features_of(each.astype(np.uint8)) for each in rows]


def features_of(descriptors: np.ndarray) -> LocalFeatures:
    """Local features of which only the looks matter."""
    number = len(descriptors)
    bearings = np.tile([1.0, 0.0, 0.0], (number, 1))
    colours, sizes = np.zeros((number, 3), np.float32), np.ones(number, np.float32)
    return LocalFeatures(bearings, np.zeros((number, 2)), descriptors, colours, sizes)


NOTHING = features_of(np.empty((0, 128), np.uint8))
