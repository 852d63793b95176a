"""How often the believed place is the right one, on a drive along four places."""

import dataclasses

import numpy as np
import pytest
from made_places import made_map
from measured_drives import AT_ORIGIN, figures, made_drive, on_x

from omninav.stages.metrics.place_accuracy import PlaceAccuracy
from omninav.stages.values.belief import PlaceBelief

ROW = made_map([(0.0, 0.0), (2.0, 0.0), (4.0, 0.0), (6.0, 0.0)], {(0, 1): 0, (1, 2): 0, (2, 3): 0})
UPDATES = "omninav.stages.metrics.place_accuracy.UPDATES"


def believed(place: int | None, map=ROW) -> PlaceBelief | None:
    return None if place is None else PlaceBelief(np.eye(len(map))[place], map.poses[: len(map)])


def hits(places, truth, begun=(0,), map=ROW):
    """Measures a robot that believes to be at these places, at true poses; its belief began in these frames."""
    begins = [believed(0, map) if k in begun else None for k in range(len(truth))]
    found = figures(PlaceAccuracy(), made_drive(truth), [believed(place, map) for place in places], begins, map)
    return found and found["localisation"]


def test_figures_are_shares_and_medians_over_all_images():
    found = hits([0, 0, 1, 2, 3], on_x([0.1, 0.1, 4.0, 4.25, 0.0]))
    # The believed medoids are 0.1, 0.1, 2, 0.25 and 6 m away, the nearest 0.1, 0.1, 0, 0.25 and 0.
    assert (found["images"], found["accuracy"], found["adjacent_accuracy"]) == (5, 3 / 5, 4 / 5)
    assert (found["place_distance_m"], found["nearest_place_distance_m"]) == pytest.approx((0.25, 0.1))
    assert found["adjacent_accuracy_after"] == [1.0, 1.0, 1.0, 1.0, 0.0]


def test_updates_are_counted_from_where_the_belief_began():
    found = hits([3, 0, 0, 0, 3], [AT_ORIGIN] * 5, {0, 3})
    assert found["accuracy_after"] == [0.5, 0.5, 1.0, None, None]


def test_a_long_place_is_right_where_one_of_its_images_was_taken_closest(monkeypatch: pytest.MonkeyPatch):
    made = made_map([(0.0, 0.0), (2.0, 0.0)], {(0, 1): 1})
    poses = made.poses.copy()
    poses[2, 0] = 1.2  # the path image on the way, which belongs to the first place
    monkeypatch.setattr(UPDATES, 1)
    found = hits([0], on_x([1.25]), map=dataclasses.replace(made, poses=poses))
    assert (found["accuracy_after"], found["image_accuracy_after"]) == ([0.0], [1.0])


def test_a_medoid_hardly_further_than_the_closest_counts_as_beside_it(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(UPDATES, 1)
    apart = hits([0, 0, 1], on_x([1.25, 1.3125, 1.3]), {0, 1, 2})  # medoids are at 0 and 2 m
    assert apart["accuracy_after"] == [pytest.approx(1 / 3)]
    assert apart["tolerant_accuracy_after"] == [pytest.approx(2 / 3)]  # half a metre further, and a little more


def test_pictures_without_truth_do_not_count():
    assert hits([0, 1], on_x([None, 2.0]))["images"] == 1
    assert hits([0], [None]) is None


def test_an_image_without_a_belief_is_an_update_that_does_not_count_and_odometry_is_no_truth():
    given = [0, None, 1], [AT_ORIGIN] * 3
    found = hits(*given)
    assert found["accuracy_after"] == [1.0, None, 0.0, None, None]
    assert found["images"] == 2
    assert hits(*given, map=dataclasses.replace(ROW, pose_source="odometry")) is None


def test_places_beside_each_other_are_near_in_any_direction():
    corner = made_map([(0.0, 0.0), (0.0, 2.0), (2.0, 2.0)], {(0, 1): 0, (1, 2): 0})
    found = hits([2, 0], [(0.0, 1.9, 0.0), (1.9, 1.9, 0.0)], map=corner)
    assert (found["accuracy"], found["adjacent_accuracy"]) == (0.0, 0.5)
    assert found["place_distance_m"] == pytest.approx((np.hypot(2.0, 0.1) + np.hypot(1.9, 1.9)) / 2)
