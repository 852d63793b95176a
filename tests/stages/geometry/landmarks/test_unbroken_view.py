import math

import numpy as np
import pytest
from landmark_tour import room, seen_from

from omninav.stages.features.rotation_reduced_sift import none_found
from omninav.stages.geometry.appearance.feature_matching import mutual_nearest_units
from omninav.stages.geometry.appearance.visual_words import root_descriptors
from omninav.stages.geometry.landmarks.unbroken_view import carried, of_one_place
from omninav.stages.geometry.plane.se2 import compose
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


@pytest.mark.parametrize(
    ("fitting", "expected"), [(14, (math.inf, True, 0.0)), (15, (5.0, False, 0.0)), (25, (0.0, False, 0.0))]
)
def test_fifteen_matches_that_fit_odometry_tell_of_the_same_surroundings(
    fitting: int, expected: tuple[float, bool, float]
) -> None:
    motion = np.array([0.3, 0.0, 0.0])
    here, there = (seen_from(room(number=800), pose) for pose in (HERE, compose(HERE, motion)))
    pairs = mutual_nearest_units(root_descriptors(here.descriptors), root_descriptors(there.descriptors), 0.8)
    both = pairs.second[1 : fitting + 1]
    bearings = np.concatenate([there.bearings[both], there.bearings])
    others = np.tile(there.descriptors[:1], (len(there.bearings), 1))  # of which none is clearly the most similar
    descriptors = np.concatenate([there.descriptors[both], others])
    found = carried((here.bearings, here.descriptors), (bearings, descriptors), motion)
    assert found[:2] == expected[:2]
    assert found.turned == pytest.approx(expected[2], abs=0.03)


@pytest.mark.parametrize("turn", [-30.0, 40.0])
def test_a_turn_that_odometry_missed_is_measured_from_both_images(turn: float) -> None:
    there = seen_from(room(), compose(HERE, np.array([0.3, 0.0, math.radians(turn)])))
    here = seen_from(room(), HERE)
    found = carried((here.bearings, here.descriptors), (there.bearings, there.descriptors), np.array([0.3, 0.0, 0.0]))
    assert found.at_most == 5.0
    assert math.degrees(found.turned) == pytest.approx(abs(turn), abs=3.0)
