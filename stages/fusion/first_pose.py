"""The first pose of a log, as a user states it."""

from typing import Literal

import numpy as np

from omninav.pipeline import BadInput
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.belief import Particles
from omninav.stages.values.pose import Pose, StartPose

KnownStart = Literal["truth", "origin"] | StartPose
Where = Literal["uniform", "truth", "origin"] | StartPose


def first_pose(at: KnownStart, truth: Pose | None, sigmas: tuple[float, float] = (0.1, 0.1)) -> tuple[Array, Array]:
    """The pose (3,) and its standard deviations (3,), which are `sigmas` (m, rad) where `at` does not state them.

    Raises BadInput where `at` is `truth` and the log has no true pose.
    """
    if at == "origin":
        x, y, heading, metres, radians = 0.0, 0.0, 0.0, *sigmas
    elif at == "truth":
        if truth is None:
            raise BadInput("start: no true pose is known at the first image here; use start=uniform")
        x, y, heading, metres, radians = truth.x, truth.y, truth.heading, *sigmas
    else:
        x, y, heading, metres, radians = at
    return np.array([x, y, heading]), np.array([metres, metres, radians])


def particles_around(pose: Array, sigmas: Array, number: int, rng: np.random.Generator) -> Particles:
    """Particles of equal weights, drawn from a Gaussian of these standard deviations (3,)."""
    poses = pose + rng.standard_normal((number, 3)) * sigmas
    poses[:, 2] = wrap(poses[:, 2])
    return Particles(poses, np.full(number, 1.0 / number))
