from dataclasses import asdict, replace

import numpy as np
import pytest
from landmark_world import NOISE, POSE_SIGMAS, displaced, house, misplaced, triangulated
from scipy.spatial.transform import Rotation

from omninav.pipeline import BadInput
from omninav.stages.camera.cylindrical import Cylindrical
from omninav.stages.camera.donut import Donut
from omninav.stages.camera.equirectangular import Equirectangular
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.camera.self_calibration import (
    AXIS,
    TILT_SIGMA,
    adjustable,
    corrected,
    observed,
    with_elevations_found,
    with_tilt,
)
from omninav.stages.geometry.landmarks.adjustment import adjusted
from omninav.stages.geometry.landmarks.map_making import LocalViews, PairMatches

TRUE = HyperbolicMirror(640, 480, 497.0, 497.0, 319.5, 239.5, 28.095, 23.4125, 34.0, 238.0, yaw=0.3)
BESIDE = replace(TRUE, centre_x=321.8, centre_y=237.6)  # by 3 pixels


def test_an_axis_beside_by_3_pixels_is_found_with_wrong_poses():
    rng = np.random.default_rng(0)
    world = house(rng)
    pixels, _ = TRUE.project(world.bearings)
    poses = displaced(world.poses, rng)
    lens = adjustable(BESIDE, pixels)
    found = adjusted(
        poses,
        triangulated(world, poses, lens.bearings(np.zeros(2))),
        world.references,
        world.landmarks,
        lens,
        NOISE,
        np.tile(POSE_SIGMAS, (len(poses), 1)),
    )
    camera = corrected(BESIDE, AXIS, found.camera)
    assert np.hypot(camera.centre_x - TRUE.centre_x, camera.centre_y - TRUE.centre_y) < 0.05
    assert misplaced(found.poses, world.poses)[0] < 0.004


def test_a_field_is_changed_and_the_others_are_not():
    changed = corrected(TRUE, {"focal_x": 1.0, "yaw": 1.0}, np.array([2.0, -0.1]))
    assert asdict(changed) == asdict(TRUE) | {"focal_x": 499.0, "yaw": 0.3 + -0.1}


def test_a_pixel_that_looks_nowhere_agrees_with_nothing():
    lens = adjustable(TRUE, np.array([[319.5, 60.0], [1e5, 0.0]]))
    rays = lens.bearings(np.zeros(2))
    assert np.linalg.norm(rays, axis=1) == pytest.approx([1.0, 0.0])


@pytest.mark.parametrize("name", ["width", "height", "axis_x"])
def test_what_is_no_number_of_a_camera_is_refused(name):
    with pytest.raises(BadInput, match=f"no number {name!r} to calibrate, expected of yaw, focal_x"):
        adjustable(replace(TRUE, height=None), np.zeros((1, 2)), {name: 1.0})


def test_a_camera_leans_by_its_last_two_corrections_roll_first():
    lens = adjustable(TRUE, np.array([[319.5, 60.0], [500.0, 300.0]]), AXIS | {"yaw": 0.1})
    tilted = with_tilt(lens)
    assert tilted.sigmas.tolist() == [np.inf, np.inf, 0.1, TILT_SIGMA, TILT_SIGMA]
    leaning = Rotation.from_euler("xy", [0.1, 0.2]).apply(lens.bearings(np.array([1.0, -2.0, 0.3])))
    assert tilted.bearings(np.array([1.0, -2.0, 0.3, 0.1, 0.2])) == pytest.approx(leaning)


def test_a_drive_shows_the_axis_of_a_ring_whose_elevations_are_known_and_the_yaw_where_poses_are_given():
    assert observed(TRUE, False) == AXIS
    assert observed(TRUE, True) == AXIS | {"yaw": np.inf}
    assert observed(Donut(640, 480, 320.0, 240.0, 40.0, 200.0), True) == {}
    assert observed(Equirectangular(720, 150, 360.0, elevation_top=0.7, elevation_bottom=-0.6), True) == {}


def strip_of_a_drive(horizon_deg: float, features: int = 100) -> tuple[Equirectangular, tuple]:
    """A strip of square pixels whose middle looks along an elevation, and what it saw from three poses."""
    middle, half = np.radians(horizon_deg), np.pi * 150 / 720
    true = Equirectangular(
        720, 150, 300.0, yaw=0.4, height=0.9, elevation_top=middle + half, elevation_bottom=middle - half
    )
    rng = np.random.default_rng(0)
    poses = np.array([[0.0, 0.0, 0.5], [1.0, 0.2, 0.9], [0.6, 1.1, -1.0]])
    around = rng.uniform(-np.pi, np.pi, features)
    points = np.column_stack([3 * np.cos(around), 3 * np.sin(around), rng.uniform(-0.5, 0.5, features)])
    rays = [(points - [*xy, 0.0]) @ Rotation.from_euler("z", turn).as_matrix() for *xy, turn in poses]
    views = LocalViews(features * np.arange(4), np.zeros((3 * features, 3)), np.zeros((3 * features, 128), np.uint8))
    rows, pairs = np.arange(features), np.array([[0, 1], [1, 2]])
    first, second = (np.concatenate([features * view + rows for view in side]) for side in pairs.T)
    matches = PairMatches(pairs, features * np.arange(3), first, second, np.zeros(2 * features))
    return true, (true.project(np.concatenate(rays))[0], views, matches, poses)


def test_the_horizon_of_a_strip_is_where_most_matches_fit():
    true, seen = strip_of_a_drive(9.0)
    unknown = Cylindrical(720, 150, 300.0, yaw=0.4, height=0.9)
    found = with_elevations_found(unknown, *seen)
    assert np.degrees(found.elevations) == pytest.approx(np.degrees(true.elevations), abs=0.6)
    assert asdict(found) | {"elevation_top": 0.0, "elevation_bottom": 0.0} == asdict(true) | {
        "elevation_top": 0.0,
        "elevation_bottom": 0.0,
    }
    assert with_elevations_found(true, *seen) is None  # it states them
    assert with_elevations_found(TRUE, *seen) is None  # no strip
    assert with_elevations_found(unknown, *strip_of_a_drive(0.0)[1]) is None  # as good in the middle
    assert with_elevations_found(unknown, *strip_of_a_drive(9.0, 40)[1]) is None  # too few
    pixels, views, matches, poses = seen
    none = PairMatches(matches.pairs[:0], matches.starts[:1], *(each[:0] for each in matches[2:]))
    assert with_elevations_found(unknown, pixels, views, none, poses) is None
