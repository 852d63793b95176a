import math

import numpy as np
import pytest
from landmark_tour import room, seen_from

from omninav.stages.features.rotation_reduced_sift import none_found
from omninav.stages.geometry.landmarks.unbroken_view import of_one_place
from omninav.stages.values.local_features import LocalFeatures

HERE = np.array([5.3, 3.2, 0.4])


def alike(one: LocalFeatures, other: LocalFeatures, turn: float) -> bool:
    return of_one_place((one.bearings, one.descriptors), (other.bearings, other.descriptors), turn)


@pytest.mark.parametrize(("ahead", "same"), [(0.0, True), (0.05, True), (0.6, False), (1.5, False)])
def test_images_of_one_place_differ_by_a_turn_alone(ahead: float, same: bool) -> None:
    turn = math.radians(90.0)
    there = seen_from(room(), HERE + np.array([ahead, 0.0, turn]))
    assert alike(seen_from(room(), HERE), there, turn) is same
    assert not alike(seen_from(room(), HERE), there, -turn)


def test_what_shows_too_few_features_or_another_room_is_of_no_place() -> None:
    assert not alike(seen_from(room(), HERE), none_found(), 0.0)
    assert not alike(seen_from(room(), HERE), seen_from(room(seed=5), HERE), 0.0)
