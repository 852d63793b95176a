"""Poses proposed anywhere in the free space."""

import numpy as np

from omninav.pipeline import Context, Tick
from omninav.stages.sensor.free_space_proposals import FreeSpaceProposals
from omninav.stages.values.grid import FreeSpace


def test_poses_lie_in_the_free_cells_with_equal_weights_and_all_headings(monkeypatch):
    monkeypatch.setattr("omninav.stages.sensor.free_space_proposals.NUMBER", 400)
    free = FreeSpace(np.array([[50.5, 50.5], [51.5, 50.5]]), 1.0)
    ctx = Context("proposals", np.random.default_rng(0))
    proposed = FreeSpaceProposals().step(ctx, Tick(0, 0), free).proposals
    assert proposed.poses.shape == (400, 3)
    assert (proposed.poses[:, 0] >= 50).all()
    assert (proposed.poses[:, 0] <= 52).all()
    assert np.histogram(proposed.poses[:, 2], bins=4, range=(-np.pi, np.pi))[0].min() > 70
    assert proposed.weights.tolist() == [1 / 400] * 400
