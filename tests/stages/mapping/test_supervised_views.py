"""A map of views at their true poses."""

import math

import numpy as np
import pytest

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.mapping.supervised_views import SupervisedViews
from omninav.stages.values.pose import Pose
from omninav.stages.values.projection import Projection
from omninav.stages.values.views import Coefficients

VIEWS = [Coefficients(row, row[None]) for row in np.random.default_rng(0).normal(size=(4, 12)).astype(np.float32)]
POSES = [Pose(1.0, 2.0, 3.0), None, Pose(4.0, 5.0, -3.0), Pose(6.0, 7.0, 0.0)]


def test_a_supervised_map_has_each_view_at_its_true_pose(monkeypatch: pytest.MonkeyPatch) -> None:
    projection = Projection(np.eye(5, 12, dtype=np.float32), np.ones(5))
    monkeypatch.setattr("omninav.stages.mapping.supervised_views.SIGMA_M", 0.5)
    monkeypatch.setattr("omninav.stages.mapping.supervised_views.SIGMA_DEG", 90.0)
    stage, context = SupervisedViews(), Context("mapping")
    made = stage.step(context, [*VIEWS[:3], None], POSES, projection).map
    assert made.means.tolist() == [[1.0, 2.0, 3.0], [4.0, 5.0, -3.0]]
    assert made.owner.tolist() == [0, 1]
    assert made.covariances[1] == pytest.approx(np.diag([0.25, 0.25, math.pi**2 / 4]))
    assert made.views == pytest.approx(np.stack([VIEWS[0].values[:5], VIEWS[2].values[:5]]))
    assert (made.kind, made.pose_source, made.steps) == ("Coefficients", "truth", 2)
    assert made.born.tolist() == [0, 1]
    assert made.weights.tolist() == made.counts.tolist() == [1.0, 1.0]
    assert context.counts["view_without_pose"] == 2
    assert context.facts["map_poses"] == "truth"


def test_without_a_projection_views_are_stored_as_they_are() -> None:
    made = SupervisedViews().step(Context("mapping"), VIEWS[:1], POSES[:1]).map
    np.testing.assert_array_equal(made.views[0], VIEWS[0].values)


def test_a_tour_without_truth_makes_no_map() -> None:
    with pytest.raises(BadInput, match="no ground truth"):
        SupervisedViews().step(Context("mapping"), VIEWS, [None] * 4)
