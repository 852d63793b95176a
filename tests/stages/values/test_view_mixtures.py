import numpy as np

from omninav.stages.values.view_mixtures import ViewMixtures


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
