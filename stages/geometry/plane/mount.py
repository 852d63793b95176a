"""The mount of a camera: its pose (x forward, y left, heading) in the frame of its robot (m, m, rad)."""

import math

import numpy as np

from omninav.stages.geometry.arrays import Array

from .se2 import between, compose

MIN_ARM_M, MIN_TURN = 0.02, math.radians(1.0)
"""Distance (m) and turn (rad) below which a mount is taken for none: true headings alone are 1 degree off."""
FINE_ARM_M, FINE_TURN = 0.001, math.radians(0.1)
"""The same of what is left of one that was found before."""
MIN_SIGMAS = 4.0
"""Distance and turn below which it is taken for none, in their standard deviations."""
MIN_STEPS = 20
"""Steps between poses that a mount is found from, at least."""
MIN_TURNED = math.radians(5.0)
"""Root of the mean squared turn of these steps, below which no distance is measured (rad)."""
ROUNDS, LOOSE_SIGMAS = 10, 2.0
"""Rounds of least squares, and the distance (in sigmas) at which a step counts by half."""
MEDIAN_OF_RAYLEIGH = math.sqrt(2.0 * math.log(2.0))
"""Median length of a plane vector whose parts have the standard deviation 1."""


def camera_poses(robot: Array, mount: Array) -> Array:
    """Poses (..., 3) of a camera on a robot with poses (..., 3)."""
    return compose(robot, mount) if np.any(mount) else robot


def robot_poses(camera: Array, mount: Array) -> Array:
    """Poses (..., 3) of a robot whose camera has poses (..., 3): the inverse of `camera_poses`."""
    return compose(camera, between(mount, np.zeros(3))) if np.any(mount) else camera


def camera_step(robot: Array, mount: Array) -> Array:
    """The motion (3,) of a camera, in its own frame, whose robot makes a motion (3,)."""
    return between(mount, compose(robot, mount)) if np.any(mount) else robot


def robot_step(camera: Array, mount: Array) -> Array:
    """The motion (3,) of a robot, in its own frame, whose camera makes a motion (3,): the inverse of `camera_step`."""
    return compose(compose(mount, camera), between(mount, np.zeros(3))) if np.any(mount) else camera


def robot_covariances(covariances: Array, camera: Array, mount: Array) -> Array:
    """Covariances (K, 3, 3) of a robot's poses, of those of its camera's poses (K, 3)."""
    if not np.any(mount):
        return covariances
    jacobians = np.tile(np.eye(3), (len(camera), 1, 1))
    dx, dy = (robot_poses(camera, mount) - camera)[:, :2].T
    jacobians[:, 0, 2], jacobians[:, 1, 2] = -dy, dx
    return jacobians @ covariances @ jacobians.transpose(0, 2, 1)


def found_mount(camera: Array, robot: Array, left: bool = False) -> Array | None:
    """The mount (3,) that poses (R, 3) of a camera, in order, show against those (R, 3) that were measured of a robot.

    Where a robot moves by d and turns by R, its camera moves by s B (d + (R - 1) a), of which the scale s and the turn
    of its frame B against the robot's are found too (hand-eye calibration in the plane). Steps that disagree count less
    (Cauchy). Parts that do not differ from 0 significantly are 0; None where none is. `left`: it is what is left of one
    found before.
    """
    driven, seen = between(robot[:-1], robot[1:]), between(camera[:-1], camera[1:])
    turned = np.exp(1j * seen[:, 2]) - 1.0
    if len(driven) < MIN_STEPS or math.sqrt(float(np.mean(np.abs(turned) ** 2))) < MIN_TURNED:
        return None
    steps, measured = (each[:, 0] + 1j * each[:, 1] for each in (driven, seen))
    rows = np.column_stack([steps, turned])
    if np.linalg.matrix_rank(rows) < rows.shape[1]:  # a stationary robot, or odometry at rest
        return None
    weights, sigma, found = np.ones(len(rows)), 0.0, np.zeros(2, np.complex128)
    square = np.empty((2, 2), np.complex128)
    for _ in range(ROUNDS):
        weighted = (weights[:, None] * rows).conj().T
        square = weighted @ rows
        found = np.linalg.solve(square, weighted @ measured)
        missed = np.abs(measured - rows @ found)
        sigma = max(float(np.median(missed)) / MEDIAN_OF_RAYLEIGH, 1e-6)
        weights = 1.0 / (1.0 + (missed / (LOOSE_SIGMAS * sigma)) ** 2)
    scale, turn = abs(found[0]), -np.angle(found[0])
    arm = found[1] * np.exp(1j * turn)
    spread = sigma * np.sqrt(np.diag(np.linalg.inv(square)).real)
    mount = np.array([arm.real, arm.imag, turn])
    min_arm, min_turn = (FINE_ARM_M, FINE_TURN) if left else (MIN_ARM_M, MIN_TURN)
    if abs(arm) < max(min_arm, MIN_SIGMAS * spread[1]):
        mount[:2] = 0.0
    if abs(turn) < max(min_turn, MIN_SIGMAS * spread[0] / max(scale, 1e-6)):
        mount[2] = 0.0
    return mount if mount.any() else None
