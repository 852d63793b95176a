"""Min-warping and its kin on arrays: the place of a second panorama, by warping the columns of a first one.

Möller, Krzykawski & Gerstmayr 2010 (Three 2D-warping schemes for visual robot navigation) compare every column of one
view with every column of the other at several magnifications ("scale planes"), and search the direction and the turn
for which columns match best where a robot that has moved so would see them again. Here, rows are equal steps of the
logarithm of the tangent of elevation, above the horizon and below it, so that a magnification is a shift of rows.
Instead of the smallest distance within a range, each column adds the logarithm of its mean likelihood over all
distances that it may have: a match counts by how rare as good a match is.
"""

import math
from typing import NamedTuple

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Floats, Ints

LOG_STEP = 0.112
"""Step of the logarithm of the tangent of elevation from row to row, and of the magnification from plane to plane."""
MAX_SHIFT = 8
"""Planes for magnification, and as many for its inverse: up to 2.4 times."""
DEPTH_RATIOS = np.array([0.0, 0.03, 0.07, 0.12, 0.18, 0.25, 0.33, 0.42, 0.52, 0.64, 0.78, 0.95, 1.2])
"""The way to the target over a column's distance: what is tried. Each represents what is closest to it."""
PRIOR = np.gradient(DEPTH_RATIOS) / np.gradient(DEPTH_RATIOS).sum()
"""All alike up to the largest."""
HALF_WINDOW = 1
"""Columns on both sides of one that are compared together with it."""
DIRECTION_STEP = 2
"""Columns from one direction to the next that is tried, a divisor of their number."""
NO_MATCH = 0.85
"""Share of columns that are taken to have no match: they are hidden in one of the views."""
NOISE = (14.0 / 255.0) ** 2
"""Mean squared difference at which a match is a third as likely: that of 14 of 255 levels of intensity, which the same
thing may have in two views."""
NOISE_FACTORS = (0.01, 0.03, 0.1, 0.3, 1.0)
"""Multiples of the noise that may be a column's own: of the variance, so 1.4 to 14 of 14 levels."""


class Columns(NamedTuple):
    """The columns of a view, counter-clockwise from forward: `above` and `below` the horizon, (C, rows, 3) in [0, 1].

    Rows go outwards from the horizon, LOG_STEP apart.
    """

    above: Floats
    below: Floats


class Warp(NamedTuple):
    """The best warp. `direction`, `turn`: to the target (rad, counter-clockwise); `depth_ratio`: the way there over the
    distance of a typical column; `columns`: how many columns speak for it; `scores` (directions, turns): of all."""

    direction: float
    turn: float
    depth_ratio: float
    columns: int
    scores: Floats


def column_distances(first: Columns, second: Columns) -> Floats:
    """Mean squared differences of all columns at all magnifications: (C, C, 2 MAX_SHIFT + 1).

    [i, j, MAX_SHIFT + s]: of column i of the first with column j of the second, where the first shows things
    exp(s LOG_STEP) as high. Rows that only one of both shows do not count.
    """
    count = len(first.above)
    out = np.zeros((count, count, 2 * MAX_SHIFT + 1), np.float32)
    for plane, shift in enumerate(range(-MAX_SHIFT, MAX_SHIFT + 1)):
        cells = 0
        for one, other in zip(first, second, strict=True):
            rows = one.shape[1] - abs(shift)
            if rows <= 0:
                continue
            a = one[:, max(shift, 0) :][:, :rows].reshape(count, -1)
            b = other[:, max(-shift, 0) :][:, :rows].reshape(count, -1)
            out[:, :, plane] += (a**2).sum(axis=1)[:, None] + (b**2).sum(axis=1) - 2.0 * a @ b.T
            cells += a.shape[1]
        out[:, :, plane] = np.maximum(out[:, :, plane], 0.0) / cells if cells else np.inf
    return out


def _varied(first: Columns, second: Columns) -> tuple[Columns, Columns]:
    """The views without a side of the horizon that looks the same all around: bare ground only dilutes the rest."""
    kept = [
        all(view[side].shape[1] and view[side].var(axis=0).mean() > NOISE for view in (first, second))
        for side in (0, 1)
    ]
    if not any(kept):
        return first, second
    one, other = (
        Columns(*(rows if keep else rows[:, :0] for rows, keep in zip(view, kept, strict=True)))
        for view in (first, second)
    )
    return one, other


def averaged_beside(distances: Floats) -> Floats:
    """Each distance (C, C, planes) averaged with those of `HALF_WINDOW` columns on both sides in both views."""
    count = len(distances)
    skewed = (np.arange(count)[:, None] + np.arange(count)) % count
    along = np.take_along_axis(distances, skewed[:, :, None], axis=1)  # [i, k]: columns i and i + k
    total = sum((np.roll(along, step, axis=0) for step in range(-HALF_WINDOW, HALF_WINDOW + 1)), np.zeros_like(along))
    back = (np.arange(count) - np.arange(count)[:, None]) % count
    return np.take_along_axis(total / np.float32(2 * HALF_WINDOW + 1), back[:, :, None], axis=1)


def likelihood_ratios(distances: Floats) -> Floats:
    """exp(-d / NOISE) over its mean for the same column of the first view: (C, C, planes).

    Averaged over `NOISE_FACTORS`, since some columns repeat better than others.
    """
    total = np.zeros_like(distances)
    for factor in NOISE_FACTORS:
        likely = np.exp(np.maximum(-distances / np.float32(NOISE * factor), np.float32(-60.0)))
        total += likely / likely.mean(axis=(1, 2), keepdims=True)
    return total / np.float32(len(NOISE_FACTORS))


def places_of_columns(count: int) -> tuple[Ints, Ints]:
    """Bearing of a column seen from the target, by the angle from the target's direction: two (C, depth ratios).

    Columns of azimuth (of the target's view, turned to the first one's heading), and planes of `column_distances`, -1
    where there is none. A thing at azimuth x from the target's direction and distance r is at azimuth y and distance
    r' from the target, d away: r' sin y = r sin x, r' cos y = r cos x - d.
    """
    azimuths = 2.0 * math.pi * np.arange(count)[:, None] / count
    x, y = np.cos(azimuths) - DEPTH_RATIOS, np.sin(azimuths)
    columns = np.rint(np.arctan2(y, x) * count / (2.0 * math.pi)).astype(np.int64) % count
    shifts = np.rint(np.log(np.maximum(np.hypot(x, y), 1e-6)) / LOG_STEP).astype(np.int64)
    return columns, np.where(np.abs(shifts) <= MAX_SHIFT, shifts + MAX_SHIFT, -1)


@compiled(nogil=True, fastmath=True)
def _score(ratios: Floats, places: Ints, planes: Ints, prior: Floats, directions: Ints, out: Floats) -> None:
    # ratios (C, planes, C); out (directions, C). Turns are the innermost axis: whole vector instructions.
    count, levels = ratios.shape[0], ratios.shape[1]
    row = np.empty((levels, 2 * count), np.float32)
    likely = np.empty(count, np.float32)
    for a in range(count):
        for s in range(levels):
            for u in range(count):  # backwards, so that a larger turn is a later number
                value = ratios[a, s, (count - u) % count]
                row[s, u] = value
                row[s, u + count] = value
        for k in range(len(directions)):
            x = (a - directions[k]) % count
            likely[:] = np.float32(NO_MATCH)
            for r in range(places.shape[1]):
                s = planes[x, r]
                if s >= 0:
                    first = (count - (places[x, r] + directions[k]) % count) % count
                    share = prior[r]
                    for p in range(count):
                        likely[p] += share * row[s, first + p]
            for p in range(count):
                out[k, p] += math.log(likely[p])


def _scores(distances: Floats, directions: Ints) -> tuple[Floats, Floats]:
    """Log likelihood ratios of directions (D,) and all turns: (D, C); and of single matches, (C, planes, C)."""
    count = len(distances)
    ratios = np.ascontiguousarray(likelihood_ratios(distances).transpose(0, 2, 1))
    out = np.zeros((len(directions), count), np.float32)
    prior = (PRIOR * (1.0 - NO_MATCH)).astype(np.float32)
    _score(ratios, *places_of_columns(count), prior, directions, out)
    return out, ratios


def warped(first: Columns, second: Columns, max_turn: float = math.pi) -> Warp:
    """The direction and turn from the first view to the second for which the columns of both match best.

    `max_turn`: rad, to both sides. Both views are warped to the other, and the scores added (double search, Möller et
    al. 2010).
    """
    count = len(first.above)
    directions = np.arange(0, count, DIRECTION_STEP)
    distances = averaged_beside(column_distances(*_varied(first, second)))
    there, ratios = _scores(distances, directions)
    swapped = np.ascontiguousarray(distances.transpose(1, 0, 2)[:, :, ::-1])
    back, _ = _scores(swapped, directions)
    turns = np.arange(count)
    back_steps = (directions[:, None] + count // 2 - turns) % count / DIRECTION_STEP
    seen_back = np.rint(back_steps).astype(np.int64) % len(directions)
    scores = there + back[seen_back, -turns % count]
    allowed = np.abs((turns + count // 2) % count - count // 2) <= max(max_turn, 0.0) * count / (2.0 * math.pi)
    row, turn = np.unravel_index(int(np.argmax(np.where(allowed, scores, -np.inf))), scores.shape)
    depth_ratio, columns = _support(ratios, int(directions[row]), int(turn))
    angle = 2.0 * math.pi / count
    return Warp(float(directions[row]) * angle, float(turn) * angle, depth_ratio, columns, scores)


def _support(ratios: Floats, direction: int, turn: int) -> tuple[float, int]:
    """The median depth ratio of the columns that match better than by chance, and how many they are."""
    count = len(ratios)
    places, planes = places_of_columns(count)
    rows = np.arange(count)
    x = (rows - direction) % count
    seen = (places[x] + direction - turn) % count
    ratio = np.where(planes[x] >= 0, ratios[rows[:, None], planes[x], seen], 0.0) * PRIOR
    total = ratio.sum(axis=1)
    means = (ratio @ DEPTH_RATIOS)[total > 1.0] / total[total > 1.0]
    return (float(np.median(means)) if len(means) else 1.0), len(means)
