import numpy as np
import pytest
from landmark_world import driven, misplaced, seen_in

from omninav.stages.geometry.landmarks.closures import FAR_M, candidate_pairs, verified_pairs
from omninav.stages.geometry.landmarks.map_adjustment import adjusted_drive
from omninav.stages.geometry.landmarks.pair_lengths import driven_steps, pair_lengths
from omninav.stages.geometry.plane.drive_graph import odometry_sigmas
from omninav.stages.geometry.plane.se2 import between, chain, compose, distances_along

SLIPPED = np.arange(32, 39)


@pytest.fixture(scope="module")
def verified(world, views, similarity):
    way = distances_along(world.poses)
    return verified_pairs(views, candidate_pairs(iter(similarity), way), np.random.default_rng(2))


def slipping(world, factor):
    """Odometry that tells `factor` of the length of some motions, by its motions and by its path."""
    steps, _ = driven(world.poses)
    steps[SLIPPED, :2] *= factor
    return steps, np.concatenate([world.poses[:1], compose(world.poses[0], chain(steps))])


@pytest.mark.parametrize("factor", [1.0, 0.2, 3.0])
def test_lengths_of_pairs_are_right_where_odometry_slips(world, views, verified, factor: float):
    _, odometry = slipping(world, factor)
    lengths = pair_lengths(views.bearings, verified, odometry)
    one, other = verified.pairs.T
    true = np.hypot(*(world.poses[other] - world.poses[one])[:, :2].T)
    off = np.abs(np.log(lengths / true))[true > 0.2]
    assert np.isfinite(off).mean() > 0.95
    assert np.nanmedian(off) < 0.05
    assert np.nanpercentile(off, 80) < 0.1


def test_pairs_that_nothing_links_have_the_length_of_odometry_or_none(world, views, verified):
    lonely = verified._replace(
        pairs=np.array([[0, 1], [0, 100]]),
        turns=np.zeros(2),
        directions=np.zeros(2),
        first=np.empty(0, np.int64),
        second=np.empty(0, np.int64),
        ratio=np.empty(0),
        owners=np.empty(0, np.int64),
    )
    near, far = pair_lengths(views.bearings, lonely, world.poses)
    assert near == pytest.approx(np.hypot(*(world.poses[1] - world.poses[0])[:2]), rel=1e-3)
    assert np.hypot(*np.diff(world.poses[:100, :2], axis=0).T).sum() > FAR_M
    assert np.isnan(far)


def test_pairs_that_only_link_to_each_other_have_no_length(world, views, verified):
    hanging = np.repeat(world.poses[:1], len(world.poses), axis=0)  # odometry that tells no length at all
    assert np.isnan(pair_lengths(views.bearings, verified, hanging)).all()


@pytest.mark.parametrize("factor", [0.2, 3.0])
def test_motions_over_which_wheels_slipped_are_those_of_the_images(world, views, verified, factor: float):
    steps, odometry = slipping(world, factor)
    found = driven_steps(steps, odometry_sigmas(steps), verified, pair_lengths(views.bearings, verified, odometry))
    assert set(SLIPPED) <= set(found.slipped)
    assert SLIPPED[0] - 8 < found.slipped.min()
    assert found.slipped.max() < SLIPPED[-1] + 8
    others = np.setdiff1d(np.arange(len(steps)), found.slipped)
    assert (found.motions[others] == steps[others]).all()
    assert (found.sigmas[others] == odometry_sigmas(steps)[others]).all()
    true = between(world.poses[:-1], world.poses[1:])
    assert np.abs(found.motions - true)[SLIPPED, :2].max() < 0.15
    assert np.abs(steps - true)[SLIPPED, :2].max() > 0.3
    assert np.degrees(np.abs(found.motions - true)[SLIPPED, 2].max()) < 1.0
    assert (found.sigmas[SLIPPED, 0] > 0.05).all()


def test_odometry_that_does_not_slip_is_kept(world, views, verified):
    steps, odometry = slipping(world, 1.0)
    found = driven_steps(steps, odometry_sigmas(steps), verified, pair_lengths(views.bearings, verified, odometry))
    assert not len(found.slipped)
    assert (found.motions == steps).all()


@pytest.mark.parametrize("factor", [0.2, 3.0])
def test_a_map_of_a_drive_that_slipped_is_as_accurate_as_another(world, views, similarity, factor: float):
    _, odometry = slipping(world, factor)
    found = adjusted_drive(views, iter(similarity), odometry, seen_in(views), None, np.random.default_rng(3))
    assert misplaced(odometry, world.poses)[0] > 0.6
    assert misplaced(found.poses, world.poses)[0] < 0.05
    assert set(SLIPPED) <= set(found.slipped)
