import numpy as np
import pytest

from omninav.pipeline import BadInput
from omninav.stages.values.map_places import map_poses
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Coefficients, NoveltyThreshold


def three_views() -> ViewMixtures:
    """Views of 2 numbers with 1, 2 and 1 components, whose weights are 0.1 to 0.4; a step after each view."""
    map = ViewMixtures.empty()
    for parts in (1, 2, 1):
        row = map.add_view(np.full(2, len(map), np.float32), "Coefficients")
        for at in range(len(map.weights), len(map.weights) + parts):
            assert map.add_component(row, np.full(3, at), np.eye(3), 0.1 * (at + 1), at + 1.0) == at
        map.step()
    return map


def test_a_view_that_goes_takes_its_components_along_and_its_id_is_not_used_again() -> None:
    map = three_views()
    map.keep_views(np.array([True, False, True]))
    assert (map.ids.tolist(), map.born.tolist(), map.views[:, 0].tolist()) == ([0, 2], [0, 2], [0.0, 2.0])
    assert (map.owner.tolist(), map.weights.tolist(), map.counts.tolist()) == ([0, 1], [0.1, 0.4], [1.0, 4.0])
    map.forget_all()
    assert (len(map), len(map.weights), map.add_view(np.ones(2, np.float32), "Coefficients")) == (0, 0, 0)
    assert (map.ids.tolist(), map.born.tolist()) == ([3], [3])


def test_new_mixtures_stand_in_place_of_those_of_their_views_alone() -> None:
    map = three_views()
    map.put_mixtures(np.array([1]), np.full((1, 3), 9.0), np.eye(3)[None], np.array([0.5]), np.array([7.0]))
    assert (map.owner.tolist(), map.means[:, 0].tolist()) == ([0, 2, 1], [0.0, 3.0, 9.0])
    assert map_poses(map) is map.means


def test_views_of_another_kind_or_size_are_refused_and_only_a_settled_threshold_is_kept() -> None:
    map = three_views()
    map.check_kind(Coefficients(np.ones(2, np.float32), np.ones((1, 2), np.float32)))
    with pytest.raises(BadInput, match="are Coefficients of 2 numbers, the current one is Coefficients of 3"):
        map.check_kind(Coefficients(np.ones(3, np.float32), np.ones((1, 3), np.float32)))
    for size, kind in ((3, "Coefficients"), (2, "Spectrum")):
        with pytest.raises(ValueError, match=f"{kind} of {size} numbers in a map of Coefficients of 2"):
            map.add_view(np.ones(size, np.float32), kind)
    for threshold, kept in ((None, None), (NoveltyThreshold(1.0, False), None), (NoveltyThreshold(2.0), 2.0)):
        map.keep_threshold(threshold)
        assert (map.threshold and map.threshold.distance) == kept
    before = map.owner.tolist()
    map.keep_views(np.ones(3, np.bool_))
    assert (map.owner.tolist(), map.steps) == (before, 3)
