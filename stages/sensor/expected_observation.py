"""Weights particles by comparing the view with the one expected at each pose."""

import math

import numpy as np

from omninav.pipeline import BadInput, Context
from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.appearance.best_segments import sorting_network
from omninav.stages.geometry.appearance.segments import MAX_COLOUR_DISTANCE, penalties
from omninav.stages.geometry.arrays import Array, Floats, Ints, Shorts
from omninav.stages.geometry.plane.point_cells import distinct
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures, SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities

from .near_references import NearReferences, fading


# Sums over the bins may be taken in any order, which lets them be vector instructions.
@compiled(nogil=True, error_model="numpy", fastmath={"reassoc", "nsz"})
def _similarity(
    poses: Array,
    references: Array,
    features: Floats,
    view: Floats,
    histograms: bool,
    whole: bool,
    nearest: Shorts,
    min_square: float,
    decay: float,
    background_level: float,
    network: Ints,
    factors: Floats,
    scale: np.float32,
) -> Array:
    segments, bins = view.shape
    expected, similarity = np.empty((segments, bins), np.float32), np.empty(segments, np.float32)
    squares = np.empty(nearest.shape[1])
    out = np.empty(len(poses))
    for n in range(len(poses)):
        out[n] = background_level
        here = nearest[n]
        number, closest, mass = 0, np.inf, 0.0
        while number < len(here) and here[number] >= 0:
            x, y = poses[n, 0] - references[here[number], 0], poses[n, 1] - references[here[number], 1]
            squares[number] = x * x + y * y
            closest = min(closest, squares[number])
            number += 1
        if number == 0:
            continue
        for k in range(number):
            squares[k] = 1.0 / (squares[k] + 0.25 * closest + min_square)
            mass += squares[k]
        expected[:] = np.float32(0)
        for k in range(number):
            reference = features[here[k]]
            shift = (references[here[k], 2] - poses[n, 2]) * segments / (2 * np.pi)
            first = int(np.floor(shift))
            later = np.float32((shift - first) * squares[k] / mass)
            sooner = np.float32(squares[k] / mass) - later
            at = first % segments
            for s in range(segments):
                then = at + 1 if at + 1 < segments else 0
                one, other, row = reference[at], reference[then], expected[s]
                for b in range(bins):
                    row[b] += sooner * one[b] + later * other[b]
                at = then
        squared = np.float32(0)
        for s in range(segments):
            common = np.float32(0)
            mine, seen = expected[s], view[s]
            if histograms and not whole:
                for b in range(bins):
                    common += mine[b] if mine[b] < seen[b] else seen[b]
                similarity[s] = common
            else:
                for b in range(bins):
                    common += (mine[b] - seen[b]) ** 2
                squared += common
                similarity[s] = max(np.float32(1) - np.float32(np.sqrt(common)) / scale, np.float32(0))
        for p in range(len(network)):
            a, c = similarity[network[p, 0]], similarity[network[p, 1]]
            similarity[network[p, 0]] = a if a > c else c
            similarity[network[p, 1]] = c if a > c else a
        total, best = np.float32(0), np.float32(0)
        for k in range(segments):
            total += similarity[k]
            score = total * factors[k]
            best = score if score > best else best
        if whole:
            best = max(np.float32(1) - np.float32(np.sqrt(squared)) / scale, np.float32(0))
        known = math.exp(decay * closest)
        faded = known * best + (1.0 - known) * background_level
        out[n] = faded if faded > background_level else background_level
    return out


def similarity_of_expected(
    poses: Array,
    references: Array,
    features: Floats,
    view: Floats,
    histograms: bool,
    nearest: Shorts,
    fade_distance_m: float | None,
    background_level: float,
    exponent: float | None = 0.5,
    colour_scale: float = MAX_COLOUR_DISTANCE,
) -> Array:
    """Selective similarity of a view (segments, bins) to the one expected at each pose: (N, 3) -> (N,).

    The expected view is the mean of the references `nearest` (N, k) to the pose, -1 for none (`references` (R, 3),
    `features` (R, segments, bins)), each turned to the pose's heading, with weights 1 / (d^2 + (d_min / 2)^2). S as in
    `segments.similarities`; with no `exponent` by the norm of the whole difference, as in
    `segments.euclidean_similarities`, of which `colour_scale` is then the largest. It fades to `background_level` as in
    `expected_similarity`.
    """
    network, factors = sorting_network(len(view)), penalties(len(view), 0.0 if exponent is None else exponent)
    poses, view = np.ascontiguousarray(poses), np.ascontiguousarray(view, np.float32)
    scale = np.float32(colour_scale)
    found: Array = _similarity(
        poses,
        references,
        features,
        view,
        histograms,
        exponent is None,
        nearest,
        *fading(fade_distance_m),
        background_level,
        network,
        factors,
        scale,
    )
    return found


class ExpectedObservation(NearReferences):
    """Weights particles by the similarity of the view to an expected observation for each, to a power.

    Gross & Koenig 2004, section 2, to the letter: S is the similarity "between the expected observation of the sample
    in its current pose and the actual observation". The features of the nearest references are averaged and turned to
    the particle's heading, then compared; `near_references` interpolates similarities instead, at a tenth of the cost.
    Everything else is as there; with a `power`, and neither a fade nor a background, the weight is S^power (erratum 23a
    in docs/papers.md), up to a factor that all particles share. Penalty and scale are those of the `similarities`, and
    so is the paper's non-selective comparison, the L2 norm of the whole difference (`match=l2`). Raises BadInput where
    these compare otherwise (`match=cosine`).
    """

    def step(  # type: ignore[override]
        self,
        ctx: Context,
        similarities: Similarities,
        features: SegmentFeatures,
        particles: Particles,
        map: ReferenceGraph,
        motion: Motion | None = None,
        length_scale: LengthScale | None = None,
    ) -> NearReferences.Out:
        if similarities.exponent is None and similarities.colour_scale is None:
            raise BadInput(
                "sensor: expected_observation needs a match that defines `exponent_and_scale`, as this one does not; "
                "use match=selective, match=histogram_intersection or match=l2, or sensor=near_references"
            )
        view, histograms = features.values, isinstance(features, SegmentHistograms)
        how = similarities.exponent, similarities.colour_scale or MAX_COLOUR_DISTANCE

        def expected(near: Shorts, _: Ints, fade_m: float | None, floor: float) -> Array:
            used, rows = self._rows.of(distinct(near[near >= 0].astype(np.int64)))
            here = np.where(near < 0, -1, rows[near]).astype(np.int32)
            known = map.poses[used], map.features[used], view, histograms, here
            return similarity_of_expected(particles.poses, *known, fade_m, floor, *how)

        return self.weighted(similarities, particles, map, motion, length_scale, None, expected)
