"""Bundle adjustment: landmarks, the poses that see them and the camera, brought into agreement with all bearings."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from omninav.stages.geometry.arrays import Array, Bools, Ints
from omninav.stages.geometry.plane.pose_graph import motion_jacobian
from omninav.stages.geometry.plane.se2 import between, wrap

from .schur_complement import Eliminated, Poses, Sightings, covisibility, eliminate, landmark_steps, residuals

EASING = 2.0
"""Factor by which the scale of the loss (in sigmas) shrinks per step."""
LAST_SCALE = 3.0
"""Scale of the loss at the end (in sigmas)."""
INLIER_SIGMAS = 4.0
"""Sigmas up to which a bearing counts as right."""
WRONG_WEIGHT = 1e-3
"""Weight of a wrong bearing in covariances, beside 1 of a right one: without any its landmark has no place."""
CONVERGED = 1e-4
"""Relative decrease of the cost at which it ends."""
FIRST_DAMPING, MIN_DAMPING, MAX_DAMPING = 1e-4, 1e-9, 1e6
"""Levenberg's factor at the start, the smallest, and that beyond which no step leads further down."""
FIXED, FREE = 1e-6, 1e4
"""Standard deviations (m, rad, or in the unit of a camera's parameter) of what stays and of what is free."""
DIFFERENCE = 1e-5
"""Change of a camera's parameter (pixels, rad) by which bearings are differentiated."""
MAX_COVARIANCES, BATCH = 200, 50
"""Largest number of references whose covariances are computed, evenly spaced: the others have nearly those of the
nearest one. And how many are solved for together."""


class Motions(NamedTuple):
    """Motions that odometry measured. `edges` (E, 2): from which reference to which; `measured` (E, 3): the motion
    between them in the frame of the first (m, m, rad); `sigmas` (E, 3): standard deviations."""

    edges: Ints
    measured: Array
    sigmas: Array


class Lens(NamedTuple):
    """Parameters of a camera that are adjusted too, as corrections of what it is described as.

    `bearings`: a function of corrections (K,) that gives the unit bearings (O, 3) of all sightings in the robot's
    frame; `sigmas` (K,): standard deviations of the description, infinite where nothing is known.
    """

    bearings: Callable[[Array], Array]
    sigmas: Array


class Adjusted(NamedTuple):
    """Poses (R, 3 or 6), points (L, 3), and what the camera's parameters are corrected by (K,).

    `inliers` (O,): sightings that agree; `rms`: the root of their mean squared angle (rad). `covariances`: a
    function that gives those of x, y and heading (R, 3, 3), infinite where nothing was adjusted. Its argument is the
    factor of a bearing's standard deviation, above 1 where neighbouring bearings have correlated errors. Where nothing
    but the first pose is held, they are of the poses in the frame that fits all of them best.
    """

    poses: Array
    points: Array
    camera: Array
    inliers: Bools
    rms: float
    covariances: Callable[[float], Array]


def adjusted(
    poses: Array,
    points: Array,
    references: Ints,
    landmarks: Ints,
    bearings: Array | Lens,
    sigma: float,
    pose_sigmas: Array | None = None,
    motions: Motions | None = None,
    max_steps: int = 100,
    given: Array | None = None,
) -> Adjusted:
    """Adjust poses and landmarks, and a camera's parameters, to all bearings at once, of which some are wrong.

    `poses` (R, 3): x, y, heading (m, rad) of robots on a floor, or (R, 6) with roll, pitch (rad) and height (m); the
    rotation is that about z by the heading, then about y by the pitch, then about x by the roll. `points` (L, 3): m,
    with z = 0 at the height of the projection centre. `references`, `landmarks` (O,): of each sighting; `bearings`
    (O, 3): unit vectors in the robot's frame, or the camera that they come from; `sigma`: their standard deviation
    (rad). `pose_sigmas` (R, 3 or 6): standard deviations of the poses as they are `given`, 0 for one that stays and
    infinite for one that is free; None: the first stays, and all others are free. `given` (R, 3 or 6): None for
    `poses`, where it begins. Bearings alone do not show the scale: it is that of `motions`, or of poses of finite
    sigma.

    Levenberg and Marquardt's method with the landmarks eliminated, in our own code: pyceres would be one more
    dependency with binaries, for two hundred lines. A sighting counts by Geman and McClure's function, whose scale
    shrinks to `LAST_SCALE`, so that a right sighting from a wrong pose is not given up at once (graduated
    non-convexity: Yang, Antonante, Tzoumas & Carlone 2020). A landmark that is seen once, or of which no point is known
    (NaN), tells nothing and stays, as does a reference that nothing is known of.
    """
    poses, points = np.array(poses, np.float64), np.array(points, np.float64)
    lens = bearings if isinstance(bearings, Lens) else Lens(lambda _: bearings, np.empty(0))
    inliers = np.zeros(len(references), np.bool_)
    several = np.bincount(landmarks, minlength=len(points)) > 1
    used = np.flatnonzero((several & np.isfinite(points).all(axis=1))[landmarks])
    if not len(used):
        unknown = np.full((len(poses), 3, 3), math.inf)
        return Adjusted(poses, points, np.zeros(len(lens.sigmas)), inliers, math.nan, lambda _: unknown)
    used = used[np.lexsort((references[used], landmarks[used]))]
    seen, starts = np.unique(landmarks[used], return_index=True)
    sightings = Sightings(references[used].astype(np.int64), np.append(starts, len(used)))
    floating = pose_sigmas is None
    if pose_sigmas is None:
        pose_sigmas = np.full(poses.shape, math.inf)
        pose_sigmas[0] = 0.0
    problem = _Problem(sightings, lens, used, sigma, poses if given is None else given, pose_sigmas, motions)
    state = problem.solved(_State(poses, points[seen], np.zeros(len(lens.sigmas))), max_steps)
    squares = problem.squares(state)
    agreeing = squares < INLIER_SIGMAS**2
    inliers[used] = agreeing
    points[seen] = state.points
    rms = sigma * math.sqrt(squares[agreeing].mean()) if agreeing.any() else math.nan
    beyond = np.abs(state.poses[:, 2]) > math.pi
    state.poses[beyond, 2] = wrap(state.poses[beyond, 2])
    covariances = partial(problem.covariances, state, floating)
    return Adjusted(state.poses, points, state.camera, inliers, rms, covariances)


class _State(NamedTuple):
    poses: Array
    points: Array
    camera: Array


class _Normal(NamedTuple):
    # Factors of the matrix of the poses; the camera's columns beside it, the same solved, and what remains of its own.
    factors: Any
    border: Array
    through: Array
    corner: Array

    def solved(self, right: Array) -> Array:
        """The inverse of the matrix, with the camera eliminated, times (F R, N)."""
        alone = self.factors.solve(right)
        return np.asarray(alone + self.through @ np.linalg.solve(self.corner, self.border.T @ alone))


class _Problem:
    def __init__(
        self, sightings: Sightings, lens: Lens, used: Ints, sigma: float, given: Array, pose_sigmas: Array,
        motions: Motions | None,
    ) -> None:  # fmt: skip
        self.sightings, self.lens, self.used, self.sigma = sightings, lens, used, sigma
        self.given, self.motions = given, motions
        self.held = 1.0 / np.clip(pose_sigmas, FIXED, FREE) ** 2
        self.held_camera = 1.0 / np.clip(lens.sigmas, FIXED, FREE) ** 2
        self.pattern = covisibility(sightings, len(given))

    def solved(self, state: _State, max_steps: int) -> _State:
        squares = self.squares(state)
        scale = max(LAST_SCALE**2, float(np.median(squares)))
        damping = FIRST_DAMPING
        for _ in range(max_steps):
            cost = self.cost(state, squares, scale)
            found, damping = self.descended(state, squares, scale, cost, damping)
            if found is not None:
                state, squares = found, self.squares(found)
            if scale > LAST_SCALE**2:
                scale = max(LAST_SCALE**2, scale / EASING**2)
            elif found is None or cost - self.cost(state, squares, scale) <= CONVERGED * cost:
                break
        return state

    def descended(
        self, state: _State, squares: Array, scale: float, cost: float, damping: float
    ) -> tuple[_State | None, float]:
        """A state of smaller cost, and the damping to begin with the next time; None where there is none."""
        weights, looking = (scale / (scale + squares)) ** 2, self.looking(state.camera)
        while damping < MAX_DAMPING:
            steps, camera, points = self.steps(state, looking, weights, damping)
            tried = _State(state.poses + steps, state.points + points, state.camera + camera)
            if self.cost(tried, self.squares(tried), scale) < cost:
                return tried, max(MIN_DAMPING, damping / 10.0)
            damping *= 10.0
        return None, FIRST_DAMPING

    def steps(
        self, state: _State, looking: tuple[Array, Array], weights: Array, damping: float
    ) -> tuple[Array, Array, Array]:
        """Steps of the poses (R, F), of the camera (K,) and of the landmarks (L, 3)."""
        system, normal = self.normal(state, looking, weights, damping)
        right = system.right + self.held * (state.poses - self.given)
        if self.motions is not None:
            right += (self.slopes(state).T @ self.missed(state).ravel()).reshape(right.shape)
        alone = normal.factors.solve(right.ravel())
        gradient = system.right_camera + self.held_camera * state.camera - normal.border.T @ alone
        camera = -np.linalg.solve(normal.corner, gradient)
        steps = -(alone + normal.through @ camera).reshape(right.shape)
        return steps, camera, landmark_steps(system, self.sightings, steps, camera)

    def normal(
        self, state: _State, looking: tuple[Array, Array], weights: Array, damping: float
    ) -> tuple[Eliminated, _Normal]:
        """The landmarks eliminated, and the normal equations that remain; `weights` (O,) of the sightings."""
        from scipy import sparse  # slow to import, and seldom needed
        from scipy.sparse.linalg import splu

        frames, weights = _frames(state.poses), weights / self.sigma**2
        system = eliminate(frames, state.points, self.sightings, *looking, weights, damping, self.pattern)
        number, freedoms = state.poses.shape
        size, diagonal = number * freedoms, np.arange(freedoms)
        blocks = system.diagonal.copy()
        blocks[:, diagonal, diagonal] += damping * system.curvature + self.held
        off, rows = sparse.bsr_array((system.upper, *self.pattern[::-1]), shape=(size, size)), np.arange(number + 1)
        matrix: Any = sparse.bsr_array((blocks, rows[:-1], rows), shape=(size, size)) + off + off.T
        if self.motions is not None:
            slopes = self.slopes(state)
            matrix = matrix + slopes.T @ slopes
        factors = splu(
            matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
        )
        # The camera's few parameters touch all references: they are eliminated last.
        corner = system.corner + np.diag(damping * system.curvature_camera + self.held_camera)
        border = system.border.reshape(size, -1)
        through = factors.solve(border)
        return system, _Normal(factors, border, through, corner - border.T @ through)

    def covariances(self, state: _State, floating: bool, sigma_factor: float) -> Array:
        """Covariances (R, 3, 3) of the poses; `floating`: in the frame that fits all of them best, as no pose holds it.

        The latter is the inner constraint of a free network: positions are fitted to each other by least squares
        (Triggs, McLauchlan, Hartley & Fitzgibbon 2000, section 9.2).
        """
        weights = np.where(self.squares(state) < INLIER_SIGMAS**2, 1.0, WRONG_WEIGHT) / sigma_factor**2
        _, normal = self.normal(state, self.looking(state.camera), weights, MIN_DAMPING)
        number, freedoms = state.poses.shape
        rows = np.unique(np.linspace(0, number - 1, min(MAX_COVARIANCES, number)).astype(np.int64))
        found = np.empty((len(rows), 3, 3))
        for low in range(0, len(rows), BATCH):
            some = rows[low : low + BATCH]
            units = np.zeros((number, freedoms, len(some), 3))
            units[some[:, None], np.arange(3), np.arange(len(some))[:, None], np.arange(3)] = 1.0
            solved = normal.solved(units.reshape(number * freedoms, -1)).reshape(units.shape)
            found[low : low + BATCH] = solved[some, :3, np.arange(len(some))]
        if floating:
            moves, fit = _rigid_motions(state.poses)
            shared = normal.solved(fit.T)
            moved, with_all = (
                moves.reshape(number, freedoms, 3)[rows, :3],
                shared.reshape(number, freedoms, 3)[rows, :3],
            )
            cross = with_all @ moved.transpose(0, 2, 1)
            found += moved @ (fit @ shared) @ moved.transpose(0, 2, 1) - cross - cross.transpose(0, 2, 1)
        nearest = np.searchsorted((rows[1:] + rows[:-1]) / 2.0, np.arange(number))
        return found[nearest]

    def slopes(self, state: _State) -> Any:
        """Derivatives (3 E, F R) of the motions between the poses, in sigmas."""
        assert self.motions is not None
        edges, _, sigmas = self.motions
        return motion_jacobian(state.poses[:, :3], edges, 1.0 / sigmas, state.poses.shape[1])

    def squares(self, state: _State) -> Array:
        """Squared angles (O,) in sigmas."""
        positions, rotations, _, _ = _frames(state.poses)
        bearings = self.lens.bearings(state.camera)[self.used]
        missed = residuals(positions, rotations, state.points, *self.sightings, bearings)
        return np.asarray(np.einsum("oi,oi->o", missed, missed) / self.sigma**2)

    def missed(self, state: _State) -> Array:
        """Motions between the poses less those that odometry measured (E, 3), in sigmas."""
        assert self.motions is not None
        (one, other), measured = self.motions.edges.T, self.motions.measured
        error = between(state.poses[one, :3], state.poses[other, :3]) - measured
        error[:, 2] = wrap(error[:, 2])
        return np.asarray(error / self.motions.sigmas)

    def cost(self, state: _State, squares: Array, scale: float) -> float:
        total = float((scale * squares / (scale + squares)).sum())
        total += float((self.held * (state.poses - self.given) ** 2).sum())
        total += float((self.held_camera * state.camera**2).sum())
        return total if self.motions is None else total + float((self.missed(state) ** 2).sum())

    def looking(self, camera: Array) -> tuple[Array, Array]:
        """The bearings (O, 3), and their derivatives (O, 3, K) with respect to the camera's parameters."""
        out = np.empty((len(self.used), 3, len(camera)))
        for k in range(len(camera)):
            step = np.zeros(len(camera))
            step[k] = DIFFERENCE
            ahead, back = self.lens.bearings(camera + step), self.lens.bearings(camera - step)
            out[:, :, k] = (ahead - back)[self.used] / (2.0 * DIFFERENCE)
        return self.lens.bearings(camera)[self.used], out


def _frames(poses: Array) -> Poses:
    turns, places = rotations_about(poses[:, 2], 2), np.zeros((len(poses), 3))
    places[:, :2] = poses[:, :2]
    axes, leans = [turns[:, :, 2]], poses.shape[1] == 6
    if leans:
        places[:, 2] = poses[:, 5]
        tilted = turns @ rotations_about(poses[:, 4], 1)
        axes += [tilted[:, :, 0], turns[:, :, 1]]
        turns = tilted @ rotations_about(poses[:, 3], 0)
    return Poses(places, np.ascontiguousarray(turns), np.stack(axes, axis=1), leans)


def _rigid_motions(poses: Array) -> tuple[Array, Array]:
    # Derivatives (F R, 3) of all poses by a motion of their frame, and the motion (3, F R) that fits changes of places.
    moves, places = np.zeros((*poses.shape, 3)), poses[:, :2] - poses[:, :2].mean(axis=0)
    moves[:, [0, 1, 2], [0, 1, 2]] = 1.0
    moves[:, 0, 2], moves[:, 1, 2] = -places[:, 1], places[:, 0]
    seen = moves.copy()
    seen[:, 2:] = 0.0
    return moves.reshape(-1, 3), np.linalg.pinv(seen.reshape(-1, 3))


def rotations_about(angles: Array, axis: int) -> Array:
    """Rotations (N, 3, 3) by angles (N,), rad, about the x, y or z axis: 0, 1 or 2."""
    one, two = (axis + 1) % 3, (axis + 2) % 3
    out = np.zeros((len(angles), 3, 3))
    out[:, axis, axis] = 1.0
    out[:, one, one] = out[:, two, two] = np.cos(angles)
    out[:, two, one], out[:, one, two] = np.sin(angles), -np.sin(angles)
    return out
