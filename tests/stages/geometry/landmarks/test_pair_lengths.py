import numpy as np
import pytest
from landmark_world import driven, misplaced, seen_in

from omninav.stages.geometry.landmarks.closures import FAR_M, TURN_SIGMA, VerifiedPairs, candidate_pairs, verified_pairs
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


POINTS = np.array([[0.2, 0.5, 0.1], [1.4, 2.0, 1.0], [0.5, -3.0, 0.2], [1.0, 50.0, 0.0], [2.0, -4.0, 1.0]])


def in_a_row(points: np.ndarray) -> tuple[np.ndarray, VerifiedPairs]:
    """Bearings of points from images at x = 0, 1 and 3 m, `points` (3, N, 3) as each sees them, and both motions."""
    bearings = points - np.array([[[0.0]], [[1.0]], [[3.0]]]) * [1.0, 0.0, 0.0]
    bearings /= np.linalg.norm(bearings, axis=2)[:, :, None]
    number = points.shape[1]
    rows, pairs = np.arange(3 * number).reshape(3, number), np.array([[0, 1], [1, 2]])
    matched = rows[:2].ravel(), rows[1:].ravel(), np.zeros(2 * number), np.repeat([0, 1], number)
    return bearings.reshape(-1, 3), VerifiedPairs(pairs, np.zeros(2), np.zeros(2), *matched)


def second_length(points: np.ndarray) -> float:
    """Length of the motion from the second image to the third, of which odometry tells nothing."""
    first, second = pair_lengths(*in_a_row(points), np.array([[0.0, 0, 0], [1.0, 0, 0], [1.01, 0, 0]]))
    assert first == pytest.approx(1.0, rel=1e-3)
    return float(second)


def test_features_in_common_tell_the_length_that_odometry_does_not():
    assert second_length(np.repeat(POINTS[None], 3, axis=0)) == pytest.approx(2.0, rel=1e-3)
    assert second_length(np.repeat(POINTS[None, 1:4], 3, axis=0)) == pytest.approx(2.0, rel=1e-3)
    assert np.isnan(second_length(np.repeat(POINTS[None, 1:3], 3, axis=0)))  # three are needed


@pytest.mark.parametrize(("image", "x"), [(0, 0.0), (2, 3.0)])
def test_features_without_parallax_or_that_would_lie_behind_tell_no_length(image: int, x: float):
    far = np.repeat(POINTS[None, :3], 3, axis=0)
    far[:, 2] = [0.5, 100.0, 0.0]  # 0.6 degrees from the first two images
    assert np.isnan(second_length(far))
    behind = np.repeat(POINTS[None, :3], 3, axis=0)
    behind[image, 2] = [2.0 * x, 0.0, 0.0] - behind[image, 2]
    assert np.isnan(second_length(behind))


def test_two_of_five_features_may_be_wrong():
    mistaken = np.repeat(POINTS[None], 3, axis=0)
    mistaken[2, [1, 4]] += [0.0, 3.0, 0.5]
    assert second_length(mistaken) == pytest.approx(2.0, rel=1e-3)


def rows_that_slipped(lengths, steps, order=None):
    """Rows that slipped among motions of these lengths and turns by odometry, (N, 2), and what they become."""
    number = len(lengths)
    order = np.arange(number) if order is None else order
    pairs = np.column_stack([order, order + 1])
    nothing = np.empty(0, np.int64)
    seen = VerifiedPairs(pairs, np.full(number, 0.2), np.full(number, np.pi / 2), nothing, nothing, nothing, nothing)
    motions = np.column_stack([steps[:, 0], np.zeros(number), steps[:, 1]])
    return driven_steps(motions, np.full((number, 3), 0.001), seen, np.asarray(lengths)[order])


@pytest.mark.parametrize(
    ("usual", "turn", "more", "found"),
    [
        (0.5, 0.0, 0.36, True),
        (0.5, 0.0, 0.32, False),  # 12 percent of the length of five motions
        (0.1, 0.0, 0.11, True),
        (0.1, 0.0, 0.09, False),
        (0.1, 0.1, 0.21, True),
        (0.1, 0.1, 0.19, False),  # a camera 0.2 m from the axis
    ],
)
def test_five_motions_tell_that_wheels_slipped(usual: float, turn: float, more: float, found: bool):
    lengths, steps = np.full(20, usual), np.tile([usual, turn], (20, 1))
    lengths[9] += more
    order = np.random.default_rng(0).permutation(20)
    steps_by = rows_that_slipped(lengths, steps, order)
    assert steps_by.slipped.tolist() == (list(range(5, 14)) if found else [])
    if found:
        assert steps_by.motions[9] == pytest.approx([0.0, usual + more, 0.2])
        assert steps_by.sigmas[9] == pytest.approx([0.05 + 0.1 * (usual + more)] * 2 + [TURN_SIGMA])
        assert (steps_by.sigmas[4] == 0.001).all()


@pytest.mark.parametrize(("share", "found"), [(1.05, 9), (1.07, 0)])
def test_lengths_that_differ_everywhere_tell_of_no_slip(share: float, found: int):
    lengths, steps = np.full(20, 0.5 * share), np.tile([0.5, 0.0], (20, 1))
    lengths[9] += 0.5
    assert len(rows_that_slipped(lengths, steps).slipped) == found


def test_four_motions_tell_of_no_slip():
    found = rows_that_slipped([3.0, 0.5, 0.5, 0.5], np.tile([0.5, 0.0], (4, 1)))
    assert found.slipped.tolist() == []
    assert (found.motions[:, 0] == 0.5).all()
