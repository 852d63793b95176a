"""Maps without a common frame, aligned by what looks alike."""

import numpy as np
import pytest

from omninav.stages.geometry.plane.se2 import between, chain, compose
from omninav.stages.map_files.aligned import aligned
from omninav.stages.values.maps import ReferenceGraph

LAP = np.concatenate([np.tile([0.2, 0.0, 0.0], (24, 1)), np.tile([0.2, 0.0, np.pi / 8], (8, 1))])
ONE = chain(np.tile(LAP, (2, 1)))
OTHER = compose([1.0, 0.0, 0.0], chain(np.tile(LAP, (2, 1))[:60]))
ELSEWHERE = OTHER + np.array([60.0, 0.0, 0.0])
WAVES, PHASES = np.random.default_rng(0).normal(0.0, 2.0, (2, 36, 12)), np.linspace(0, 6, 432).reshape(36, 12)


def mapped(poses, source="odometry"):
    """References with histograms that change over half a metre, in the frame of the first, which is bent."""
    around = 0.1 + np.maximum(np.sin(np.tensordot(poses[:, :2], WAVES, 1) + 7.0 * PHASES), 0.0)
    world = around / around.sum(axis=2, keepdims=True)
    turns = np.round(poses[:, 2] / (2 * np.pi) * 36).astype(int)
    views = np.stack([np.roll(view, turn, axis=0) for view, turn in zip(world, turns, strict=True)])
    steps = between(poses[:-1], poses[1:]) + ([0.0, 0.0, 0.003] if source == "odometry" else np.zeros(3))
    driven = np.concatenate([np.zeros((1, 3)), chain(steps)])
    return ReferenceGraph(driven, views.astype(np.float32), "histograms", np.zeros((0, 2), np.int64), source)


@pytest.mark.parametrize("source", ["odometry", "truth"])
def test_two_maps_in_frames_of_their_own_are_brought_into_the_first_ones(source):
    maps = [mapped(ONE, source), mapped(OTHER)]
    found = aligned(maps)
    truth = between(ONE[0], np.concatenate([ONE, OTHER]))
    assert found.joined == (True, True)
    assert found.closures > 5
    assert np.median(np.hypot(*(found.poses - truth)[:, :2].T)) < 0.25
    assert (maps[0].poses == found.poses[: len(ONE)]).all() == (source == "truth")


def test_a_map_of_another_place_is_not_joined():
    found = aligned([mapped(ONE), mapped(ELSEWHERE)])
    assert found is None or found.joined == (True, False)


def test_maps_of_one_reference_or_none_tell_nothing():
    assert aligned([mapped(ONE), mapped(ONE[:1])]) is None or not aligned([mapped(ONE), mapped(ONE[:1])]).joined[1]
    assert aligned([mapped(ONE), ReferenceGraph.empty()]) is None
