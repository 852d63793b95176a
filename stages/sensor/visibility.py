"""How well each particle explains the view, from the visibility areas that it lies in."""

import math
from typing import Annotated, Any, Literal, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.problems import BadInput
from omninav.stages.geometry.evidence import best_headings, contrast_power, fresh_share
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.grid import FreeSpace, cells_of
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.reach import Reach
from omninav.stages.values.similarity import Similarities
from omninav.stages.values.visibility import VisibilityAreas

Array = npt.NDArray[np.float64]
Floats = npt.NDArray[np.float32]
Ints = npt.NDArray[np.int64]
Shorts = npt.NDArray[np.int32]
Numbers = npt.NDArray[np.uint32]
Single = np.floating[Any]
Window = Literal["step", "triangle", "gaussian"]

SHAPES: dict[Window, int] = {"step": 0, "triangle": 1, "gaussian": 2}
FADED = 3.0
"""Beyond so many standard deviations a Gaussian is 0."""
ATAN = (0.1590383972660733, -0.05115725038296156, 0.023334547989038373, -0.0062283931965400755)
"""atan(t) / 2 pi on [0, 1] as t, t^3, t^5, t^7: a least-squares fit that is off by 0.005 degrees at most."""


class Cells(NamedTuple):
    """What is visible from the cells of a grid: from cell n (row by row) the points `items[starts[n] : starts[n + 1]]`.

    `origin` x, y (m) of the lower left corner; `resolution` (m); `rows`, `columns`.
    """

    starts: Ints
    items: Numbers
    origin: tuple[float, float]
    resolution: float
    rows: int
    columns: int


class Looks(NamedTuple):
    """Views that look at points, point by point: those at point t are `starts[t]` to `starts[t + 1]`.

    `reference` (A,): whose they are. `bearing` (A,): where its robot sees the point, from its heading (rad). `place`
    (A, 2): where it stood (m).
    """

    starts: Ints
    reference: Shorts
    bearing: Array
    place: Array


def visible_points(areas: VisibilityAreas) -> Cells:
    """Which points are visible from each cell."""
    starts, items = _by_cell(areas.starts, areas.runs, *areas.shape)
    return Cells(starts, items, areas.origin, areas.resolution, *areas.shape)


@numba.njit(cache=True, nogil=True)
def _by_cell(starts: Shorts, runs: npt.NDArray[np.uint16], rows: int, columns: int) -> tuple[Ints, Numbers]:
    first = np.zeros(rows * columns + 1, np.int64)
    for k in range(len(runs)):
        for column in range(runs[k, 1], runs[k, 2]):
            first[int(runs[k, 0]) * columns + column + 1] += 1
    for n in range(rows * columns):
        first[n + 1] += first[n]
    filled, items = first[:-1].copy(), np.empty(first[-1], np.uint32)
    for t in range(len(starts) - 1):
        for k in range(starts[t], starts[t + 1]):
            for column in range(runs[k, 1], runs[k, 2]):
                cell = int(runs[k, 0]) * columns + column
                items[filled[cell]] = t
                filled[cell] += 1
    return first, items


def sees_any(poses: Array, cells: Cells) -> npt.NDArray[np.bool_]:
    """Whether any point is visible from poses (N, 3): (N,)."""
    row, column = cells_of(poses, cells.origin, cells.resolution).T
    inside = (row >= 0) & (row < cells.rows) & (column >= 0) & (column < cells.columns)
    number = np.where(inside, row * cells.columns + column, 0)
    sees: npt.NDArray[np.bool_] = inside & (cells.starts[number + 1] > cells.starts[number])
    return sees


def looks_at(areas: VisibilityAreas, poses: Array) -> Looks:
    """The views of references at `poses` (R, 3), by the point they look at."""
    reference, sector = np.nonzero(areas.target >= 0)
    target = areas.target[reference, sector]
    order = np.argsort(target, kind="stable")
    reference, target = reference[order], target[order]
    starts = np.searchsorted(target, np.arange(len(areas.points) + 1))
    way = areas.points[target] - poses[reference, :2]
    bearing = np.arctan2(way[:, 1], way[:, 0]) - poses[reference, 2]
    return Looks(starts, reference.astype(np.int32), bearing, poses[reference, :2].copy())


def sums_by_turn(looks: Looks, rows: Ints, values: Array, each: Array) -> tuple[Floats, Floats]:
    """What views that look at a point add up to, for robots that see the point where they do: (T, headings + 1), (T,).

    Entry (t, h) is the sum of the `values` (R, headings) of all views at point t for a robot whose heading is 2 pi h /
    headings past the direction from it to the point: it sees the point so far to its right. So a view that saw it at
    its `bearing` is compared turned by their sum, whatever way the robot has moved meanwhile. Between the compared
    headings values are linear, here and when this is looked up; the last column is the first again. The second is how
    many views there are. `rows` (references,): a reference's row in `values`, -1 where it was not compared; `each`
    (R,): how many it counts as.
    """
    return _sums(looks.starts, looks.reference, looks.bearing, rows, np.ascontiguousarray(values), each)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _sums(
    starts: Ints, reference: Shorts, bearing: Array, rows: Ints, values: Array, each: Array
) -> tuple[Floats, Floats]:
    headings = values.shape[1]
    sums, number = np.zeros((len(starts) - 1, headings + 1), np.float32), np.zeros(len(starts) - 1, np.float32)
    at_turns = np.empty(headings)
    for t in range(len(starts) - 1):
        at_turns[:] = 0.0
        for a in range(starts[t], starts[t + 1]):
            row = rows[reference[a]]
            if row < 0:
                continue
            number[t] += each[row]
            turn = bearing[a] / (2 * math.pi) * headings
            whole = math.floor(turn)
            part = (turn - whole) * each[row]
            here = int(whole) % headings
            for h in range(headings):
                after = here + 1 if here + 1 < headings else 0
                at_turns[h] += (each[row] - part) * values[row, here] + part * values[row, after]
                here = after
        sums[t, :headings] = at_turns
        sums[t, headings] = at_turns[0]
    return sums, number


def mean_around(poses: Array, cells: Cells, points: Array, sums: Floats, number: Floats, otherwise: float) -> Array:
    """Equation 7 for robots that see all around: the mean over the views of all points that they see, (N, 3) -> (N,).

    `points` (T, 2); `sums` and `number` as `sums_by_turn` gives them. `otherwise`: where no point is visible.
    """
    xy = np.ascontiguousarray(points, np.float32)
    return _around(np.ascontiguousarray(poses), *cells, xy, sums, number, otherwise)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _around(
    poses: Array,
    starts: Ints,
    items: Numbers,
    origin: tuple[float, float],
    resolution: float,
    rows: int,
    columns: int,
    points: Floats,
    sums: Floats,
    number: Floats,
    otherwise: float,
) -> Array:
    headings, most = sums.shape[1] - 1, 1
    for cell in range(len(starts) - 1):
        most = max(most, starts[cell + 1] - starts[cell])
    right, up = np.empty(most, np.float32), np.empty(most, np.float32)
    whole, part = np.empty(most, np.int32), np.empty(most, np.float32)
    out = np.empty(len(poses))
    for n in range(len(poses)):
        out[n] = otherwise
        i = math.floor((poses[n, 1] - origin[1]) / resolution)
        j = math.floor((poses[n, 0] - origin[0]) / resolution)
        if not (0 <= i < rows and 0 <= j < columns):
            continue
        seen = items[starts[i * columns + j] : starts[i * columns + j + 1]]
        x, y, heading = np.float32(poses[n, 0]), np.float32(poses[n, 1]), np.float32(poses[n, 2] / (2 * math.pi))
        for k in range(len(seen)):
            right[k], up[k] = points[seen[k], 0] - x, points[seen[k], 1] - y
        _turns_past(right, up, len(seen), heading, np.float32(headings), whole, part)
        total, mass = np.float32(0), np.float32(0)
        for k in range(len(seen)):
            before = sums[seen[k], whole[k]]
            total += before + part[k] * (sums[seen[k], whole[k] + 1] - before)
            mass += number[seen[k]]
        if mass > 0:
            out[n] = total / mass
    return out


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _turns_past(
    right: Floats, up: Floats, number: int, heading: Single, headings: Single, whole: Shorts, part: Floats
) -> None:
    # A heading (in turns) past the directions to points, as columns of so many headings: a loop of vector instructions.
    # The arc tangent is a polynomial of the smaller over the larger of two sides.
    c1, c3, c5, c7 = np.float32(ATAN[0]), np.float32(ATAN[1]), np.float32(ATAN[2]), np.float32(ATAN[3])
    zero, quarter, half, tiny = np.float32(0), np.float32(0.25), np.float32(0.5), np.float32(1e-12)
    last = np.int32(headings) - np.int32(1)
    for k in range(number):
        wide, high = abs(right[k]), abs(up[k])
        low, top = (wide, high) if wide < high else (high, wide)
        ratio = low / (top + tiny)
        square = ratio * ratio
        turn = ratio * (c1 + square * (c3 + square * (c5 + square * c7)))
        turn = quarter - turn if high > wide else turn
        turn = half - turn if right[k] < zero else turn
        turn = -turn if up[k] < zero else turn
        turn = heading - turn
        turn = (turn - np.floor(turn)) * headings
        first = min(np.int32(turn), last)
        whole[k], part[k] = first, turn - np.float32(first)


def mean_ahead(
    poses: Array,
    cells: Cells,
    points: Array,
    sums: Floats,
    number: Floats,
    otherwise: float,
    window: float,
    shape: Window = "step",
) -> Array:
    """Equations 7 and 8 for robots that look ahead: the mean over the views of points near their axis, (N, 3) -> (N,).

    `sums` (T,) and `number` (T,): of the views at each point. psi is the angle between a heading and the direction to a
    point, wrapped to [-pi, pi) (erratum 44). d(psi) is 1 up to `window` radians and 0 beyond (`step`, the paper's),
    falls to 0 there (`triangle`), or has it as its standard deviation (`gaussian`). `otherwise`: where K = 0.
    """
    farthest = min(FADED * window if shape == "gaussian" else window, math.pi)
    poses, points = np.ascontiguousarray(poses), np.ascontiguousarray(points)
    return _ahead(poses, *cells, points, sums, number, otherwise, window, math.cos(farthest), SHAPES[shape])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _ahead(
    poses: Array,
    starts: Ints,
    items: Numbers,
    origin: tuple[float, float],
    resolution: float,
    rows: int,
    columns: int,
    points: Array,
    sums: Floats,
    number: Floats,
    otherwise: float,
    window: float,
    least: float,
    shape: int,
) -> Array:
    out = np.empty(len(poses))
    for n in range(len(poses)):
        out[n] = otherwise
        x, y, sine, cosine = poses[n, 0], poses[n, 1], math.sin(poses[n, 2]), math.cos(poses[n, 2])
        i, j = math.floor((y - origin[1]) / resolution), math.floor((x - origin[0]) / resolution)
        if not (0 <= i < rows and 0 <= j < columns):
            continue
        cell = i * columns + j
        total, mass = 0.0, 0.0
        for k in range(starts[cell], starts[cell + 1]):
            t = items[k]
            right, up = points[t, 0] - x, points[t, 1] - y
            ahead = right * cosine + up * sine
            if ahead < least * math.sqrt(right * right + up * up):
                continue
            weight = 1.0
            if shape:
                aside = abs(math.atan2(up * cosine - right * sine, ahead)) / window
                weight = 1.0 - aside if shape == 1 else math.exp(-0.5 * aside * aside)
            total += weight * sums[t]
            mass += weight * number[t]
        if mass > 0.0:
            out[n] = total / mass
    return out


def mean_near(
    poses: Array,
    cells: Cells,
    points: Array,
    looks: Looks,
    rows: Ints,
    values: Array,
    each: Array,
    otherwise: float,
    near: float,
    window: float | None = None,
    shape: Window = "step",
) -> Array:
    """Equations 7 and 8 where views count less the farther from a robot they were taken: (N, 3) -> (N,).

    p(M_j | l) of equation 6 falls with the distance d between both as exp(-d^2 / (2 near^2)), and is 0 beyond
    3 `near` (m). `window` (rad) and `shape` as in `mean_ahead`; None: all around, where `values` (R, headings) are
    looked up as in `sums_by_turn`. `rows`, `each`: as there. `otherwise`: where K = 0.
    """
    farthest = math.pi if window is None else min(FADED * window if shape == "gaussian" else window, math.pi)
    at = np.ascontiguousarray(poses), *cells, np.ascontiguousarray(points), *looks, rows, np.ascontiguousarray(values)
    return _near(*at, each, otherwise, near, window is None, window or math.pi, farthest, SHAPES[shape])


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _near(
    poses: Array,
    starts: Ints,
    items: Numbers,
    origin: tuple[float, float],
    resolution: float,
    rows: int,
    columns: int,
    points: Array,
    first: Ints,
    reference: Shorts,
    bearing: Array,
    place: Array,
    row_of: Ints,
    values: Array,
    each: Array,
    otherwise: float,
    near: float,
    around: bool,
    window: float,
    farthest: float,
    shape: int,
) -> Array:
    headings = values.shape[1]
    decay, beyond = -0.5 / (near * near), (FADED * near) ** 2
    out = np.empty(len(poses))
    for n in range(len(poses)):
        out[n] = otherwise
        x, y, heading = poses[n, 0], poses[n, 1], poses[n, 2]
        i, j = math.floor((y - origin[1]) / resolution), math.floor((x - origin[0]) / resolution)
        if not (0 <= i < rows and 0 <= j < columns):
            continue
        total, mass = 0.0, 0.0
        for t in items[starts[i * columns + j] : starts[i * columns + j + 1]]:
            past, known = 0.0, False
            for a in range(first[t], first[t + 1]):
                right, up, row = place[a, 0] - x, place[a, 1] - y, row_of[reference[a]]
                far = right * right + up * up
                if row < 0 or far > beyond:
                    continue
                if not known:
                    past = heading - math.atan2(points[t, 1] - y, points[t, 0] - x)
                    past -= 2 * math.pi * math.floor((past + math.pi) / (2 * math.pi))
                    known = True
                weight, value = each[row] * math.exp(decay * far), values[row, 0]
                if around:
                    turn = (past + bearing[a]) / (2 * math.pi) * headings
                    turn -= headings * math.floor(turn / headings)
                    whole = min(int(turn), headings - 1)
                    before, after = values[row, whole], values[row, whole + 1 if whole + 1 < headings else 0]
                    value = before + (after - before) * (turn - whole)
                elif abs(past) > farthest:
                    break
                elif shape:
                    aside = abs(past) / window
                    weight *= 1.0 - aside if shape == 1 else math.exp(-0.5 * aside * aside)
                total += weight * value
                mass += weight
        if mass > 0.0:
            out[n] = total / mass
    return out


class Visibility(Stage):
    """Likelihood of particles from the views whose visibility areas they lie in.

    Wolf, Burgard & Burkhardt 2005, section V, equations 6 to 8: a particle's likelihood is the mean similarity of the
    present picture to those views that could be seen from it; it lies in their visibility area and, with an ordinary
    camera, its heading deviates from the direction to their point lambda by at most `window_deg` (5 in the paper;
    `shape` of the window: step, triangle, gaussian). Where there is none (K = 0) it is the mean similarity of the
    present picture to the whole database (erratum 44).

    A robot that sees all around sees lambda with any heading, somewhere: there a view is compared turned so that lambda
    is where the robot sees it, which differs from the turn of its heading by the parallax of its way. `sees` says which
    of both it is: `auto` takes all around where the match compares several headings.

    Similarities hardly differ between places (erratum 45), and so do their means. So they are raised to a power: null
    takes it from the view, `contrast` nats for each standard deviation of log S over the references, each at its best
    heading; 1 is the paper's. Each is raised before they are averaged. The paper's p(M_j | l) is uniform over all views
    whose area holds the particle; with `near_m` it falls with the distance between the particle and where the view was
    taken, as a Gaussian of so many metres: not of reaches, which are hardly any where windows of one place look
    different ways. With `independent` and `motion` wired, pictures taken at one place count as less than one:
    likelihoods are raised to the way since the picture before over so many reaches (port `reach`, else of `reach_m`),
    down to `standing`; 0, as in the paper: never.

    `proposals`: poses anywhere in the free space (port `free`), all headings, of equal weight, drawn anew at each
    picture; `fusion=random_samples` takes its random samples from them. Without a free space there are none.

    `retrieval` false is the ablation of section VI-E: all particles that lie in any visibility area weigh alike, and
    all others nothing, whatever the picture shows.
    """

    window_deg: Annotated[float, Bounds(gt=0, le=180)] = 5.0
    shape: Window = "step"
    sees: Literal["auto", "ahead", "around"] = "auto"
    power: Annotated[float, Bounds(gt=0)] | None = None
    contrast: Annotated[float, Bounds(gt=0)] = 2.0
    near_m: Annotated[float, Bounds(gt=0)] | None = None
    independent: Annotated[float, Bounds(ge=0)] = 0.0
    standing: Annotated[float, Bounds(ge=0, le=1)] = 0.05
    reach_m: Annotated[float, Bounds(gt=0)] = 0.5
    retrieval: bool = True
    proposals: Annotated[int, Bounds(ge=0)] = 100

    class Out(Outputs):
        """Likelihood of each particle, and poses anywhere."""

        likelihood: Likelihood
        proposals: Particles | None = None

    def setup(self, ctx: Context) -> None:
        """No lists yet: areas and map come with the first picture."""
        self._areas: VisibilityAreas | None = None

    def step(
        self,
        ctx: Context,
        similarities: Similarities,
        particles: Particles,
        map: ReferenceGraph,
        areas: VisibilityAreas,
        motion: Motion | None = None,
        reach: Reach | None = None,
        free: FreeSpace | None = None,
    ) -> Out:
        """Weigh all particles."""
        values, proposals = similarities.values, self._anywhere(ctx, free)
        if not values.size:
            return self.Out(likelihood=Likelihood(np.ones(len(particles.poses))), proposals=proposals)
        if areas is not self._areas:
            if len(areas.target) != len(map):
                raise BadInput(
                    f"sensor: the map has {len(map)} references, the visibility areas are of {len(areas.target)}; wire "
                    "areas.map to the same map, which must not grow"
                )
            self._areas = areas
            self._cells, self._looks = visible_points(areas), looks_at(areas, map.poses)
        if not self.retrieval:
            seen = sees_any(particles.poses, self._cells).astype(np.float64)
            return self.Out(likelihood=Likelihood(seen), proposals=proposals)
        candidates = np.arange(len(map)) if similarities.candidates is None else similarities.candidates
        rows = np.full(len(map), -1, np.int64)
        rows[candidates] = np.arange(len(candidates))
        each = np.ones(len(values)) if similarities.stands_for is None else similarities.stands_for
        best = best_headings(np.ascontiguousarray(values))
        power = contrast_power(best, self.contrast, similarities.stands_for) if self.power is None else self.power
        raised: Array = (values.astype(np.float64) / max(float(best.max()), 1e-12)) ** power
        anywhere = float(np.average(raised.mean(axis=1), weights=each))
        around = values.shape[1] > 1 if self.sees == "auto" else self.sees == "around"
        window, unit = math.radians(self.window_deg), self.reach_m if reach is None else reach.metres
        where = particles.poses, self._cells, areas.points
        if self.near_m is not None:
            ahead = (None if around else window, self.shape)
            mean = mean_near(*where, self._looks, rows, raised, each, anywhere, self.near_m, *ahead)
        elif around:
            mean = mean_around(*where, *sums_by_turn(self._looks, rows, raised, each), anywhere)
        else:
            sums, number = sums_by_turn(self._looks, rows, raised[:, :1], each)
            mean = mean_ahead(*where, sums[:, 0], number, anywhere, window, self.shape)
        way = None if motion is None else math.hypot(motion.x, motion.y)
        fresh = fresh_share(way, self.independent * unit, self.standing)
        return self.Out(likelihood=Likelihood(mean**fresh, anywhere, fresh), proposals=proposals)

    def _anywhere(self, ctx: Context, free: FreeSpace | None) -> Particles | None:
        if free is None or not self.proposals:
            return None
        return Particles(free.draw(ctx.rng, self.proposals), np.full(self.proposals, 1.0 / self.proposals))
