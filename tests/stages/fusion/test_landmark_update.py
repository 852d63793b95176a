import math

import numpy as np
import pytest
from made_beliefs import even, scattered_around
from made_ticks import at_tick

from omninav.pipeline import Context
from omninav.stages.fusion.landmark_update import LandmarkUpdate, LandmarkUpdateState
from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.values.belief import Particles
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.pose import Motion
from omninav.stages.values.track import Track

HERE, THERE, AWAY = np.array([2.0, 3.0, 1.0]), np.array([6.0, 2.5, -2.5]), np.array([20.0, 0.0, 0.0])
SURE = np.diag([0.005, 0.005, math.radians(0.1)]) ** 2


def belief(mean: np.ndarray, spread: float = 0.2, number: int = 500) -> Particles:
    return scattered_around(mean, spread * np.array([1.0, 1.0, 0.3]), number)


def fix_at(*poses: np.ndarray, probabilities: tuple[float, ...] = (0.99,)) -> LandmarkFix:
    number = len(poses)
    return LandmarkFix(
        np.array(poses).reshape(-1, 3), np.tile(SURE, (number, 1, 1)), np.full(number, 60), np.array(probabilities), 100
    )


def updated(
    now: Particles,
    *fixes: LandmarkFix | None,
    motion: Motion | None = None,
    carried_at: int | None = None,
    first: bool = False,
) -> Particles:
    """The belief after some fixes; at the one with the number `carried_at` the robot is seen to be carried."""
    stage, ctx, last = LandmarkUpdate(), at_tick(1, first), LandmarkUpdateState()
    for n, fix in enumerate(fixes):
        now = stage.step(ctx, last, now, fix, motion, track=Track(False, n == carried_at)).belief
    return now


def share_at(now: Particles, pose: np.ndarray, within: float = 0.3) -> float:
    return float(now.weights[np.hypot(*(now.poses - pose)[:, :2].T) < within].sum())


def test_a_belief_of_decimetres_takes_in_millimetres() -> None:
    found = updated(belief(HERE), fix_at(HERE + np.array([0.08, -0.05, 0.02]), probabilities=(0.9997,))).estimate()
    assert np.hypot(found.pose.x - HERE[0] - 0.08, found.pose.y - HERE[1] + 0.05) < 0.002
    assert found.pose.heading == pytest.approx(HERE[2] + 0.02, abs=math.radians(0.05))
    assert np.sqrt(np.diag(found.covariance))[:2] == pytest.approx(0.005, rel=0.3)


def test_a_sharp_belief_and_a_fix_as_sharp_meet_half_way() -> None:
    sharp = scattered_around(HERE, np.sqrt(np.diag(SURE)), 5000)
    found = updated(sharp, fix_at(HERE + np.array([0.01, 0.0, 0.0]))).estimate()
    assert found.pose.x == pytest.approx(HERE[0] + 0.005, abs=0.001)
    # Not 1 / sqrt(2) of it: their errors are shared.
    assert math.sqrt(found.covariance[0, 0]) == pytest.approx(0.005, rel=0.2)


def test_a_robot_that_stands_is_no_surer_after_fifty_images_than_after_one() -> None:
    once, often = (updated(belief(HERE), *[fix_at(HERE)] * times).estimate() for times in (1, 50))
    assert np.sqrt(np.diag(often.covariance)) == pytest.approx(np.sqrt(np.diag(once.covariance)), rel=0.5)


def test_headings_meet_across_the_seam_of_the_circle() -> None:
    west = np.array([3.0, 3.0, math.pi - 0.02])
    found = updated(belief(west), fix_at(np.array([3.0, 3.0, -math.pi + 0.02]))).estimate()
    assert abs(abs(found.pose.heading) - math.pi + 0.02) < math.radians(0.3)
    assert found.mode_weight > 0.9


def test_one_fix_elsewhere_does_not_wipe_out_the_belief() -> None:
    once = updated(belief(HERE), fix_at(THERE))
    # 0.01 / 20 of it may be right all the same, and a robot is carried there with 0.001 x 0.99.
    assert share_at(once, HERE, 1.0) == pytest.approx(0.0005 / (0.0005 + 0.00099), rel=1e-6)
    assert (np.hypot(*(once.poses - HERE)[:, :2].T) < 1.0).sum() >= 20
    back = updated(once, fix_at(HERE), fix_at(HERE))
    assert share_at(back, HERE) > 0.9


def test_of_two_poses_the_one_where_the_belief_is_wins() -> None:
    found = updated(belief(HERE), fix_at(THERE, HERE, probabilities=(0.5, 0.49)))
    assert share_at(found, HERE) > 0.9


def test_without_a_fix_the_belief_stays_as_it_is() -> None:
    now = belief(HERE)
    assert updated(now, None) is now
    assert updated(now, fix_at(probabilities=())) is now


def test_a_pose_that_is_rather_wrong_proposes_no_place() -> None:
    found = updated(belief(HERE), fix_at(THERE, probabilities=(0.45,)))
    assert share_at(found, THERE, 1.0) == 0.0
    assert share_at(updated(belief(HERE), fix_at(THERE, probabilities=(0.5,))), THERE, 1.0) > 0.0


def test_a_robot_that_was_carried_is_looked_for_by_poses_that_are_rather_wrong_until_one_is_sure() -> None:
    poor, sharp, still = fix_at(THERE, probabilities=(0.4,)), belief(HERE, 0.02), Motion(0.0, 0.0, 0.0)
    assert share_at(updated(sharp, poor, motion=still), THERE) == 0.0
    there = pytest.approx(0.5 * 0.4 / (0.5 * 0.4 + 0.6 / 20))
    assert share_at(updated(sharp, poor, motion=still, carried_at=0), THERE) == there
    assert share_at(updated(sharp, None, None, poor, motion=still, carried_at=0), THERE) == there  # also a later image
    found = updated(sharp, None, fix_at(HERE), poor, motion=still, carried_at=0)  # it was put down where it was
    assert share_at(found, HERE) > 0.9


def test_a_robot_that_may_start_anywhere_is_looked_for_by_poses_that_are_rather_wrong() -> None:
    poor = fix_at(THERE, probabilities=(0.3,))
    assert share_at(updated(belief(HERE, 20.0), poor, first=True), THERE) > 0.7
    assert share_at(updated(belief(HERE, 20.0), poor), THERE) < 0.1  # later, it is the belief that knows
    assert share_at(updated(belief(HERE, 0.5), poor, first=True), THERE) == 0.0


def heaps(*shares: float, at: tuple[np.ndarray, ...] = (HERE, THERE)) -> Particles:
    """A hundred particles in one spot at each of some poses, which have these shares of the belief."""
    return Particles(np.repeat(at, 100, axis=0), np.repeat(shares, 100) / 100)


def test_what_landmarks_say_is_bayes_rule_over_the_poses_that_are_right_or_wrong() -> None:
    # The fix is one standard deviation off in x, and one in heading, across the seam of the circle.
    west, wide = np.array([2.1, 3.0, -math.pi + 0.05]), np.diag([0.1, 0.1, 0.1]) ** 2
    fix = LandmarkFix(west[None], wide[None], np.array([60]), np.array([0.9]), 100)
    out = updated(heaps(0.07, 0.93, at=(np.array([2.0, 3.0, math.pi - 0.05]), THERE)), fix)
    assert (len(out.poses), out.recovery_particles) == (50 + 200 + 200, 200)
    parts = np.array([0.1 / 20, 0.07 * 0.9 * math.exp(-0.5 * 2.0), 1e-3 * 0.9])  # as before, on the spot, carried
    sums = [each.sum() for each in np.split(out.weights, [50, 250])]
    assert sums == pytest.approx(parts / parts.sum(), rel=1e-6)


def test_a_fix_that_repeats_the_last_one_counts_by_the_way_driven_since() -> None:
    # 1.5 m of four length scales of 0.75 m: half of its evidence is new.
    there, ctx = np.array([6.0, 2.5, 0.0]), Context("update", np.random.default_rng(0))
    last = LandmarkUpdateState(poses=there[None] - [0.9, 1.2, 0.0])
    how = fix_at(there, probabilities=(0.9,)), Motion(0.9, 1.2, 0.0), LengthScale(0.75)
    out = LandmarkUpdate().step(ctx, last, heaps(0.6, 0.4, at=(HERE, there)), *how).belief
    counted = 0.905**-0.5
    new = 1e-3 * 0.5 * 0.9**0.5
    parts = np.array([0.6 * 0.005**0.5 + 0.4 * 0.005 * counted, 0.4 * 0.9 * counted, new])
    sums = [each.sum() for each in np.split(out.weights, [len(out.weights) - 400, len(out.weights) - 200])]
    assert sums == pytest.approx(parts / parts.sum(), rel=1e-6)
    assert last.driven == 0.0


def test_a_carried_robot_is_elsewhere_the_less_the_likelier_the_poses_were_that_it_was_looked_for_at() -> None:
    ctx, last = Context("update", np.random.default_rng(0)), LandmarkUpdateState(elsewhere=0.5)
    few = fix_at(THERE, HERE, THERE + AWAY, probabilities=(0.3, 0.15, 0.05))
    LandmarkUpdate().step(ctx, last, belief(HERE), few, Motion(0.0, 0.0, 0.0))
    assert last.elsewhere == pytest.approx(0.5 * (1.0 - 0.45))  # one of 0.05 is no place to look


def test_images_of_one_place_that_mislead_alike_do_not_add_up() -> None:
    misled = [fix_at(THERE, probabilities=(0.6,))] * 8
    standing, driving = Motion(0.0, 0.0, 0.0), Motion(2.0, 0.0, 0.0)
    now = belief(HERE, 0.02)
    assert share_at(updated(now, *misled, motion=standing), HERE) > 0.9
    along = [fix_at(compose(THERE, np.array([2.0 * n, 0.0, 0.0])), probabilities=(0.6,)) for n in range(8)]
    stage, ctx, last = LandmarkUpdate(), Context("update", np.random.default_rng(0)), LandmarkUpdateState()
    for n, fix in enumerate(along):
        now = stage.step(ctx, last, now, fix, driving if n else standing).belief
        now = Particles(compose(now.poses, np.array([2.0, 0.0, 0.0])), now.weights)
    assert share_at(now, HERE + 8 * 2.0 * np.array([math.cos(1.0), math.sin(1.0), 0.0])) < 0.1  # each image is new


@pytest.mark.parametrize("where", [HERE, THERE])
def test_weights_are_shares_and_recovery_particles_come_last(where) -> None:
    found = updated(belief(HERE), fix_at(where))
    assert found.weights.sum() == pytest.approx(1.0)
    assert np.isfinite(found.poses).all()
    assert np.abs(found.poses[:, 2]).max() <= math.pi
    assert 0 < found.recovery_particles < len(found.poses)
    assert np.hypot(*(found.poses[-found.recovery_particles :] - where)[:, :2].T).max() < 0.05


def test_the_number_of_particles_does_not_grow_from_image_to_image() -> None:
    now, sizes = belief(HERE), []
    for _ in range(12):
        now = updated(now, fix_at(HERE))
        sizes.append(len(now.poses))
    assert max(sizes) < 2 * len(belief(HERE).poses)
    assert sizes[-1] <= sizes[0]


def test_after_a_restart_a_standing_robot_is_found_by_the_landmarks_it_saw_before() -> None:
    rng = np.random.default_rng(3)
    anywhere = even(rng.uniform([-10.0, -10.0, -3.0], [10.0, 10.0, 3.0], (5000, 3)))
    stage, ctx, last = LandmarkUpdate(), Context("update", rng), LandmarkUpdateState()
    _, same, again = (
        stage.step(ctx, last, anywhere, fix_at(HERE), Motion(0.0, 0.0, 0.0), restart=asked).belief
        for asked in (None, None, Reinitialise())
    )
    assert share_at(again, HERE) > 0.5 > 5.0 * share_at(same, HERE)  # without, it is the same image once more
