"""Relative pose from bearings of which many are wrong: random samples, the largest agreement, refined locally.

The paper's RANSAC (Goedemé et al. 2007, section 7.1.1), on the sphere: a pair agrees where its bearings, moved together
by less than a threshold, meet in front of both cameras (errata 35 and 36 in docs/papers.md). Conventions as in
`epipolar`.
"""

import math
from typing import Literal

import numpy as np
import numpy.typing as npt

from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.probability.small_systems import rotated_by, unit

from .epipolar import decompose, eight_points, five_points, planar_candidates
from .ransac import BATCH, AgreedPose, refined, samples_needed, samples_of

Solver = Literal["planar", "five_point", "eight_point"]
SAMPLE: dict[Solver, int] = {"planar": 2, "five_point": 5, "eight_point": 8}
"""Pairs of bearings in a sample."""
POSES: dict[Solver, int] = {"planar": 4, "five_point": 20, "eight_point": 4}
"""Most poses that a sample gives, both senses of the translation counted."""


def relative_pose(
    first: npt.ArrayLike,
    second: npt.ArrayLike,
    rng: np.random.Generator,
    solver: Solver = "planar",
    threshold: float = math.radians(0.5),
    confidence: float = 0.9999,
    max_samples: int = 5000,
    refine: bool = True,
) -> AgreedPose | None:
    """Pose of view 2 seen from view 1, by what most pairs of unit bearings (N, 3) and (N, 3) agree on.

    `threshold` (rad): see `agreement`. Samples are drawn until one without a wrong pair is among them with
    `confidence`, judged by the share that agrees, at `most` that many. `planar`: a robot on a floor, upright.
    Of poses on which equally many agree, the linear one with the smaller q_e is taken, as in the paper, else the one
    with smaller residuals. `refine`: the best so far is brought to its local optimum, over the two freedoms of a robot
    on a floor or over all five, as the solver has it. None where there are fewer pairs than a sample needs, or no
    sample has a solution. Draws from `rng`.
    """
    first, second = np.ascontiguousarray(first, np.float64), np.ascontiguousarray(second, np.float64)
    size, pairs = SAMPLE[solver], len(first)
    if pairs < size:
        return None
    sine = math.sin(threshold)
    found, least, best, drawn, needed = None, math.inf, (0, -math.inf), 0, float(max_samples)
    while drawn < min(needed, max_samples):
        samples = samples_of(pairs, size, rng)
        rotations, translations, quality, owners = _candidates(solver, first, second, samples)
        drawn += BATCH
        if not len(rotations):
            continue
        counts, costs, senses = _judge(rotations, translations, first, second, sine)
        worth = -quality if solver == "eight_point" else -costs
        order = np.lexsort((-owners, worth, counts))
        k = int(order[-1])
        if (counts[k], worth[k]) <= best:
            continue
        best = int(counts[k]), float(worth[k])
        pose = rotations[k], senses[k] * translations[k]
        if refine:
            pose = refined_pose(*pose, first, second, threshold, solver == "planar")
        # A sample that more agree with need not be the better one once both are refined.
        cost = _tukey(*pose, first, second, sine * sine)
        if cost < least:
            found, least = pose, cost
            agreeing = int(np.count_nonzero(agreement(*found, first, second, threshold)))
            needed = samples_needed(max(agreeing, best[0]) / pairs, size, confidence)
    if found is None:
        return None
    return AgreedPose(*found, agreement(*found, first, second, threshold), drawn)


def false_alarms(
    pose: AgreedPose, first: npt.ArrayLike, second: npt.ArrayLike, threshold: float, solver: Solver = "planar"
) -> float:
    """Expected number of poses that as many pairs agree on among wrong pairs alone: above 1 proves nothing.

    How often a wrong pair agrees with the pose is counted on these bearings, each with all others' partners: where many
    look along the horizon, or along the way, that is often. As many poses are tried as there are samples times `POSES`,
    and a sample's own pairs prove nothing (Moisan & Stival's a-contrario test, 2004). Infinite for fewer than a sample.
    """
    from scipy.special import betainc  # slow to import: not before a run

    first, second = np.ascontiguousarray(first, np.float64), np.ascontiguousarray(second, np.float64)
    pairs, others = len(first), int(np.count_nonzero(pose.inliers)) - SAMPLE[solver]
    poses = float(POSES[solver] * math.comb(pairs, SAMPLE[solver]))
    if others < 1:
        return poses or math.inf
    limit, shifts = math.sin(threshold) ** 2, min(pairs, 40)
    agreeing_by_chance = _agreeing_shifted(pose.rotation, pose.translation, first, second, limit, shifts)
    chance = agreeing_by_chance / (pairs * (shifts - 1))
    # At least this many of the other pairs: the tail of a binomial distribution.
    return poses * float(betainc(others, pairs - SAMPLE[solver] - others + 1, max(chance, 1e-6)))


def _candidates(solver: Solver, first: Array, second: Array, samples: Ints) -> tuple[Array, Array, Array, Ints]:
    # Poses that samples allow, but for the sense of the translation; q_e, 0 where it is not defined; whose they are.
    if solver == "planar":
        rotations, translations, owners = planar_candidates(first, second, samples)
        return rotations, translations, np.zeros(len(owners)), owners
    if solver == "eight_point":
        matrices, quality = eight_points(first[samples], second[samples])
        rotations, translations = decompose(matrices)
        rotations, translations = rotations[:, ::2].reshape(-1, 3, 3), translations[:, ::2].reshape(-1, 3)
        return rotations, translations, np.repeat(quality, 2), np.repeat(np.arange(len(samples)), 2)
    solved = [five_points(first[sample], second[sample]) for sample in samples]
    numbers = np.array([len(rotations) for rotations, _ in solved])
    rotations = np.concatenate([rotations for rotations, _ in solved])
    translations = np.concatenate([translations for _, translations in solved])
    return rotations, translations, np.zeros(len(rotations)), np.repeat(np.arange(len(samples)), numbers)


def agreement(
    rotation: Array, translation: Array, first: npt.ArrayLike, second: npt.ArrayLike, threshold: float
) -> Bools:
    """Which pairs (N,) meet in front of both cameras once their bearings have moved by less than `threshold` (rad).

    Bearings that would meet behind a camera must move until they are parallel, to meet infinitely far away: so a
    distant point, on the sign of whose depths noise decides, still agrees, and one nearby does not.
    """
    first, second = np.ascontiguousarray(first, np.float64), np.ascontiguousarray(second, np.float64)
    return np.asarray(_agree(rotation, translation, first, second, math.sin(threshold) ** 2))


@compiled(nogil=True)
def _agree(R: Array, t: Array, first: Array, second: Array, limit: float) -> Bools:
    agrees = np.empty(len(first), np.bool_)
    for n in range(len(first)):
        agrees[n] = _squares(R, t, first[n], second[n])[0] < limit
    return agrees


@compiled(nogil=True)
def _agreeing_shifted(R: Array, t: Array, first: Array, second: Array, limit: float, shifts: int) -> int:
    agreeing = 0
    for shift in range(1, shifts):
        for n in range(len(first)):
            agreeing += _squares(R, t, first[n], second[n - shift])[0] < limit
    return agreeing


@compiled(nogil=True)
def _residual(R: Array, t: Array, b: Array, c: Array) -> float:
    # Sine of the shared residual of `epipolar`, with its sign: b.(t x R c) over the lengths of t x R c and t x b.
    x = R[0, 0] * c[0] + R[0, 1] * c[1] + R[0, 2] * c[2]
    y = R[1, 0] * c[0] + R[1, 1] * c[1] + R[1, 2] * c[2]
    z = R[2, 0] * c[0] + R[2, 1] * c[1] + R[2, 2] * c[2]
    nx, ny, nz = t[1] * z - t[2] * y, t[2] * x - t[0] * z, t[0] * y - t[1] * x
    mx, my, mz = t[1] * b[2] - t[2] * b[1], t[2] * b[0] - t[0] * b[2], t[0] * b[1] - t[1] * b[0]
    length = nx * nx + ny * ny + nz * nz + mx * mx + my * my + mz * mz
    return (b[0] * nx + b[1] * ny + b[2] * nz) / math.sqrt(length) if length > 0.0 else 0.0


@compiled(nogil=True)
def _squares(R: Array, t: Array, b: Array, c: Array) -> tuple[float, float]:
    # Squared sines of the angle by which two bearings must move to meet in front of both cameras: with t, with -t.
    x = R[0, 0] * c[0] + R[0, 1] * c[1] + R[0, 2] * c[2]
    y = R[1, 0] * c[0] + R[1, 1] * c[1] + R[1, 2] * c[2]
    z = R[2, 0] * c[0] + R[2, 1] * c[1] + R[2, 2] * c[2]
    miss = _residual(R, t, b, c) ** 2
    cos = b[0] * x + b[1] * y + b[2] * z
    here = t[0] * b[0] + t[1] * b[1] + t[2] * b[2]
    there = t[0] * x + t[1] * y + t[2] * z
    behind = miss + (0.5 * max(0.0, 1.0 - cos * cos) if cos > 0.0 else 1.0)
    ahead, back = here - cos * there, cos * here - there  # the signs of both depths
    if ahead > 0.0 and back > 0.0:
        return miss, behind
    return (behind, miss) if ahead < 0.0 and back < 0.0 else (behind, behind)


@compiled(nogil=True)
def _judge(
    rotations: Array, translations: Array, first: Array, second: Array, sine: float
) -> tuple[Ints, Array, Array]:
    # For each pose: how many pairs agree, their truncated squares, and which sense of the translation that is.
    counts, costs, senses = np.empty(len(rotations), np.int64), np.empty(len(rotations)), np.empty(len(rotations))
    limit = sine * sine
    for k in range(len(rotations)):
        plus, minus, cost_plus, cost_minus = 0, 0, 0.0, 0.0
        for n in range(len(first)):
            forth, back = _squares(rotations[k], translations[k], first[n], second[n])
            plus, minus = plus + (forth < limit), minus + (back < limit)
            cost_plus, cost_minus = cost_plus + min(forth, limit), cost_minus + min(back, limit)
        right = plus > minus or (plus == minus and cost_plus <= cost_minus)
        counts[k], costs[k], senses[k] = (plus, cost_plus, 1.0) if right else (minus, cost_minus, -1.0)
    return counts, costs, senses


def refined_pose(
    rotation: Array,
    translation: Array,
    first: npt.ArrayLike,
    second: npt.ArrayLike,
    threshold: float,
    planar: bool,
) -> tuple[Array, Array]:
    """The relative pose at the local optimum of the shared residuals, with Tukey's weights up to `threshold` (rad).

    `planar`: only the turn about the vertical and the direction on the floor move.
    """
    first, second = np.ascontiguousarray(first, np.float64), np.ascontiguousarray(second, np.float64)
    limit, freedoms = math.sin(threshold) ** 2, 2 if planar else 5
    pose = np.ascontiguousarray(rotation), translation
    return refined(_tukey, _normal_equations, _moved, pose, first, second, limit, freedoms)


@compiled(nogil=True)
def _moved(R: Array, t: Array, step: Array) -> tuple[Array, Array]:
    # Freedoms: the turn about the vertical, t sideways, and, unless planar, both other turns and t upwards.
    level = math.hypot(t[0], t[1])
    if len(step) == 2:
        side = np.array([-t[1] / level, t[0] / level, 0.0])
        return rotated_by(R, 0.0, 0.0, step[0]), unit(t + step[1] * side)
    side = np.array([-t[1] / level, t[0] / level, 0.0]) if level > 1e-6 else np.array([1.0, 0.0, 0.0])
    return rotated_by(R, step[2], step[3], step[0]), unit(t + step[1] * side + step[4] * np.cross(t, side))


@compiled(nogil=True)
def _tukey(R: Array, t: Array, first: Array, second: Array, limit: float) -> float:
    cost = 0.0
    for n in range(len(first)):
        square = _squares(R, t, first[n], second[n])[0]
        cost += 1.0 - (1.0 - square / limit) ** 3 if square < limit else 1.0
    return cost


@compiled(nogil=True)
def _normal_equations(
    R: Array, t: Array, first: Array, second: Array, limit: float, freedoms: int
) -> tuple[Array, Array]:
    # Derivatives by difference.
    small = 1e-7
    near_R, near_t = np.empty((freedoms, 3, 3)), np.empty((freedoms, 3))
    for k in range(freedoms):
        step = np.zeros(freedoms)
        step[k] = small
        near_R[k], near_t[k] = _moved(R, t, step)
    square, slope, row = np.zeros((freedoms, freedoms)), np.zeros(freedoms), np.empty(freedoms)
    for n in range(len(first)):
        size = _squares(R, t, first[n], second[n])[0]
        if size >= limit:
            continue
        weight, value = (1.0 - size / limit) ** 2, _residual(R, t, first[n], second[n])
        for k in range(freedoms):
            row[k] = (_residual(near_R[k], near_t[k], first[n], second[n]) - value) / small
        for k in range(freedoms):
            slope[k] += weight * row[k] * value
            for j in range(freedoms):
                square[k, j] += weight * row[k] * row[j]
    return square, slope
