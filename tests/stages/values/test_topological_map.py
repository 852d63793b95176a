"""Places 0, 1, 2 in a row, of views 0, 2 and 3; view 1 lies between the first two, driven from place 1 to place 0."""

from dataclasses import replace

import numpy as np

from omninav.stages.values.local_features import GlobalDescriptor, LocalFeatures, VerticalSegments
from omninav.stages.values.topological_map import ANGLE, TopologicalMap, stored

AZIMUTHS, ELEVATIONS = np.array([np.pi - ANGLE, -np.pi / 2, 1.0]), np.array([0.5, -np.pi / 6, 0.0])
LEVEL = np.cos(ELEVATIONS)
ALL = LocalFeatures(
    np.column_stack([LEVEL * np.cos(AZIMUTHS), LEVEL * np.sin(AZIMUTHS), np.sin(ELEVATIONS)]),
    np.zeros((3, 2)),
    np.repeat(np.array([[10], [11], [12]], np.uint8), 128, axis=1),
    np.full((3, 3), -1.0, np.float32),
    np.array([0.2, 7.4, 900.0], np.float32),
)
COLUMN = VerticalSegments(
    *(np.array([2.0]), np.array([[0.5, -0.25]]), np.full((1, 10), 0.5, np.float32), np.full(1, 300, np.float32)),
    np.zeros((1, 2, 2)),
)
VIEWS = [ALL, replace(ALL.chosen(slice(2, 3)), columns=COLUMN), ALL.chosen(slice(1, 3)), ALL.chosen(slice(0, 0))]
MAP = TopologicalMap(
    stored(VIEWS, [GlobalDescriptor(np.full(3, 0.25 * k, np.float32)) for k in range(4)]),
    *(np.array([0, 2, 3]), np.array([0, 0, 1, 2]), ("door", "", "door")),  # places, owner, names
    *(np.array([[1, 0], [1, 2]]), np.zeros(2, np.int8), np.array([0, 1, 1]), np.array([1])),  # links and their ways
    *(np.arange(4), np.arange(4)),
    poses=np.array([[0.0, 0.0, 0.0], [9.0, 9.0, 0.0], [2.0, 0.0, 0.0], [2.0, 3.0, 0.0]]),
    pose_source="truth",
    spread=1.0,
)


def test_a_view_comes_back_from_the_map_to_half_a_step_of_each_number() -> None:
    for number, view in enumerate(VIEWS):
        found = MAP.views.features(number)
        np.testing.assert_allclose(found.bearings, view.bearings, atol=0.8 * ANGLE)
        assert (found.descriptors == view.descriptors).all()
        assert (found.colours == -1.0).all()
        assert MAP.views.global_moments(number).values.tolist() == [0.25 * number] * 3
    assert MAP.views.features(0).sizes.tolist() == [1.0, 7.0, 255.0]
    assert MAP.views.features(0).columns is MAP.views.features(2).columns is None
    column = MAP.views.features(1).columns
    assert column is not None
    np.testing.assert_allclose(np.append(column.azimuths, column.elevations), [2.0, 0.5, -0.25], atol=ANGLE / 2)
    assert (column.descriptors[0, 9], column.weights[0]) == (0.5, 255.0)


def test_a_way_is_driven_in_either_direction_and_counts_its_views_at_each_place() -> None:
    assert [MAP.link(0, 1), MAP.link(1, 2), MAP.link(0, 2)] == [0, 1, None]
    assert MAP.whole_way(0).tolist() == [2, 1, 0]
    assert [part.tolist() for part in MAP.views_along(np.array([0, 1, 2]))] == [[0, 1, 2, 3], [1, 3, 4]]
    assert [part.tolist() for part in MAP.views_along(np.array([2, 1, 0]))] == [[3, 2, 1, 0], [1, 2, 4]]


def test_places_are_found_by_where_their_medoids_were_taken_and_by_name() -> None:
    assert MAP.nearest_places(np.array([[0.9, 0.0], [9.0, 9.0], [2.0, 1.4]])).tolist() == [0, 2, 1]
    assert MAP.named("door").tolist() == [0, 2]
