import math

import numpy as np
import pytest

from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.motion.odometry_noise_model import OdometryNoiseModel
from omninav.stages.motion.rotation_translation_rotation import MeasuredNoise
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.pose import BridgedMotion, Motion

STATED = OdometryNoiseModel()


def fix(pose, probability=0.99):
    exact = np.diag([1e-6, 1e-6, 1e-8])[None]
    bearings, agreeing = np.zeros((0, 3), np.float32), np.zeros(0, np.int8)
    return LandmarkFix(pose[None], exact, np.array([60]), np.array([probability]), 80, bearings, agreeing)


def driven(factor, probability=0.99, steps=400, seed=0, carried=()):
    """The noise after a drive of 0.2 m steps whose odometry errs by `factor` times what is stated."""
    rng, measured, pose = np.random.default_rng(seed), MeasuredNoise(), np.zeros(3)
    for step in range(steps):
        measured.compare(fix(pose, probability))
        motion = Motion(0.2, 0.0, 0.1 * math.sin(0.1 * step))
        stated = STATED.model(motion)
        first, way, second = factor * np.array(stated.sigmas) * rng.standard_normal(3)
        length = 0.2 + way
        turns = stated.steps[0] + first, stated.steps[2] + second
        true = np.array([length * math.cos(turns[0]), length * math.sin(turns[0]), turns[0] + turns[1]])
        pose = compose(pose, true)
        if step in carried:
            pose = compose(pose, np.array([5.0, 0.0, 2.0]))
        measured.move(motion, stated)
    return measured, stated


@pytest.mark.parametrize("factor", [0.3, 1.0, 2.0])
def test_noise_is_scaled_to_the_errors_that_landmarks_show(factor):
    measured, stated = driven(factor)
    scaled = np.array(measured.applied(stated).sigmas) / stated.sigmas
    assert scaled == pytest.approx([factor] * 3, rel=0.2)
    robust, _ = driven(factor, carried=(150,))
    assert np.array(robust.applied(stated).sigmas) / stated.sigmas == pytest.approx(scaled, rel=0.5)


def test_unsure_poses_and_bridged_motions_say_nothing_of_odometry():
    measured, stated = driven(0.3, probability=0.9)
    assert measured.applied(stated).sigmas == stated.sigmas
    measured.compare(fix(np.zeros(3)))
    bridged = BridgedMotion(3.0, 0.0, 0.0, 2.0)
    measured.move(bridged, STATED.model(bridged))
    measured.compare(fix(np.zeros(3)))
    assert measured.applied(stated).sigmas == stated.sigmas
