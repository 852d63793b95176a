"""SE(2): poses (x, y, heading) as the last axis of arrays; metres and radians, headings counter-clockwise."""

import math

import numpy as np
import numpy.typing as npt

from omninav.stages.geometry.arrays import Array


def wrap(angle: npt.ArrayLike) -> Array:
    """Angles brought into [-pi, pi)."""
    return np.mod(np.asarray(angle, dtype=np.float64) + math.pi, 2 * math.pi) - math.pi


def wrap_angle(angle: float) -> float:
    """One angle brought into [-pi, pi), as `wrap` does it."""
    return (angle + math.pi) % (2 * math.pi) - math.pi


def _poses(x: Array, y: Array, heading: Array) -> Array:
    poses = np.empty((*x.shape, 3))
    poses[..., 0], poses[..., 1], poses[..., 2] = x, y, heading
    return poses


def compose(pose: npt.ArrayLike, motion: npt.ArrayLike) -> Array:
    """The pose reached from `pose` by a motion given in its frame: (..., 3) and (..., 3) -> (..., 3)."""
    pose, motion = np.asarray(pose, dtype=np.float64), np.asarray(motion, dtype=np.float64)
    cos, sin = np.cos(pose[..., 2]), np.sin(pose[..., 2])
    return _poses(
        pose[..., 0] + cos * motion[..., 0] - sin * motion[..., 1],
        pose[..., 1] + sin * motion[..., 0] + cos * motion[..., 1],
        wrap(pose[..., 2] + motion[..., 2]),
    )


def between(start: npt.ArrayLike, end: npt.ArrayLike) -> Array:
    """The motion that leads from `start` to `end`, in the frame of `start`: the inverse of `compose`."""
    start, end = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
    cos, sin = np.cos(start[..., 2]), np.sin(start[..., 2])
    dx, dy = end[..., 0] - start[..., 0], end[..., 1] - start[..., 1]
    return _poses(cos * dx + sin * dy, -sin * dx + cos * dy, wrap(end[..., 2] - start[..., 2]))


def power(motion: npt.ArrayLike, share: float) -> Array:
    """A share of motions (..., 3) at a constant speed and rate of turn, or a multiple of them; 1 is all of each."""
    motion = np.asarray(motion, dtype=np.float64)
    turn = share * motion[..., 2]
    length = share * np.sinc(turn / math.tau) / np.sinc(motion[..., 2] / math.tau)
    cos, sin = (length * of((turn - motion[..., 2]) / 2.0) for of in (np.cos, np.sin))
    return _poses(cos * motion[..., 0] - sin * motion[..., 1], sin * motion[..., 0] + cos * motion[..., 1], wrap(turn))


def turned(vectors: Array, angles: Array | float) -> Array:
    """Vectors (..., 3) turned about z, counter-clockwise by angles (...,), rad."""
    cos, sin = np.cos(angles), np.sin(angles)
    x, y, z = np.moveaxis(vectors, -1, 0)
    return np.stack([cos * x - sin * y, sin * x + cos * y, z], axis=-1)


def path_length(points: npt.ArrayLike) -> float:
    """Length of the straight lines from each of N points (N, 2 or more) to the next."""
    return float(np.hypot(*np.diff(np.asarray(points)[:, :2], axis=0).T).sum())


def distances_along(points: Array) -> Array:
    """Distance from the first of N points (N, 2 or more) to each along the straight lines between them: (N,)."""
    return np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points[:, :2], axis=0).T))])


def interpolate(times: npt.ArrayLike, poses: npt.ArrayLike, at: npt.ArrayLike) -> Array:
    """Poses at given times between stamped poses, linear in x, y and along the shorter turn in heading.

    `times` (N,) ascending, `poses` (N, 3), `at` (M,) within the range of `times`; returns (M, 3).
    """
    times, poses, at = np.asarray(times), np.asarray(poses, dtype=np.float64), np.asarray(at)
    heading = np.unwrap(poses[:, 2])
    columns = [np.interp(at, times, poses[:, 0]), np.interp(at, times, poses[:, 1]), np.interp(at, times, heading)]
    return _poses(columns[0], columns[1], wrap(columns[2]))


def chain(motions: npt.ArrayLike) -> Array:
    """Poses reached by motions one after another from the origin: (N, 3) -> (N, 3), the first motion included."""
    motions = np.asarray(motions, dtype=np.float64)
    heading = np.cumsum(motions[:, 2])
    before = heading - motions[:, 2]
    cos, sin = np.cos(before), np.sin(before)
    x = np.cumsum(cos * motions[:, 0] - sin * motions[:, 1])
    y = np.cumsum(sin * motions[:, 0] + cos * motions[:, 1])
    return _poses(x, y, wrap(heading))
