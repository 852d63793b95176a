"""Weights particles by the similarities of the references near them."""

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.arrays import Array, Floats, Ints, Shorts
from omninav.stages.geometry.probability.evidence import contrast_power, hazen_quantile
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.length_scale import LengthScale, metres_of
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities, SimilarityField

from .calibrated_similarity import likelihood_ratios, novelty_and_kidnapping
from .nearest_cells import NearestCells

CELLS_PER_LENGTH_SCALE = 4
CUTOFF_SIGMAS = 3.0
"""Fading distances beyond which a reference keeps less than 1.2 % of its influence."""
FAR = 60.0
"""Distance to the nearest reference beyond which nothing is expected where references do not fade, length scales."""
MIN_SQUARE_M2 = 1e-4
"""Least squared distance in a reference's weight where references do not fade: (1 cm)^2."""
BACKGROUND_DISTANCE = 3.0
"""Distance from the best reference beyond which references are background, length scales."""
NEIGHBOURS = 4
"""References between which a particle's similarity is interpolated."""


class ComparedRows:
    """Each thing's row among those that were compared, -1 where it was not.

    The array is kept from view to view, and only what was compared is written, since there may be many things.
    """

    def __init__(self, number: int) -> None:
        self._rows = np.full(number, -1, np.int64)
        self._all = np.arange(number)
        self._written: Ints = self._all[:0]

    def of(self, compared: Ints | None) -> tuple[Ints, Ints]:
        """Compared references (None: all), and each one's row among them. Valid until the next call."""
        if compared is None and self._written is self._all:
            return self._written, self._rows
        self._rows[self._written] = -1
        self._written = self._all if compared is None else compared
        self._rows[self._written] = self._all[: len(self._written)]
        return self._written, self._rows


@compiled(nogil=True, error_model="numpy")
def _expected(
    poses: Array,
    references: Array,
    rows: Ints,
    similarity: Floats,
    nearest: Shorts,
    min_square: float,
    decay: float,
    background_level: float,
    out: Array,
) -> None:
    headings = similarity.shape[1]
    per_radian = headings / (2 * np.pi)
    neighbours = nearest.shape[1]
    row = np.empty(neighbours, np.int64)
    squares = np.empty(neighbours)
    turned = np.empty(neighbours)
    for n in range(len(poses)):
        x, y, heading = poses[n, 0], poses[n, 1], poses[n, 2]
        out[n] = background_level
        number, closest = 0, np.inf
        for k in range(neighbours):
            r = nearest[n, k]
            if r < 0:
                break
            if rows[r] < 0:
                continue
            far_x, far_y = x - references[r, 0], y - references[r, 1]
            far = far_x * far_x + far_y * far_y
            row[number], squares[number], turned[number] = rows[r], far, (heading - references[r, 2]) * per_radian
            number += 1
            closest = min(closest, far)
        if number == 0:
            continue
        total, mass = 0.0, 0.0
        nearly = 0.25 * closest + min_square
        for k in range(number):
            weight = 1.0 / (squares[k] + nearly)
            turn = turned[k] - headings * np.floor(turned[k] / headings)
            h = min(int(turn), headings - 1)
            before, after = similarity[row[k], h], similarity[row[k], h + 1 if h + 1 < headings else 0]
            total += weight * (before + (after - before) * (turn - h))
            mass += weight
        known = math.exp(decay * closest)
        out[n] = max(background_level, known * total / mass + (1.0 - known) * background_level)


def fading(fade_distance_m: float | None) -> tuple[float, float]:
    """Least squared distance (m^2) in a reference's weight, and the exponent per m^2 by which it fades; None: never."""
    if fade_distance_m is None:
        return MIN_SQUARE_M2, 0.0
    return 1e-4 * fade_distance_m * fade_distance_m, -0.5 / (fade_distance_m * fade_distance_m)


def expected_similarity(
    poses: Array,
    references: Array,
    nearest: Shorts,
    rows: Ints,
    similarity: Floats,
    fade_distance_m: float | None,
    background_level: float,
) -> Array:
    """Similarity of the current view to the one expected at poses: (N, 3) -> (N,).

    The references `nearest` (N, k) to each pose (-1: none) have the weights 1 / (d^2 + (d_min / 2)^2), each at the
    pose's heading (linear between the compared headings). With the distance d_min of the nearest one the expectation
    fades to `background_level` by exp(-d_min^2 / (2 fade_distance^2)), never where that is None; it is never below.
    `rows` (R,): each reference's row in `similarity`, -1 where it was not compared.
    """
    poses, similarity = np.ascontiguousarray(poses), np.ascontiguousarray(similarity)
    out = np.empty(len(poses))
    _expected(poses, references, rows, similarity, nearest, *fading(fade_distance_m), background_level, out)
    return out


def weighted_quantile(values: Floats, weights: Array, quantile: float) -> float:
    """The quantile of weighted values: linear between the middles of their shares."""
    order = np.argsort(values, kind="stable")
    upto = np.cumsum(weights[order])
    return float(np.interp(quantile * upto[-1], upto - 0.5 * weights[order], values[order]))


def weighted_median(values: Floats, weights: Array | None) -> float:
    """The median of values by their weights; None: all weigh the same."""
    return float(np.median(values)) if weights is None else weighted_quantile(values, weights, 0.5)


def background_similarity(
    best: Floats, places: Array, background_distance_m: float, quantile: float, sampling_weight: Array | None = None
) -> float:
    """The similarity that references of other places reach at their best heading.

    `best` (R,): each reference's similarity at its best heading; `places` (R, >= 2): their positions (m). The
    `quantile` over those farther than `background_distance_m` from the best of all; the median of all where there are
    none. `sampling_weight` (R,): how many references of the map each represents; None: one each.
    """
    gap = places[:, :2] - places[best.argmax(), :2]
    background = gap[:, 0] ** 2 + gap[:, 1] ** 2 > background_distance_m**2
    there = best[background]
    if not len(there):
        return weighted_median(best, sampling_weight)
    if sampling_weight is None:
        return hazen_quantile(there, quantile)  # the same, without sorting
    return weighted_quantile(there, sampling_weight[background], quantile)


def similarity_field(similarities: Similarities, floor: float, top: float, power: float) -> SimilarityField:
    """The weights (max(S, floor) / top)^power over references and headings.

    Only values above the floor are raised to the power: a few in a hundred in a large map.
    """
    values, each = similarities.values, similarities.sampling_weight
    headings, flat = values.shape[1], values.ravel()
    above = (flat > floor).nonzero()[0]
    rows = above // headings
    heights, low = (flat[above].astype(np.float64) / top) ** power, (floor / top) ** power
    excess = np.maximum(heights - low, 0.0)
    at_floor = (headings - np.bincount(rows, minlength=len(values))).astype(np.float64)
    if each is None:
        size, counted = headings * float(len(values)), float(len(above))
    else:
        size, counted = headings * float(each.cumsum()[-1]), float(np.add.reduce(each[rows]))
        heights, excess, at_floor = each[rows] * heights, each[rows] * excess, each * at_floor
    weights, floor_cells = heights.cumsum(), at_floor.cumsum()
    peaks = float(weights[-1]) if len(above) else 0.0
    floor_weight = max(size - counted, 0.0) * low
    mean = (peaks + floor_weight) / size
    return SimilarityField(
        values, similarities.candidates, floor, above, weights, excess.cumsum(), floor_cells, floor_weight, mean
    )


class NearReferences(Stage):
    """Weights particles by their expected similarity, interpolated between the nearest references, to a power.

    Gross & Koenig 2004, section 2, do not state how S becomes a weight (erratum 23a in docs/papers.md): w = S^power.
    The expected similarity is interpolated between references and compared headings and, with a `fade_distance`, fades
    to that of background references. With a `background_quantile` lower values count as background too, so that a robot
    off the mapped paths, which resembles no reference, is not pulled to the least dissimilar one. Images taken at one
    place are not independent evidence: the power is scaled by the novelty of the image. Distances are in appearance
    length scales, so that one configuration serves a room, a field and a lawn. Where only some references were
    compared, sums use their sampling weights, so that power, background and mean likelihood are estimates for the whole
    map. The mean likelihood is that of a robot kidnapped just now, to which the image is new: it takes the full power.
    Defaults: docs/experiments/omniview_mcl_defaults.md.

    With a `calibration` (likelihood=calibrated) the weight is the likelihood ratio of the right against a wrong place,
    which the map's own views have shown, in place of a power; `power`, `contrast` and the background's are not used.
    Its logarithm is interpolated as similarities are; an unknown place has ratio 1, and no place has less.
    """

    power: Annotated[float, Bounds(gt=0)] | None = None
    """Exponent of the similarity; null: from `contrast`, since similarity varies differently in each world."""
    contrast: Annotated[float, Bounds(gt=0)] = 3.0
    """Nats of log likelihood per standard deviation of log S over the references at their best headings."""
    background_quantile: Annotated[float, Bounds(ge=0, le=1)] | None = 0.8
    """Quantile of the background references' similarities that an unknown place reaches; null: such places reach
    nothing."""
    fade_distance: Annotated[float, Bounds(gt=0)] | None = 1.5
    """Distance, in length scales, over which a reference loses its influence (sigma of a Gaussian); null: none does."""
    independence_distance: Annotated[float, Bounds(ge=0)] = 0.75
    """Distance driven, in length scales, after which an image is fully new evidence; 0: always. Needs `motion`. With a
    `calibration`, in the distances over which its evidence was measured to lose its correlation; an image that does
    not look like the one before is new at once."""

    class Out(Outputs):
        """Likelihood of each particle, and the weights over the whole map; `field` absent with an empty map."""

        likelihood: Likelihood
        field: SimilarityField | None = None

    def setup(self, ctx: Context) -> None:
        self._map: ReferenceGraph | None = None
        self._length = 0

    def step(
        self,
        ctx: Context,
        similarities: Similarities,
        particles: Particles,
        map: ReferenceGraph,
        motion: Motion | None = None,
        length_scale: LengthScale | None = None,
        calibration: SimilarityCalibration | None = None,
    ) -> Out:

        def expected(near: Shorts, rows: Ints, fade_m: float | None, floor: float) -> Array:
            return expected_similarity(particles.poses, map.poses, near, rows, similarities.values, fade_m, floor)

        return self.weighted(similarities, particles, map, motion, length_scale, calibration, expected)

    def weighted(
        self,
        similarities: Similarities,
        particles: Particles,
        map: ReferenceGraph,
        motion: Motion | None,
        length_scale: LengthScale | None,
        calibration: SimilarityCalibration | None,
        expected: Callable[[Shorts, Ints, float | None, float], Array],
    ) -> Out:
        """Weight all particles by what `expected` gives for the references near each, as `expected_similarity` does."""
        unit = metres_of(length_scale)
        if not similarities.values.size:
            return self.Out(likelihood=Likelihood(np.ones(len(particles.poses))))
        if map is not self._map or len(map) != self._length:
            radius = (FAR if self.fade_distance is None else CUTOFF_SIGMAS * self.fade_distance) * unit
            self._cells = NearestCells(map.poses, NEIGHBOURS, unit / CELLS_PER_LENGTH_SCALE, radius)
            self._rows = ComparedRows(len(map))
            self._map, self._length = map, len(map)
        candidates, rows = self._rows.of(similarities.candidates)
        near = self._cells.of(particles.poses)
        fade_m = None if self.fade_distance is None else self.fade_distance * unit
        far_m = self.independence_distance * (unit if calibration is None else calibration.correlation_m)
        novelty, carried = novelty_and_kidnapping(similarities, calibration, motion, far_m)
        if calibration is not None:
            ratios = likelihood_ratios(similarities, calibration)
            top = max(float(ratios.max()), 1.0)
            logarithms = expected_similarity(particles.poses, map.poses, near, rows, np.log(ratios), fade_m, 0.0)
            field = similarity_field(replace(similarities, values=ratios / np.float32(top)), 1.0 / top, 1.0, 1.0)
            values = np.exp(novelty * (logarithms - math.log(top)))
            return self.Out(likelihood=Likelihood(values, field.mean, novelty, carried), field=field)
        best, each = similarities.best, similarities.sampling_weight
        floor = 0.0
        if self.background_quantile is not None:
            places, distance = map.poses[candidates], BACKGROUND_DISTANCE * unit
            floor = background_similarity(best, places, distance, self.background_quantile, each)
        power = contrast_power(best, self.contrast, each) if self.power is None else self.power
        top = max(float(np.maximum.reduce(best)), 1e-12)
        field = similarity_field(similarities, floor, top, power)
        weights = (expected(near, rows, fade_m, floor) / top) ** (power * novelty)
        return self.Out(likelihood=Likelihood(weights, field.mean, novelty), field=field)
