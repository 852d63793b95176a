"""Random problems of two views, their solvers, and what is said of them."""

import math

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.two_views.epipolar import eight_points, shared_residuals
from omninav.stages.homing.generate_and_select import generate_and_select
from omninav.stages.homing.two_view_pose import TwoViewPose
from omninav.stages.metrics.two_view_errors import TwoViewErrors
from omninav.stages.source.two_views import TwoViews, TwoViewsState
from omninav.stages.values.two_views import BearingPairs


def problems(seed: int = 0, **how) -> list[TwoViews.Out]:
    source, ctx, posed = TwoViews(**how), Context("source", np.random.default_rng(seed)), TwoViewsState()
    source.setup(ctx)
    found = []
    while (out := source.step(ctx, posed)) is not None:
        found.append(out)
    return found


@pytest.mark.parametrize("planar", [True, False])
def test_pairs_that_are_not_wrong_fit_the_true_pose_and_the_others_do_not(
    monkeypatch: pytest.MonkeyPatch, planar: bool
) -> None:
    monkeypatch.setattr("omninav.stages.source.two_views.OUTLIER_RATIO", 0.3)
    made = problems(problems=3, planar=planar, noise_deg=0.0)
    assert [out.tick.index for out in made] == [0, 1, 2]
    for out in made:
        truth, pairs = out.truth, out.pairs
        residuals = shared_residuals(truth.rotation, truth.translation, pairs.first, pairs.second)
        assert residuals[truth.inliers] == pytest.approx(np.zeros(70), abs=1e-7)
        assert np.median(residuals[~truth.inliers]) > 0.1
        assert np.linalg.norm(truth.translation) == pytest.approx(1.0)
        assert np.linalg.det(truth.rotation) == pytest.approx(1.0)
        assert planar == (truth.translation[2] == 0.0)


def test_points_keep_within_the_elevations_of_a_camera() -> None:
    for out in problems(problems=2, max_elevation_deg=30.0, noise_deg=0.0):
        assert np.abs(out.pairs.first[:, 2]).max() <= math.sin(math.radians(30.0)) + 1e-12


def test_every_problem_of_a_robot_on_a_floor_is_solved() -> None:
    made, ctx = problems(problems=30), Context("homing", np.random.default_rng(1))
    found = [TwoViewPose().step(ctx, out.pairs).view for out in made]
    metrics = TwoViewErrors().step(ctx, [out.truth for out in made], found).metrics.values["two_views"]
    assert metrics["success_rate"] == 1.0
    assert metrics["direction_error_deg"]["median"] < 0.2
    assert metrics["rotation_error_deg"]["p95"] < 0.4


def test_generate_and_select_solves_what_has_few_wrong_pairs_and_not_what_has_many(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    shares = {}
    for wrong in (0.0, 0.05, 0.5):
        right = []
        monkeypatch.setattr("omninav.stages.source.two_views.OUTLIER_RATIO", wrong)
        for out in problems(problems=10, planar=False, noise_deg=0.05):
            view = TwoViewPose(solver="generate_and_select").step(Context("pose"), out.pairs).view
            assert view is not None
            right.append(float(view.translation @ out.truth.translation) > math.cos(math.radians(3.0)))
        shares[wrong] = np.mean(right)
    assert shares[0.0] == 1.0
    assert shares[0.0] >= shares[0.05] > shares[0.5]


def test_generate_and_select_solves_eight_pairs_and_no_fewer() -> None:
    pairs = problems(problems=1)[0].pairs
    found = [generate_and_select(pairs.first[:n], pairs.second[:n], math.radians(1.0)) for n in (7, 8)]
    assert [each is None for each in found] == [True, False]


def test_generate_and_select_begins_with_all_pairs_and_ends_with_the_smallest_share(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    sizes: list[int] = []

    def counted(first: Array, second: Array) -> tuple[Array, Array]:
        sizes.append(len(first))
        return eight_points(first, second)

    monkeypatch.setattr("omninav.stages.homing.generate_and_select.eight_points", counted)
    pairs = problems(problems=1)[0].pairs
    generate_and_select(pairs.first, pairs.second, math.radians(1.0))
    total = len(pairs.first)
    assert (sizes[0], sizes[-1], len(set(sizes))) == (total, round(0.3 * total), 20)


def test_too_few_pairs_are_counted() -> None:
    ctx = Context("homing")
    assert TwoViewPose().step(ctx, BearingPairs(np.zeros((1, 3)), np.zeros((1, 3)))).view is None
    assert ctx.counts["no_relative_pose"] == 1
