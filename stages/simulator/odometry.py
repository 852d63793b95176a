"""Simulated odometry: the true motion with noise and systematic errors of a day."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.odometry_noise import add_odometry_noise
from omninav.stages.geometry.plane.se2 import between, chain, wrap

from .config import OdometryNoise

DRAWS = 6
"""Normal random numbers per increment."""
SLIDING_RAD = 0.02
"""Rotations of an increment beyond its turn, above which the robot slides sideways: driving, ten times less (rad)."""


@dataclass(frozen=True)
class Bias:
    """A day's systematic errors: misjudged share of translation and of rotation, and rotation (rad) added per metre."""

    translation: float
    rotation: float
    turn: float


def draw_bias(noise: OdometryNoise, rng: np.random.Generator) -> Bias:
    """A day's systematic errors, Gaussian with the spreads that `noise` gives."""
    drawn = rng.normal(size=3)
    return Bias(
        translation=float(noise.scale_bias * drawn[0]),
        rotation=float(noise.rotation_bias * drawn[1]),
        turn=float(noise.turn_bias * drawn[2]),
    )


def measured(motions: npt.ArrayLike, noise: OdometryNoise, bias: Bias, rng: np.random.Generator) -> Array:
    """True increments of motion (N, 3) as the wheels measure them.

    Each increment is split into rotation, translation, rotation (Thrun, Burgard & Fox 2005, section 5.4), and each part
    gets noise: sigma_trans = translation sqrt(m), sigma_rot^2 = rotation^2 |rad| + drift^2 m; then `added` noise
    follows. A motion backwards is a negative translation, not two half turns; of a robot that slides along something,
    no rotation but its own turn adds noise.
    """
    motions = np.asarray(motions, dtype=np.float64)
    length = np.hypot(motions[:, 0], motions[:, 1])
    forward = np.where(motions[:, 0] < 0.0, -1.0, 1.0)
    first = np.where(length > 1e-6, np.arctan2(forward * motions[:, 1], forward * motions[:, 0]), 0.0)
    second = wrap(motions[:, 2] - first)
    drawn = rng.normal(size=(len(motions), DRAWS))
    half, turn = 0.5 * noise.drift**2 * length, np.abs(motions[:, 2])
    slides = np.abs(first) + np.abs(second) > turn + SLIDING_RAD
    first_sigma, second_sigma = (
        np.sqrt(noise.rotation**2 * np.where(slides, turn / 2, np.abs(rotation)) + half) for rotation in (first, second)
    )
    first_seen = _misjudged(first, length, bias, first_sigma * drawn[:, 0])
    second_seen = _misjudged(second, length, bias, second_sigma * drawn[:, 2])
    rolled = forward * (length * (1.0 + bias.translation) + noise.translation * np.sqrt(length) * drawn[:, 1])
    seen = np.stack([rolled * np.cos(first_seen), rolled * np.sin(first_seen), first_seen + second_seen], axis=1)
    return add_odometry_noise(seen, noise.added, drawn[:, 3:]) if any(noise.added) else seen


def odometry(
    poses: npt.ArrayLike,
    noise: OdometryNoise,
    bias: Bias,
    rng: np.random.Generator,
    rolled_to: npt.ArrayLike | None = None,
) -> Array:
    """Odometry poses (N, 3), the first at 0, 0, 0, of a drive through true poses (N, 3).

    `rolled_to` (N, 3): where the wheels brought the robot, where that was not where it continued from (it was lifted).
    """
    poses = np.asarray(poses, dtype=np.float64)
    ends = poses if rolled_to is None else np.asarray(rolled_to, dtype=np.float64)
    motions = measured(between(poses[:-1], ends[1:]), noise, bias, rng)
    return np.concatenate([np.zeros((1, 3)), chain(motions)])


def _misjudged(rotation: Array, length: Array, bias: Bias, error: Array) -> Array:
    """Rotations as the wheels measure them, each with its half of what drifts over the metres."""
    seen: Array = rotation * (1.0 + bias.rotation) + 0.5 * bias.turn * length + error
    return seen
