import math
from dataclasses import replace

import numpy as np
import pytest

from omninav.stages.geometry.plane.se2 import compose
from omninav.stages.motion.odometry_noise_model import OdometryNoiseModel
from omninav.stages.motion.rotation_translation_rotation import MeasuredNoise
from omninav.stages.values.landmarks import LandmarkFix
from omninav.stages.values.pose import BridgedMotion, Motion, UncertainMotion

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


@pytest.mark.parametrize(
    ("way", "away", "before", "squares", "stretches"),
    [
        # Errors of 0.5 rad and 0.5 m: (0.25 - 0.01) / 0.5 of the turn, (0.25 - 0.06) / 0.08 of the length.
        (0.7, 1.0, 3.0, [3.48, 5.375], 4.0),
        (0.7, 0.5, 3.0, [3.48, 3.0], 4.0),  # no farther off than landmarks may be
        (0.7, 9.0, 3.0, [3.48, 19.0], 4.0),  # carried
        (0.7, 1.0, 100.0, [99.48, 101.375], 100.0),  # the oldest are forgotten
        (0.5, 1.0, 3.0, [3.48, 5.375], 4.0),
        (4.9, 1.0, 3.0, [3.48, 5.375], 4.0),
        (0.48, 1.0, 3.0, [3.0, 3.0], 3.0),  # too short, and too long a way
        (5.0, 1.0, 3.0, [3.0, 3.0], 3.0),
    ],
)
def test_a_stretch_counts_by_its_errors_beyond_those_of_landmarks(way, away, before, squares, stretches):
    measured, start = MeasuredNoise(squares=np.full(2, before), stretches=before), np.array([1.0, 2.0, 0.1])
    measured.compare(fix(start))
    for x, turn in ((0.3, math.pi / 2), (0.4, 0.0)):
        measured.move(Motion(x, 0.0, turn), UncertainMotion((0.0, -way / 2, turn), (0.3, 0.2, 0.4)))
    there = np.add(start, (0.8 * away, 0.6 * away, math.pi / 2 + 0.5))
    exact = np.array([[0.02, 0.001, 0.0], [0.001, 0.04, 0.0], [0.0, 0.0, 0.005]])
    measured.compare(replace(fix(there, 0.95), covariances=exact[None]))
    assert (measured.squares, measured.stretches) == (pytest.approx(squares), pytest.approx(stretches))
    assert measured.anchor.tolist() == (start if way < 0.5 else there).tolist()
    assert (measured.driven > 0.0) is (way < 0.5)  # from there on
    scaled = measured.applied(UncertainMotion((0.0, 1.0, 0.0), (0.3, 0.2, 0.4)))
    turn, length = np.sqrt(np.array(squares) / stretches)
    assert scaled.sigmas == pytest.approx((0.3 * turn, 0.2 * length, 0.4 * turn))
