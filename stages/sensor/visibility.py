"""How well each particle explains the view, from the visibility areas that it lies in."""

import math
from typing import Annotated, Any, Literal, NamedTuple

import numba
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.probability.evidence import best_headings, contrast_power, fresh_share
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.grid import FreeSpace, cells_of
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
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
BELL = tuple(
    np.float32(c) for c in (0.99999997814, -0.99999741652, 0.49994906235, -0.16629159934, 0.04039209277, -0.00626962699)
)
"""exp(-t) on [0, 9 / 16] as 1, t, t^2 ...: a least-squares fit; its eighth power is off by 1.5e-6 of it at most."""


class Looks(NamedTuple):
    """What the views of a map look at: group by group, all views of one point or each view on its own.

    `target` (G,): the point that a group looks at; `point` (G, 2) where that is (m), `place` (G, 2) where its views
    were taken, in the mean (m); `bearing` (G,): where the robot of its first view sees the point, from its heading
    (rad). The views of group g are `starts[g]` to `starts[g + 1]`. `reference` (A,): whose they are. `turned` (A,): how
    much farther to the left than that of the first its robot sees the point (rad).
    """

    target: Shorts
    point: Array
    place: Array
    bearing: Array
    starts: Ints
    reference: Shorts
    turned: Array


class Cells(NamedTuple):
    """What is seen from the cells of a grid: from cell n (row by row) the groups `items[starts[n] : starts[n + 1]]`.

    `origin` x, y (m) of the lower left corner; `resolution` (m); `rows`, `columns`.
    """

    starts: Ints
    items: Numbers
    origin: tuple[float, float]
    resolution: float
    rows: int
    columns: int


def looks_at(areas: VisibilityAreas, poses: Array, each_view: bool = False) -> Looks:
    """The views of references at `poses` (R, 3): grouped by the point they look at, or each on its own."""
    reference, sector = np.nonzero(areas.target >= 0)
    target = areas.target[reference, sector]
    order = np.argsort(target, kind="stable")
    reference, target = reference[order], target[order]
    place, point = poses[reference, :2], areas.points[target]
    bearing = np.arctan2(*(point - place).T[::-1]) - poses[reference, 2]
    views = np.arange(len(target) + 1)
    starts = views if each_view else np.append(np.flatnonzero(np.diff(target, prepend=-1)), len(target))
    first, number = starts[:-1], np.diff(starts)
    mean = np.add.reduceat(place, first, axis=0) / number[:, None] if len(first) else place
    turned = bearing - np.repeat(bearing[first], number)
    return Looks(target[first], point[first], mean, bearing[first], starts, reference.astype(np.int32), turned)


def seen_from(areas: VisibilityAreas, looks: Looks, within: float = math.inf) -> Cells:
    """Which groups are seen from each cell: those whose point is visible, taken `within` metres of any spot of it."""
    radius = within / areas.resolution + math.sqrt(0.5)  # in cells, from the middle of one: its corners lie so far out
    middle = (looks.place - areas.origin) / areas.resolution - 0.5
    starts, items = _by_cell(areas.starts, areas.runs, *areas.shape, looks.target, middle, radius)
    return Cells(starts, items, areas.origin, areas.resolution, *areas.shape)


@numba.njit(cache=True, nogil=True)
def _by_cell(
    starts: Shorts, runs: npt.NDArray[np.uint16], rows: int, columns: int, target: Shorts, middle: Array, radius: float
) -> tuple[Ints, Numbers]:
    first, filled, items = np.zeros(rows * columns + 1, np.int64), np.empty(0, np.int64), np.empty(0, np.uint32)
    for listed in (False, True):
        for g in range(len(target)):
            for k in range(starts[target[g]], starts[target[g] + 1]):
                up = float(runs[k, 0]) - middle[g, 1]
                if abs(up) > radius:
                    continue
                wide, row = math.sqrt(radius * radius - up * up), int(runs[k, 0]) * columns
                left = int(max(float(runs[k, 1]), np.ceil(middle[g, 0] - wide)))
                behind = int(min(float(runs[k, 2]), np.floor(middle[g, 0] + wide) + 1.0))
                for cell in range(row + left, row + behind):
                    if listed:
                        items[filled[cell]] = g
                        filled[cell] += 1
                    else:
                        first[cell + 1] += 1
        if not listed:
            first = np.cumsum(first)
            filled, items = first[:-1].copy(), np.empty(first[-1], np.uint32)
    return first, items


def sees_any(poses: Array, cells: Cells) -> npt.NDArray[np.bool_]:
    """Whether anything is seen from poses (N, 3): (N,)."""
    row, column = cells_of(poses, cells.origin, cells.resolution).T
    inside = (row >= 0) & (row < cells.rows) & (column >= 0) & (column < cells.columns)
    number = np.where(inside, row * cells.columns + column, 0)
    sees: npt.NDArray[np.bool_] = inside & (cells.starts[number + 1] > cells.starts[number])
    return sees


def sums_by_turn(looks: Looks, rows: Ints, values: Array, each: Array) -> tuple[Floats, Floats]:
    """What the views of a group add up to, for robots that see its point where they do: (G, headings + 1), (G,).

    Entry (g, h) is the sum of the `values` (R, headings) of all views of group g for a robot that sees their point 2 pi
    h / headings farther to its right than that of the first did, whatever way it has moved meanwhile: the first is
    compared so much turned, the others by what they are `turned` more. Between the compared headings values are linear,
    here and when this is looked up; the last column is the first again. The second is how many views there are. `rows`
    (references,): a reference's row in `values`, -1 where it was not compared; `each` (R,): how many it counts as.
    """
    return _sums(looks.starts, looks.reference, looks.turned, rows, np.ascontiguousarray(values), each)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _sums(
    starts: Ints, reference: Shorts, turned: Array, rows: Ints, values: Array, each: Array
) -> tuple[Floats, Floats]:
    headings = values.shape[1]
    sums, number = np.zeros((len(starts) - 1, headings + 1), np.float32), np.zeros(len(starts) - 1, np.float32)
    at_turns = np.empty(headings)
    for g in range(len(starts) - 1):
        at_turns[:] = 0.0
        for a in range(starts[g], starts[g + 1]):
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
    looks: Looks,
    sums: Floats,
    number: Floats,
    otherwise: float,
    window: float | None = None,
    shape: Window = "step",
    near: float = math.inf,
) -> Array:
    """Equations 7 and 8, the mean similarity of the views whose areas hold a pose: (N, 3) -> (N,).

    `sums` and `number` as `sums_by_turn` gives them. With a `window` robots look ahead: psi is the angle between a
    heading and the direction to a point, wrapped to [-pi, pi) (erratum 44); d(psi) is 1 up to `window` radians and 0
    beyond (`step`, the paper's), falls to 0 there (`triangle`), or has it as its standard deviation (`gaussian`).
    Without one they see all around, and look up their turn past each point. p(M_j | l) of equation 6 falls with the
    distance d to where a group was taken as exp(-d^2 / (2 near^2)), and is 0 beyond 3 `near` (m); where that is
    infinite, it is the paper's. `otherwise`: where K = 0.
    """
    farthest = math.pi if window is None else min(FADED * window if shape == "gaussian" else window, math.pi)
    turns = looks.bearing / (2 * math.pi)
    lies = np.column_stack([looks.point - cells.origin, looks.place - cells.origin, turns % 1.0]).astype(np.float32)
    least = math.cos(farthest) if farthest < math.pi else -2.0
    ahead = window is not None, window or math.pi, least, SHAPES[shape]
    return _seen(np.ascontiguousarray(poses), *cells, lies, sums, number, otherwise, near, *ahead)


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _seen(
    poses: Array,
    starts: Ints,
    items: Numbers,
    origin: tuple[float, float],
    resolution: float,
    rows: int,
    columns: int,
    lies: Floats,
    sums: Floats,
    number: Floats,
    otherwise: float,
    near: float,
    ahead: bool,
    window: float,
    least: float,
    shape: int,
) -> Array:
    # Single precision, from the grid's corner, and one plain loop for each thing to work out: vector instructions.
    headings, most = np.float32(sums.shape[1] - 1), 1
    for cell in range(rows * columns):
        most = max(most, starts[cell + 1] - starts[cell])
    kept, right, up = np.empty(most, np.uint32), np.empty(most, np.float32), np.empty(most, np.float32)
    weight, turn = np.empty(most, np.float32), np.empty(most, np.float32)
    whole, part = np.empty(most, np.int32), np.empty(most, np.float32)
    per_near, beyond, along = np.float32(1.0 / near), np.float32(FADED * FADED), np.float32(least)
    out = np.empty(len(poses))
    for n in range(len(poses)):
        out[n] = otherwise
        i = math.floor((poses[n, 1] - origin[1]) / resolution)
        j = math.floor((poses[n, 0] - origin[0]) / resolution)
        if not (0 <= i < rows and 0 <= j < columns):
            continue
        x, y = np.float32(poses[n, 0] - origin[0]), np.float32(poses[n, 1] - origin[1])
        heading = np.float32(poses[n, 2] / (2 * math.pi) % 1.0)
        sine, cosine = np.float32(math.sin(poses[n, 2])), np.float32(math.cos(poses[n, 2]))
        many = 0
        for g in items[starts[i * columns + j] : starts[i * columns + j + 1]]:
            wide, high = (lies[g, 2] - x) * per_near, (lies[g, 3] - y) * per_near
            far, east, north = wide * wide + high * high, lies[g, 0] - x, lies[g, 1] - y
            off_axis = ahead and east * cosine + north * sine < along * np.sqrt(east * east + north * north)
            if far > beyond or off_axis:
                continue
            kept[many], right[many], up[many], weight[many], turn[many] = g, east, north, far, heading + lies[g, 4]
            many += 1
        for k in range(many):
            weight[k] = _bell(weight[k])
        if not ahead:
            _turned_past(right, up, turn, many, headings, whole, part)
        elif shape:
            for k in range(many):
                aside = math.atan2(up[k] * cosine - right[k] * sine, right[k] * cosine + up[k] * sine) / window
                weight[k] *= 1.0 - abs(aside) if shape == 1 else _bell(np.float32(aside * aside))
        total, mass = np.float32(0), np.float32(0)
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


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _bell(square: Single) -> Single:
    # exp(-square / 2) up to FADED standard deviations.
    t = square * np.float32(1 / 16)
    power = BELL[4] + t * BELL[5]
    power = BELL[0] + t * (BELL[1] + t * (BELL[2] + t * (BELL[3] + t * power)))
    power *= power
    power *= power
    return power * power


@numba.njit(cache=True, nogil=True, error_model="numpy")
def _turned_past(
    right: Floats, up: Floats, turn: Floats, number: int, headings: Single, whole: Shorts, part: Floats
) -> None:
    # How far angles (in turns) are past the directions to points, as columns of so many headings: vector instructions.
    # The arc tangent is a polynomial of the smaller over the larger of two sides.
    c1, c3, c5, c7 = np.float32(ATAN[0]), np.float32(ATAN[1]), np.float32(ATAN[2]), np.float32(ATAN[3])
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

    Similarities hardly differ between places (erratum 45), and so do their means. They may be raised to a `power`; 1 is
    the paper's, and null takes it from the view: `contrast` nats for each standard deviation of log S over the
    references, each at its best heading. Each is raised before they are averaged. The paper's p(M_j | l) is uniform
    over all views whose area holds the particle (`near_m` null); here it falls with the distance between the particle
    and where the view was taken, as a Gaussian of `near_m` metres: not of reaches, which differ from camera to camera
    in one place.
    With `independent` and `motion` wired, pictures taken at one place count as less than one: likelihoods are raised to
    the way since the picture before over so many reaches (port `reach`, else of `reach_m`), down to `standing`; 0, as
    in the paper: never. Defaults: docs/experiments/retrieval_mcl_defaults.md.

    `proposals`: poses anywhere in the free space (port `free`), all headings, of equal weight, drawn anew at each
    picture; `fusion=uniform_recovery` takes its random samples from them. Without a free space there are none.

    `retrieval` false is the ablation of section VI-E: all particles that lie in any visibility area weigh alike, and
    all others nothing, whatever the picture shows.
    """

    window_deg: Annotated[float, Bounds(gt=0, le=180)] = 5.0
    shape: Window = "step"
    sees: Literal["auto", "ahead", "around"] = "auto"
    power: Annotated[float, Bounds(gt=0)] | None = 1.0
    contrast: Annotated[float, Bounds(gt=0)] = 2.0
    near_m: Annotated[float, Bounds(gt=0)] | None = 1.0
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
        length_scale: LengthScale | None = None,
        free: FreeSpace | None = None,
    ) -> Out:
        """Weigh all particles."""
        values, proposals = similarities.values, self._anywhere(ctx, free)
        if not values.size:
            return self.Out(likelihood=Likelihood(np.ones(len(particles.poses))), proposals=proposals)
        near = self.near_m if self.near_m is not None and self.retrieval else math.inf
        if areas is not self._areas:
            if len(areas.target) != len(map):
                raise BadInput(
                    f"sensor: the map has {len(map)} references, the visibility areas are of {len(areas.target)}; wire "
                    "areas.map to the same map, which must not grow"
                )
            self._areas = areas
            self._looks = looks_at(areas, map.poses, each_view=near < math.inf)
            self._cells = seen_from(areas, self._looks, FADED * near)
        if not self.retrieval:
            seen = sees_any(particles.poses, self._cells).astype(np.float64)
            return self.Out(likelihood=Likelihood(seen), proposals=proposals)
        _, rows = similarities.rows(len(map))
        each = np.ones(len(values)) if similarities.sampling_weight is None else similarities.sampling_weight
        best = best_headings(np.ascontiguousarray(values))
        power = contrast_power(best, self.contrast, similarities.sampling_weight) if self.power is None else self.power
        raised: Array = (values.astype(np.float64) / max(float(best.max()), 1e-12)) ** power
        anywhere = float(np.average(raised.mean(axis=1), weights=each))
        around = values.shape[1] > 1 if self.sees == "auto" else self.sees == "around"
        window, unit = math.radians(self.window_deg), self.reach_m if length_scale is None else length_scale.metres
        sums, number = sums_by_turn(self._looks, rows, raised if around else raised[:, :1], each)
        seen_by = None if around else window, self.shape, near
        mean = mean_seen(particles.poses, self._cells, self._looks, sums, number, anywhere, *seen_by)
        way = None if motion is None else math.hypot(motion.x, motion.y)
        fresh = fresh_share(way, self.independent * unit, self.standing)
        return self.Out(likelihood=Likelihood(mean**fresh, anywhere, fresh), proposals=proposals)

    def _anywhere(self, ctx: Context, free: FreeSpace | None) -> Particles | None:
        if free is None or not self.proposals:
            return None
        return Particles(free.draw(ctx.rng, self.proposals), np.full(self.proposals, 1.0 / self.proposals))
