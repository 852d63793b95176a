"""Distances to surfaces of a world, by hand."""

import math
from dataclasses import replace

import numpy as np
import pytest
from world_files import DEMO

from omninav.pipeline import Context
from omninav.stages.simulator.bodies import Box, Tiling
from omninav.stages.simulator.feature_depths import FeatureDepths
from omninav.stages.simulator.first_hits import first_hits
from omninav.stages.values.local_features import LocalFeatures
from omninav.stages.values.pose import Pose

NOTHING = (Tiling(np.zeros((1, 1), np.int64), 1.0, 1.0),) * 6


def box(centre: tuple[float, float], half: tuple[float, float], yaw: float, low: float, high: float) -> Box:
    return Box("box", centre, half, yaw, low, high, NOTHING)


def test_rays_end_on_the_floor_the_ceiling_or_the_nearest_body() -> None:
    near, far = box((3.0, 0.0), (0.5, 0.5), 0.0, 0.0, 1.0), box((6.0, 0.0), (0.5, 5.0), 0.0, 0.0, 3.0)
    slope = math.sqrt(0.5)
    rays = [(1, 0, 0), (0, 1, 0), (0, 0, -1), (0, 0, 1), (slope, 0, -slope), (4 / math.sqrt(17), 0, 1 / math.sqrt(17))]
    found = first_hits([far, near], 2.5, (0.0, 0.0, 0.9), rays)
    assert found == pytest.approx([2.5, math.inf, 0.9, 1.6, 0.9 / slope, math.sqrt(17) / 4 * 5.5])


def test_a_turned_body_is_met_where_its_corner_is() -> None:
    turned = box((4.0, 0.0), (1.0, 1.0), math.pi / 4, 0.0, 2.0)
    assert first_hits([turned], 3.0, (0.0, 0.0, 1.0), [(1, 0, 0)]) == pytest.approx([4.0 - math.sqrt(2.0)])


def test_what_hangs_is_seen_under_and_what_is_around_the_eye_is_not_there() -> None:
    lamp, around = box((2.0, 0.0), (0.5, 0.5), 0.0, 1.5, 2.0), box((0.0, 0.0), (0.3, 0.3), 0.0, 0.0, 1.0)
    wall = box((5.0, 0.0), (0.1, 3.0), 0.0, 0.0, 3.0)
    rays = [(1, 0, 0), (math.cos(0.4), 0, math.sin(0.4))]
    found = first_hits([lamp, around, wall], 3.0, (0.0, 0.0, 0.9), rays)
    assert found == pytest.approx([4.9, 1.5 / math.cos(0.4)], rel=1e-9)


def test_depths_are_from_the_camera_that_sits_beside_the_robots_middle() -> None:
    rays = np.array([[math.cos(angle), math.sin(angle), 0.0] for angle in (0.3, 2.0, -2.0)])
    nothing = np.zeros((3, 128), np.uint8), np.zeros((3, 3), np.float32), np.ones(3, np.float32)
    features = LocalFeatures(rays, np.zeros((3, 2)), *nothing)

    def measured(truth: Pose, **position: float) -> np.ndarray:
        stage = FeatureDepths(world=replace(DEMO, camera={**DEMO.camera, "position": position}))
        stage.setup(Context("depths"))
        return stage.step(Context("depths"), truth, features).depths.patches

    beside = measured(Pose(5.0, 5.0, math.pi / 2), x=0.2, y=0.1)
    assert beside == pytest.approx(measured(Pose(4.9, 5.2, math.pi / 2)))
    assert beside != pytest.approx(measured(Pose(5.0, 5.0, math.pi / 2)))
