"""A robot that drives around in a house of four rooms, the points of its walls, and the bearings of them."""

import math
from typing import NamedTuple

import numpy as np

from omninav.stages.geometry.landmarks.adjustment import Lens
from omninav.stages.geometry.landmarks.closures import straightened_drive
from omninav.stages.geometry.plane.drive_graph import odometry_sigmas
from omninav.stages.geometry.plane.se2 import between, chain, compose

ROOM = np.array([6.0, 5.0])
NOISE = math.radians(0.1)
POSE_SIGMAS = np.array([0.1, 0.1, math.radians(2.0)])


class House(NamedTuple):
    poses: np.ndarray
    points: np.ndarray
    references: np.ndarray
    landmarks: np.ndarray
    bearings: np.ndarray
    wrong: np.ndarray


def house(rng, references=120, landmarks=2000, wrong=0.05, tilts=None):
    """Points are taken for others of the same image with a chance of `wrong`; a landmark is seen four to five times.

    `tilts` (R, 2): roll and pitch of each reference.
    """
    around = np.linspace(0.0, 2 * math.pi, references // 5)
    rooms = np.array([[0, 0], [0, 1], [1, 1], [1, 0], [0, 0]])
    radii = np.array([0.3, 0.3, 0.3, 0.3, 0.25])  # the first room is visited twice
    circle = np.column_stack([np.cos(around), np.sin(around)])
    xy = ((rooms + 0.5)[:, None] + radii[:, None, None] * circle).reshape(-1, 2) * ROOM
    steps = np.gradient(xy, axis=0)
    poses = np.column_stack([xy, np.arctan2(steps[:, 1], steps[:, 0])])
    room, wall = rooms[rng.integers(0, 4, landmarks)], rng.integers(0, 4, landmarks)
    place = rng.random((landmarks, 2))
    place[np.arange(landmarks), wall % 2] = wall // 2
    points = np.column_stack([(room + place) * ROOM, rng.uniform(-0.9, 1.4, landmarks)])
    same = (xy[:, None] // ROOM == room).all(axis=2)
    near = np.linalg.norm(xy[:, None] - points[:, :2], axis=2) < 4.0
    seen = near & (rng.random(near.shape) < np.where(same, 0.2, 0.03))
    landmark, reference = np.nonzero(seen.T)
    rays = points[landmark] - np.column_stack([xy, np.zeros(len(xy))])[reference]
    bearings = np.einsum("oji,oj->oi", rotations(poses, tilts)[reference], rays)
    bearings /= np.linalg.norm(bearings, axis=1)[:, None]
    mistaken = rng.random(len(bearings)) < wrong
    for each in range(len(poses)):
        rows = np.flatnonzero(mistaken & (reference == each))
        bearings[rows] = bearings[np.roll(rows, 1)]
    bearings += rng.normal(0.0, NOISE, bearings.shape)
    bearings /= np.linalg.norm(bearings, axis=1)[:, None]
    return House(poses, points, reference, landmark, bearings, mistaken)


def looks(house, order, length=128):
    """Descriptors of the sightings in this order: each landmark has its own, which varies a little."""
    rng = np.random.default_rng(1)
    own = rng.gamma(0.5, 40.0, (len(house.points), length))[house.landmarks[order]]
    return np.clip(np.rint(own * rng.normal(1.0, 0.2, own.shape)), 0, 255).astype(np.uint8)


def rotations(poses, tilts=None):
    roll, pitch = np.zeros((2, len(poses))) if tilts is None else tilts.T
    return turn(poses[:, 2], 2) @ turn(pitch, 1) @ turn(roll, 0)


def turn(angles, axis):
    axes = np.eye(3)[[*range(axis + 1, 3), *range(axis + 1)]]  # the axis last
    cos, sin, one, nought = np.cos(angles), np.sin(angles), np.ones(len(angles)), np.zeros(len(angles))
    about_last = np.array([[cos, -sin, nought], [sin, cos, nought], [nought, nought, one]]).transpose(2, 0, 1)
    return axes.T @ about_last @ axes


def triangulated(house, poses, bearings=None):
    """Points where the bearings of each landmark come closest to each other, wrong ones too; NaN of one seen once."""
    rays = np.einsum("oij,oj->oi", rotations(poses)[house.references], house.bearings if bearings is None else bearings)
    across = np.eye(3) - rays[:, :, None] * rays[:, None, :]
    centres = np.column_stack([poses[:, :2], np.zeros(len(poses))])[house.references]
    square, right = np.zeros((len(house.points), 3, 3)), np.zeros((len(house.points), 3))
    np.add.at(square, house.landmarks, across)
    np.add.at(right, house.landmarks, np.einsum("oij,oj->oi", across, centres))
    several = np.bincount(house.landmarks, minlength=len(square)) > 1
    points = np.full(right.shape, np.nan)
    points[several] = np.linalg.solve(square[several] + 1e-9 * np.eye(3), right[several, :, None])[:, :, 0]
    return points


def displaced(poses, rng):
    """Poses that are wrong by 10 cm and 2 degrees, each by itself."""
    return poses + rng.normal(size=poses.shape) * POSE_SIGMAS


def driven(poses):
    """Odometry that is 2 % too long and turns by half a degree per metre: its motions, and the poses it leads to."""
    motions = between(poses[:-1], poses[1:])
    motions[:, :2] *= 1.02
    motions[:, 2] += math.radians(0.5) * np.hypot(*motions[:, :2].T)
    return motions, compose(poses[0], np.concatenate([np.zeros((1, 3)), chain(motions)]))


def straightened(odometry, verified):
    """Poses of a drive by odometry, straightened by its verified pairs."""
    steps = between(odometry[:-1], odometry[1:])
    return straightened_drive(odometry[0], steps, odometry_sigmas(steps), verified)


def seen_in(views):
    """The lens of a camera that is as described, of any of the views' features."""
    return lambda features: Lens(lambda _: views.bearings[features], np.empty(0))


def misplaced(poses, truth):
    """Root of the mean squared distance of poses after the best similarity (m), and the factor of that."""
    one, two = (each[:, 0] + 1j * each[:, 1] for each in (poses, truth))
    one, two = one - one.mean(), two - two.mean()
    factor = (one.conj() * two).sum() / (abs(one) ** 2).sum()
    return float(np.sqrt((abs(factor * one - two) ** 2).mean())), abs(factor)
