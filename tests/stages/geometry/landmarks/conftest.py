"""A drive around a house of 4000 landmarks: what its images show, of which landmarks, and how alike they are."""

import numpy as np
import pytest
from landmark_world import house, looks

from omninav.stages.geometry.landmarks.map_making import LocalViews


@pytest.fixture(scope="package")
def world():
    return house(np.random.default_rng(0), landmarks=4000)


@pytest.fixture(scope="package")
def order(world):
    """Sightings by reference."""
    return np.argsort(world.references, kind="stable")


@pytest.fixture(scope="package")
def views(world, order):
    """A descriptor varies a little."""
    starts = np.searchsorted(world.references[order], np.arange(len(world.poses) + 1))
    return LocalViews(starts, world.bearings[order], looks(world, order, 32))


@pytest.fixture(scope="package")
def landmarks(world, order):
    """The landmark of each feature."""
    return world.landmarks[order]


@pytest.fixture(scope="package")
def similarity(world):
    """Counts the landmarks that each two references share (R, R)."""
    seen = np.zeros((len(world.poses), len(world.points)), np.float32)
    seen[world.references, world.landmarks] = 1.0
    return seen @ seen.T
