"""What the wheels say: the true motion with noise and a day's systematic errors."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.se2 import between, compose, wrap

from .config import OdometryNoise

F64 = npt.NDArray[np.float64]


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


def odometry(poses: npt.ArrayLike, noise: OdometryNoise, bias: Bias, rng: np.random.Generator) -> F64:
    """Odometry poses (N, 3), the first at 0, 0, 0, of a drive through true poses (N, 3).

    Each increment is taken as rotation, translation, rotation (Thrun, Burgard & Fox 2005, section 5.4) and each part is
    disturbed: sigma_trans = translation sqrt(m), sigma_rot^2 = rotation^2 |rad| + drift^2 m. A robot that turns on the
    spot or rolls back is not thought to swing round: the first rotation is then split from the translation's sign.
    """
    poses = np.asarray(poses, dtype=np.float64)
    motion = between(poses[:-1], poses[1:])
    length = np.hypot(motion[:, 0], motion[:, 1])
    forward = np.where(motion[:, 0] < 0.0, -1.0, 1.0)
    first = np.where(length > 1e-6, np.arctan2(forward * motion[:, 1], forward * motion[:, 0]), 0.0)
    second = wrap(motion[:, 2] - first)
    drawn = rng.normal(size=(len(motion), 3))
    half = 0.5 * noise.drift**2 * length
    first_seen = _misjudged(first, length, noise, half, bias, drawn[:, 0])
    second_seen = _misjudged(second, length, noise, half, bias, drawn[:, 2])
    rolled = forward * (length * (1.0 + bias.translation) + noise.translation * np.sqrt(length) * drawn[:, 1])
    seen = np.zeros((len(poses), 3))
    for k in range(len(motion)):
        step = (rolled[k] * np.cos(first_seen[k]), rolled[k] * np.sin(first_seen[k]), first_seen[k] + second_seen[k])
        seen[k + 1] = compose(seen[k], step)
    return seen


def _misjudged(rotation: F64, length: F64, noise: OdometryNoise, half: F64, bias: Bias, drawn: F64) -> F64:
    """Rotations as the wheels say, each with its half of what drifts over the metres."""
    sigma = np.sqrt(noise.rotation**2 * np.abs(rotation) + half)
    seen: F64 = rotation * (1.0 + bias.rotation) + 0.5 * bias.turn * length + sigma * drawn
    return seen
