"""Mean similarity of the views whose visibility areas hold a pose."""

import math
from typing import Any

import numpy as np

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Floats, Ints, Shorts

from .visibility_index import Cells, Looks, Numbers

Single = np.floating[Any]

CUTOFF_SIGMAS = 3.0
"""Standard deviations beyond which a Gaussian is 0."""
ARC_TANGENT = tuple(
    np.float32(c) for c in (0.1590383972660733, -0.05115725038296156, 0.023334547989038373, -0.0062283931965400755)
)
"""atan(t) / 2 pi on [0, 1] as t, t^3, t^5, t^7: a least-squares fit that is off by 0.005 degrees at most."""
EXPONENTIAL = tuple(
    np.float32(c) for c in (0.99999997814, -0.99999741652, 0.49994906235, -0.16629159934, 0.04039209277, -0.00626962699)
)
"""exp(-t) on [0, 9 / 16] as 1, t, t^2 ...: a least-squares fit; its eighth power is off by 1.5e-6 of it at most."""


def sums_by_turn(looks: Looks, groups: Ints, rows: Ints, values: Array, each: Array) -> tuple[Floats, Floats]:
    """Sums of the views of some `groups` (S,) over the robot's turn: (S, headings + 1), (S,).

    Entry (s, h) is the sum of the `values` (R, headings) of all views of group s for a robot that sees their point
    2 pi h / headings farther to its right than the robot of the first view did, wherever it has moved since: the
    first is compared at that turn, the others at what they are `turned` more. Between the compared headings values are
    linear. The last column repeats the first. The second result is the number of views. `rows` (references,): a
    reference's row in `values`, -1 where it was not compared; `each` (R,): its sampling weight.
    """
    return _sums(looks.starts, groups, looks.reference, looks.turned, rows, np.ascontiguousarray(values), each)


@compiled(nogil=True, error_model="numpy")
def _sums(
    starts: Ints, groups: Ints, reference: Shorts, turned: Array, rows: Ints, values: Array, each: Array
) -> tuple[Floats, Floats]:
    headings = values.shape[1]
    sums, number = np.zeros((len(groups), headings + 1), np.float32), np.zeros(len(groups), np.float32)
    at_turns = np.empty(headings)
    for g in range(len(groups)):
        at_turns[:] = 0.0
        for a in range(starts[groups[g]], starts[groups[g] + 1]):
            row = rows[reference[a]]
            if row < 0:
                continue
            number[g] += each[row]
            turn = turned[a] / (2 * math.pi) * headings
            whole = math.floor(turn)
            part = (turn - whole) * each[row]
            here = int(whole) % headings
            for h in range(headings):
                after = here + 1 if here + 1 < headings else 0
                at_turns[h] += (each[row] - part) * values[row, here] + part * values[row, after]
                here = after
        sums[g, :headings] = at_turns
        sums[g, headings] = at_turns[0]
    return sums, number


def mean_seen(
    poses: Array,
    cells: Cells,
    summed: Ints,
    sums: Floats,
    number: Floats,
    background_level: float,
    window: float | None = None,
    distance_sigma_m: float = math.inf,
    background_weight: float = 0.0,
) -> Array:
    """Mean similarity of the views whose areas hold a pose, equations 7 and 8: (N, 3) -> (N,).

    `sums` and `number` as `sums_by_turn` gives them, `summed` (G,): each group's row in them, -1 where it has none.
    With a `window` robots look ahead: psi is the angle between the heading and the direction to a point, wrapped to
    [-pi, pi) (erratum 44 in docs/papers.md); d(psi) is 1 up to `window` radians and 0 beyond. Without one they see all
    around, and look up their turn relative to each point. p(M_j | l) of equation 6 falls with the distance d to where a
    group was taken as exp(-d^2 / (2 distance_sigma^2)) and is 0 beyond three sigmas; with an infinite sigma it is the
    paper's.
    `background_level`: the result where K = 0; where K > 0 it counts as much as `background_weight` of a view.
    """
    ahead = window is not None
    min_cosine = math.cos(window) if window is not None and window < math.pi else -2.0
    # fmt: off
    return _seen(
        np.ascontiguousarray(poses), *cells, summed, sums, number, background_level, background_weight,
        distance_sigma_m, ahead, min_cosine,
    )
    # fmt: on


@compiled(nogil=True, error_model="numpy")
def _seen(
    poses: Array,
    starts: Ints,
    items: Numbers,
    origin: tuple[float, float],
    resolution: float,
    rows: int,
    columns: int,
    groups: Floats,
    most: int,
    summed: Ints,
    sums: Floats,
    number: Floats,
    background_level: float,
    background_weight: float,
    distance_sigma_m: float,
    ahead: bool,
    min_cosine: float,
) -> Array:
    # Single precision, from the grid's corner, and one plain loop for each thing to work out: vector instructions.
    headings = np.float32(sums.shape[1] - 1)
    kept, right, up = np.empty(most, np.int64), np.empty(most, np.float32), np.empty(most, np.float32)
    weight, turn = np.empty(most, np.float32), np.empty(most, np.float32)
    whole, part = np.empty(most, np.int32), np.empty(most, np.float32)
    per_near, beyond, along = (
        np.float32(1.0 / distance_sigma_m),
        np.float32(CUTOFF_SIGMAS * CUTOFF_SIGMAS),
        np.float32(min_cosine),
    )
    out = np.empty(len(poses))
    for n in range(len(poses)):
        out[n] = background_level
        i = math.floor((poses[n, 1] - origin[1]) / resolution)
        j = math.floor((poses[n, 0] - origin[0]) / resolution)
        if not (0 <= i < rows and 0 <= j < columns):
            continue
        x, y = np.float32(poses[n, 0] - origin[0]), np.float32(poses[n, 1] - origin[1])
        heading = np.float32(poses[n, 2] / (2 * math.pi) % 1.0)
        sine, cosine = np.float32(math.sin(poses[n, 2])), np.float32(math.cos(poses[n, 2]))
        many = 0
        for g in items[starts[i * columns + j] : starts[i * columns + j + 1]]:
            wide, high = (groups[g, 2] - x) * per_near, (groups[g, 3] - y) * per_near
            far, east, north = wide * wide + high * high, groups[g, 0] - x, groups[g, 1] - y
            off_axis = ahead and east * cosine + north * sine < along * np.sqrt(east * east + north * north)
            if far > beyond or off_axis or summed[g] < 0:
                continue
            kept[many], right[many], up[many], weight[many] = summed[g], east, north, far
            turn[many] = heading + groups[g, 4]
            many += 1
        for k in range(many):
            weight[k] = _gaussian(weight[k])
        if not ahead:
            _turned_past(right, up, turn, many, headings, whole, part)
        total, mass = np.float32(background_weight * background_level), np.float32(background_weight)
        for k in range(many):
            g = kept[k]
            value = sums[g, 0]
            if not ahead:
                value = sums[g, whole[k]]
                value += part[k] * (sums[g, whole[k] + 1] - value)
            total += weight[k] * value
            mass += weight[k] * number[g]
        if mass > 0:
            out[n] = total / mass
    return out


@compiled(nogil=True, error_model="numpy")
def _gaussian(square: Single) -> Single:
    # exp(-square / 2) up to CUTOFF_SIGMAS standard deviations.
    t = square * np.float32(1 / 16)
    power = EXPONENTIAL[4] + t * EXPONENTIAL[5]
    power = EXPONENTIAL[0] + t * (EXPONENTIAL[1] + t * (EXPONENTIAL[2] + t * (EXPONENTIAL[3] + t * power)))
    power *= power
    power *= power
    return power * power


@compiled(nogil=True, error_model="numpy")
def _turned_past(
    right: Floats, up: Floats, turn: Floats, number: int, headings: Single, whole: Shorts, part: Floats
) -> None:
    # How far angles (in turns) are past the directions to points, as columns of the headings: vector instructions.
    # The arc tangent is a polynomial of the smaller over the larger of two sides.
    c1, c3, c5, c7 = ARC_TANGENT
    zero, quarter, half, tiny = np.float32(0), np.float32(0.25), np.float32(0.5), np.float32(1e-12)
    last = np.int32(headings) - np.int32(1)
    for k in range(number):
        wide, high = abs(right[k]), abs(up[k])
        low, top = (wide, high) if wide < high else (high, wide)
        ratio = low / (top + tiny)
        square = ratio * ratio
        angle = ratio * (c1 + square * (c3 + square * (c5 + square * c7)))
        angle = quarter - angle if high > wide else angle
        angle = half - angle if right[k] < zero else angle
        angle = -angle if up[k] < zero else angle
        past = turn[k] - angle
        past = (past - np.floor(past)) * headings
        first = min(np.int32(past), last)
        whole[k], part[k] = first, past - np.float32(first)
