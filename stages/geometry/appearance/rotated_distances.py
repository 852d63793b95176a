"""Distances between a view at several headings and kept views."""

import math

import numpy as np

from omninav.stages.geometry.arrays import Array, Floats
from omninav.stages.geometry.plane.se2 import wrap


def all_distances(turned: Floats, kept: Floats) -> Array:
    """Euclidean distances of each row of `turned` (H, D) to each kept vector (R, D): (R, H)."""
    here, there = turned.astype(np.float64), kept.astype(np.float64)
    squares = (there**2).sum(axis=1)[:, None] + (here**2).sum(axis=1) - 2.0 * (there @ here.T)
    return np.asarray(np.sqrt(np.maximum(squares, 0.0)))


def turned_distances(turned: Floats, kept: Floats) -> Array:
    """Distance to each kept vector (R, D) at the best heading: (R,).

    The best row is found in single precision, which does for ordering; the distance to it is exact, 0 for equals. With
    three rows or more it is that between rows, by the parabola through the three squared distances around the best: a
    robot turned by half a step is as near as one that is not.
    """
    squares = kept @ (-2.0 * turned.T)
    squares += np.einsum("rd,rd->r", kept, kept)[:, None]
    squares += np.einsum("hd,hd->h", turned, turned)
    best = squares.argmin(axis=1)
    gaps = kept - turned[best]
    least = np.einsum("rd,rd->r", gaps, gaps).astype(np.float64)
    if len(turned) >= 3:
        rows = np.arange(len(kept))
        before, after = (squares[rows, (best + step) % len(turned)].astype(np.float64) for step in (-1, 1))
        bend = before + after - 2.0 * least
        least -= np.where(bend > 0.0, 0.125 * (before - after) ** 2 / np.where(bend > 0.0, bend, 1.0), 0.0)
    return np.asarray(np.sqrt(np.maximum(least, 0.0)))


def turns_of_nearest(turned: Floats, kept: Floats) -> Array:
    """The robot's turn, counter-clockwise, from its heading in each kept view (R, D): (R,) rad.

    Row h of `turned` (H, D) is what a robot turned by 2 pi h / H further would see: where it is the best fit, the robot
    is turned by -2 pi h / H. Between two rows by the parabola through the three squared distances around the best.
    """
    if len(turned) < 3:
        return np.zeros(len(kept))
    return wrap(-angles_of_least(all_distances(turned, kept) ** 2))


def angles_of_least(values: Array) -> Array:
    """Angles (R,) at which values around the full circle (R, N) are least, between samples by a parabola: rad."""
    rows, best, number = np.arange(len(values)), values.argmin(axis=1), values.shape[1]
    before, least, after = (values[rows, (best + step) % number] for step in (-1, 0, 1))
    bend = before + after - 2.0 * least
    part = np.where(bend > 0.0, 0.5 * (before - after) / np.where(bend > 0.0, bend, 1.0), 0.0)
    return np.asarray((best + part) * (2.0 * math.pi / number))
