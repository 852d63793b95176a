import numpy as np
import pytest

from omninav.stages.geometry.appearance.place_clusters import medoids
from omninav.stages.mapping.merged_places import distances_along, merged_places, same_spots

NUMBER = 12
AT = np.concatenate([np.arange(NUMBER), np.arange(NUMBER) + 0.1])
"""Where the views of two passes over one way were taken."""
DISTANCES = 0.05 * np.abs(AT[:, None] - AT)
SHARES = np.where(np.abs(AT[:, None] - AT) < 0.5, 0.6, 0.1)
PLACE = np.concatenate([np.arange(NUMBER) // 4, 3 + (np.arange(NUMBER) + 2) // 4])
"""Clusters of four views, which on the second pass begin two views earlier."""
NEW = np.full(2 * NUMBER, -1)
ALONG = np.array([(n, n + 1) for n in range(2 * NUMBER - 1) if n != NUMBER - 1])
ACCEPTED = np.array([[5, NUMBER + 5]])


def edges() -> np.ndarray:
    return np.concatenate([ALONG, same_spots(SHARES, np.arange(2 * NUMBER), ACCEPTED, 0.4, 20.0)])


def test_pairs_of_one_spot_are_near_an_accepted_one() -> None:
    orders = np.arange(2 * NUMBER)
    assert same_spots(SHARES, orders, ACCEPTED, 0.4, 20.0).tolist() == [[n, n + NUMBER] for n in range(NUMBER)]
    assert same_spots(SHARES, orders, ACCEPTED, 0.4, 4.0).tolist() == [[n, n + NUMBER] for n in range(3, 8)]
    assert len(same_spots(SHARES, orders, ACCEPTED[:0], 0.4, 20.0)) == 0
    assert len(same_spots(SHARES, orders, ACCEPTED, 0.7, 20.0)) == 0


def test_distances_go_along_the_drive_and_over_to_the_other_pass() -> None:
    found = distances_along(DISTANCES, edges(), np.array([2]))[0]
    assert found[NUMBER + 7] == pytest.approx(0.05 * 5.1)
    assert np.isinf(distances_along(DISTANCES, ALONG, np.array([2]))[0, NUMBER:]).all()


def test_places_side_by_side_are_merged_where_a_pair_was_accepted_and_views_go_to_the_nearest() -> None:
    place = merged_places(DISTANCES, edges(), PLACE, NEW, 0.12)
    assert PLACE.max() + 1 == 7
    assert place.max() + 1 == 3
    assert (place[:NUMBER] == place[NUMBER:]).mean() > 0.8
    middle = AT[medoids(DISTANCES, place)]
    nearest = np.abs(AT[:, None] - middle).min(axis=1)
    assert np.abs(AT - middle[place]) == pytest.approx(nearest, abs=0.2)
    apart = merged_places(DISTANCES, ALONG, PLACE, NEW, 0.12)
    assert not set(apart[:NUMBER]) & set(apart[NUMBER:])


def test_places_of_a_known_map_stay_and_new_views_go_to_them() -> None:
    known = np.where(np.arange(2 * NUMBER) < NUMBER, PLACE, -1)
    place = merged_places(DISTANCES, edges(), PLACE, known, 0.12)
    assert place[:NUMBER].tolist() == PLACE[:NUMBER].tolist()
    assert set(place) == {0, 1, 2}
