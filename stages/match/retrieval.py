"""Similarity of image retrieval: the intersection of histograms divided by the query's sum."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage
from omninav.pipeline.engine.compiled import compiled
from omninav.stages.geometry.appearance.segments import Rows, turned_views
from omninav.stages.geometry.arrays import Array, Floats, Ints
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.candidates import Candidates
from omninav.stages.values.features import SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import RetrievedReferences, Similarities

from .map_calibration import MapCalibration
from .reference_match import LastView, check_same_kind

LANES = 8
"""Turns of the query are padded to a multiple of this, so that the inner loops are whole vector instructions."""
BEST = 9
"""References in `answers`, each at its best heading."""


@compiled(nogil=True)
def _intersect(references: Floats, query: Floats, sums: Floats, held: Ints, out: Floats) -> None:
    # Turns of the query are the innermost axis: each loop over them is vector instructions.
    scales, segments, bins, lanes = query.shape
    common, total, best = np.empty(lanes, np.float32), np.empty(lanes, np.float32), np.empty(lanes, np.float32)
    for n in range(len(references)):
        reference = references[n]
        best[:] = np.float32(0)
        for own in range(scales):
            # One of the two is always taken at its first scale: scales of both at once would cancel.
            for other in range(scales if own == 0 else 1):
                total[:] = np.float32(0)
                for j in range(segments):
                    common[:] = np.float32(0)
                    for k in range(held[own, j, 0]):
                        b = held[own, j, 1 + k]
                        here, there = reference[j, other * bins + b], query[own, j, b]
                        if here > 0:
                            for h in range(lanes):
                                common[h] += there[h] if there[h] < here else here
                    for h in range(lanes):
                        total[h] += common[h] * sums[own, j, h]
                for h in range(lanes):
                    best[h] = total[h] if total[h] > best[h] else best[h]
        for h in range(out.shape[1]):
            out[n, h] = best[h]


def normalised_intersections(references: Rows, queries: Floats, scales: int = 1, chosen: Ints | None = None) -> Floats:
    """Similarity of a query at some turns to references: (chosen, turns) float32 in [0, 1].

    sum_k min(q_k, d_k) / sum_k q_k of a query's histogram q and a reference's d, in this order (Wolf, Burgard &
    Burkhardt 2005, equation 5; erratum 43 in docs/papers.md), on average over segments. `references` (R, segments,
    scales x bins), `queries` (turns, segments, scales x bins): of several scales the best is taken, the query at its
    first scale against each of the reference's, and the other way round. A segment whose query holds nothing counts as
    0. `chosen`: indices of the references to compare; None: all.
    """
    some = references[:] if chosen is None else references[chosen]
    turns, segments, length = queries.shape
    query = np.zeros((scales, segments, length // scales, -(-turns // LANES) * LANES), np.float32)
    query[..., :turns] = queries.reshape(turns, segments, scales, -1).transpose(2, 1, 3, 0)
    sums = query.sum(axis=2, dtype=np.float64) * segments
    weights = np.divide(1.0, sums, out=np.zeros_like(sums), where=sums > 0.0).astype(np.float32)
    held = np.zeros((scales, segments, 1 + length // scales), np.int64)  # which bins any turn of the query holds
    for own, j in np.ndindex(scales, segments):
        bins = np.flatnonzero(query[own, j].any(axis=1))
        held[own, j, 0], held[own, j, 1 : 1 + len(bins)] = len(bins), bins
    out = np.empty((len(some), turns), np.float32)
    _intersect(np.ascontiguousarray(some, np.float32), query, weights, held, out)
    return np.minimum(out, np.float32(1.0))


def window_turns(directions: Array) -> Ints:
    """The window in which a robot turned by 2 pi h / W from a reference sees its image: (W,) indices.

    `directions` (W,): where the windows look, evenly around the robot and one of them straight ahead. Raises BadInput
    where they do not.
    """
    number = len(directions)
    turns = -directions * number / (2.0 * math.pi)
    nearest = np.round(turns)
    columns = nearest.astype(np.int64) % number
    if np.abs(turns - nearest).max() > 0.01 * number or len(np.unique(columns)) < number:
        shown = ", ".join(f"{math.degrees(d):g}" for d in directions)
        raise BadInput(
            f"match: images that look towards {shown} deg; they must be spaced evenly around the robot, one straight "
            "ahead, to be distinguished from its turns; use an ordinary camera with yaw: 0, or an omnidirectional one"
        )
    windows = np.empty(number, np.int64)
    windows[columns] = np.arange(number)
    return windows


class Retrieval(Stage):
    """Similarity of image retrieval: the intersection of histograms divided by the query's sum.

    Wolf, Burgard & Burkhardt 2005, section IV, equation 5: sum min(q, d) / sum q, the mean over a panorama's segments,
    at `headings` turns; with features of several scales, the best. Windows are queries of their own: column h is the
    window that sees a reference's view when the robot is turned by 2 pi h / W; a single window has one column. Raises
    BadInput where the map has other features.
    """

    headings: Annotated[int, Bounds(ge=1)] = 36
    """Headings at which each reference is compared, evenly spaced over the circle."""

    class Out(Outputs):
        """Similarities of view and references, the most similar references, and what similarities show of the place."""

        similarities: Similarities
        answers: RetrievedReferences | None = None
        calibration: SimilarityCalibration | None = None

    def __post_init__(self) -> None:
        self._calibration = MapCalibration()

    def step(
        self,
        ctx: Context,
        features: SegmentHistograms,
        map: ReferenceGraph,
        candidates: Candidates | None = None,
        length_scale: LengthScale | None = None,
        last: LastView | None = None,
    ) -> Out:
        """Query the map with one view; `length_scale` is for the calibration only."""
        panoramic = features.directions is None
        if features.directions is None:
            check_same_kind(features, map)
            headings = self.headings if len(features.values) > 1 else 1
            queries = turned_views(features.values, headings)
        else:
            check_same_kind(SegmentHistograms(features.values[:1]), map)
            queries = features.values[window_turns(features.directions), None]
        candidates = candidates or Candidates()
        values = normalised_intersections(map.features, queries, features.scales, candidates.references)
        calibration, of_last = None, None
        if ctx.is_read("calibration"):

            def of_one(view: Floats) -> Floats:
                return normalised_intersections(view[None], queries, features.scales)

            def of_view(view: int, chosen: Ints) -> Floats:
                turned = turned_views(np.asarray(map.features[view]), headings)
                return normalised_intersections(map.features, turned, features.scales, chosen)

            headings = self.headings if map.features.shape[1] > 1 else 1
            calibration = self._calibration.of(ctx, map, of_view, length_scale)
            of_last = last.similarity(ctx, features.values, of_one) if panoramic and last is not None else None
        weights = candidates.sampling_weight
        similarities = Similarities(values, candidates.references, weights, last_view=of_last)
        answers = best_answers(similarities, BEST) if len(map) else None
        return self.Out(similarities=similarities, answers=answers, calibration=calibration)


def best_answers(similarities: Similarities, number: int) -> RetrievedReferences:
    """The `number` most similar references, the most similar first, equal ones in the map's order."""
    values, headings = similarities.values, similarities.values.shape[1]
    turns = values.argmax(axis=1)
    peaks = values[np.arange(len(values)), turns]
    rows = np.argsort(-peaks, kind="stable")[:number]
    references = rows if similarities.candidates is None else similarities.candidates[rows]
    return RetrievedReferences(references, peaks[rows], wrap(2.0 * np.pi * turns[rows] / headings))
