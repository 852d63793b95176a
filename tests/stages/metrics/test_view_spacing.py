import numpy as np
import pytest
from measured_drives import figures, made_drive

from omninav.stages.metrics.view_spacing import ViewSpacing, spaced
from omninav.stages.values.view_mixtures import ViewMixtures
from omninav.stages.values.views import Coefficients


def a_map(views, places):
    known = ViewMixtures.empty()
    for view, (x, y) in zip(views, places, strict=True):
        row = known.add_view(np.array(view, np.float32), "Coefficients")
        known.add_component(row, np.array([50.0, 50.0, 0.0]), np.eye(3), 0.1, 1.0)  # lighter: it does not count
        known.add_component(row, np.array([x, y, 0.0]), np.eye(3), 0.9, 1.0)
    return known


def spacing(known, turned=0.0):
    view = Coefficients(np.zeros(2, np.float32), np.full((36, 2), turned, np.float32))
    return figures(ViewSpacing(), made_drive([]), known, view)


def test_each_view_is_as_far_as_its_nearest_other_one_in_views_and_in_metres():
    found = spacing(a_map([(0, 0), (3, 4), (3, 5), (10, 5)], [(0, 0), (0, 2), (0, 4), (0, 6)]))["spacing"]
    assert found["between_views"]["mean"] == pytest.approx((5 + 1 + 1 + 7) / 4)
    assert found["between_places_m"]["mean"] == pytest.approx(2.0)
    assert found["between_places_m"]["unevenness"] == 0.0
    assert found["between_views"]["unevenness"] == pytest.approx(np.std([5, 1, 1, 7]) / 3.5)


def test_views_that_are_all_alike_have_no_unevenness():
    assert spaced(np.zeros(4))["unevenness"] is None


def test_figures_are_those_of_the_distances():
    assert spaced(np.array([1.0, 2.0, 4.0, 9.0])) == {
        "mean": 4.0,
        "median": 3.0,
        "p10": pytest.approx(1.3),
        "p90": pytest.approx(7.5),
        "unevenness": pytest.approx(np.std([1.0, 2.0, 4.0, 9.0]) / 4.0),
    }


def test_places_lie_apart_in_any_direction_and_three_views_are_enough():
    found = spacing(a_map([(0, 0), (3, 4), (9, 9)], [(0, 0), (3, 4), (0, 12)]))["spacing"]
    assert found["between_places_m"]["mean"] == pytest.approx((5.0 + 5.0 + np.hypot(3, 8)) / 3)
    assert spacing(a_map([(0, 0), (1, 1)], [(0, 0), (1, 0)])) == {}


def test_a_view_that_was_seen_turned_is_compared_as_it_is_kept():
    known = a_map([(0, 0), (1, 0), (3, 0)], [(0, 0), (1, 0), (2, 0)])
    found = spacing(known, turned=3.0)["spacing"]
    assert found["between_views"]["mean"] == pytest.approx((1 + 1 + 2) / 3)


def test_of_more_than_five_hundred_views_so_many_are_asked():
    xs = np.arange(510.0)
    xs[255] = 254.5  # between two that are asked or not
    known = a_map([(x, 0) for x in xs], [(x, 0) for x in xs])
    rows = np.unique(np.linspace(0, 509, 500).round().astype(int))
    apart = np.minimum(np.diff(xs, prepend=-np.inf), np.diff(xs, append=np.inf))
    found = spacing(known)["spacing"]["between_places_m"]
    assert found["mean"] == pytest.approx(apart[rows].mean(), rel=1e-9)
