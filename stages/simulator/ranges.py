"""A ring of ultrasound-like range readings."""

import math
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array

from .config import Ranges
from .obstacles import Obstacles, beam
from .people import Person

RAYS_PER_CONE = 5
"""Rays that sample a cone."""


def round_bodies(people: Sequence[Person]) -> Array:
    """People as a ring and a robot's bumper know them: (M, 3) x, y, radius."""
    return np.array([(*person.position, person.radius) for person in people]).reshape(-1, 3)


def measure(room: Obstacles, people: Array, poses: npt.ArrayLike, ring: Ranges, rng: np.random.Generator) -> Array:
    """Turns of the ring at poses (N, 3): (N, readings) metres from the robot's middle, infinite without an echo.

    `people` (N, M, 3): x, y and radius of who is about at each.
    """
    poses = np.ascontiguousarray(poses, dtype=np.float64)
    echoes = _echoes(room, people, poses, ring.readings, ring.beam_width, ring.max_range)
    seen = np.maximum(echoes + ring.noise * rng.normal(size=echoes.shape), 0.0)
    lost = rng.uniform(size=echoes.shape) < ring.dropout
    return np.where(lost | (seen > ring.max_range), np.inf, seen)


@compiled(error_model="numpy")
def _echoes(room: Obstacles, people: Array, poses: Array, readings: int, opening: float, farthest: float) -> Array:
    """The nearest hit within each cone, (N, readings)."""
    echoes = np.full((len(poses), readings), np.inf)
    for n in range(len(poses)):
        for k in range(readings):
            for ray in range(RAYS_PER_CONE):
                azimuth = (
                    poses[n, 2] - math.pi + 2 * math.pi * k / readings + opening * (ray / (RAYS_PER_CONE - 1) - 0.5)
                )
                dx, dy = math.cos(azimuth), math.sin(azimuth)
                hit = beam(room, people[n], poses[n, 0], poses[n, 1], dx, dy, farthest)
                echoes[n, k] = min(echoes[n, k], hit)
    return echoes
