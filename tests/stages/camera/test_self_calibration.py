from dataclasses import asdict, replace

import numpy as np
import pytest
from landmark_world import NOISE, POSE_SIGMAS, displaced, house, misplaced, triangulated

from omninav.pipeline import BadInput
from omninav.stages.camera.hyperbolic import HyperbolicMirror
from omninav.stages.camera.self_calibration import AXIS, adjustable, corrected
from omninav.stages.geometry.landmarks.adjustment import adjusted

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
