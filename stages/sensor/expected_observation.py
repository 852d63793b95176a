"""How well each particle explains the view, from the view that is expected at its pose."""

import math

import numba
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.appearance.segments import LARGEST_COLOUR_DISTANCE, penalties, sorting_network
from omninav.stages.geometry.plane.nearest_cells import NearestCells
from omninav.stages.values.belief import Particles
from omninav.stages.values.features import SegmentFeatures, SegmentHistograms
from omninav.stages.values.length_scale import LengthScale
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities

from .near_references import Array, Floats, Ints, NearReferences


# Sums over the bins may be taken in any order, which lets them be vector instructions.
@numba.njit(cache=True, nogil=True, error_model="numpy", fastmath={"reassoc", "nsz"})
def _likeness(
    poses: Array,
    references: Array,
    features: Floats,
    view: Floats,
    histograms: bool,
    origin: Array,
    cell: float,
    columns: int,
    lines: int,
    nearest: npt.NDArray[np.int32],
    fade: float,
    ordinary: float,
    network: Ints,
    factors: Floats,
    scale: np.float32,
) -> Array:
    segments, bins = view.shape
    expected, alike = np.empty((segments, bins), np.float32), np.empty(segments, np.float32)
    apart = np.empty(nearest.shape[1])
    out = np.empty(len(poses))
    for n in range(len(poses)):
        out[n] = ordinary
        i, j = int(np.floor((poses[n, 0] - origin[0]) / cell)), int(np.floor((poses[n, 1] - origin[1]) / cell))
        if not (0 <= i < columns and 0 <= j < lines):
            continue
        here = nearest[i * lines + j]
        number, closest, mass = 0, np.inf, 0.0
        while number < len(here) and here[number] >= 0:
            x, y = poses[n, 0] - references[here[number], 0], poses[n, 1] - references[here[number], 1]
            apart[number] = x * x + y * y
            closest = min(closest, apart[number])
            number += 1
        if number == 0:
            continue
        for k in range(number):
            apart[k] = 1.0 / (apart[k] + 0.25 * closest + 1e-4 * fade * fade)
            mass += apart[k]
        expected[:] = np.float32(0)
        for k in range(number):
            reference = features[here[k]]
            shift = (references[here[k], 2] - poses[n, 2]) * segments / (2 * np.pi)
            first = int(np.floor(shift))
            later = np.float32((shift - first) * apart[k] / mass)
            sooner = np.float32(apart[k] / mass) - later
            at = first % segments
            for s in range(segments):
                then = at + 1 if at + 1 < segments else 0
                one, other, row = reference[at], reference[then], expected[s]
                for b in range(bins):
                    row[b] += sooner * one[b] + later * other[b]
                at = then
        for s in range(segments):
            common = np.float32(0)
            mine, seen = expected[s], view[s]
            if histograms:
                for b in range(bins):
                    common += mine[b] if mine[b] < seen[b] else seen[b]
                alike[s] = common
            else:
                for b in range(bins):
                    common += (mine[b] - seen[b]) ** 2
                alike[s] = max(np.float32(1) - np.float32(np.sqrt(common)) / scale, np.float32(0))
        for p in range(len(network)):
            a, c = alike[network[p, 0]], alike[network[p, 1]]
            alike[network[p, 0]] = a if a > c else c
            alike[network[p, 1]] = c if a > c else a
        total, best = np.float32(0), np.float32(0)
        for k in range(segments):
            total += alike[k]
            score = total * factors[k]
            best = score if score > best else best
        known = math.exp(-0.5 * closest / (fade * fade))
        faded = known * best + (1.0 - known) * ordinary
        out[n] = faded if faded > ordinary else ordinary
    return out


def likeness_of_expected(
    poses: Array,
    references: Array,
    features: Floats,
    view: Floats,
    histograms: bool,
    cells: NearestCells,
    fade: float,
    ordinary: float,
    exponent: float = 0.5,
    colour_scale: float = LARGEST_COLOUR_DISTANCE,
) -> Array:
    """Selective similarity of a view (segments, bins) to the one expected at each pose: (N, 3) -> (N,).

    The expected view is the mean of the references nearest to the pose (`references` (R, 3), `features` (R, segments,
    bins)), each turned to the pose's heading, with weights 1 / (d^2 + (d_min / 2)^2). S as in `segments.similarities`.
    It fades to `ordinary` and is not below it, as in `expected_similarity`.
    """
    network, factors = sorting_network(len(view)), penalties(len(view), exponent)
    poses, view = np.ascontiguousarray(poses), np.ascontiguousarray(view, np.float32)
    scale = np.float32(colour_scale)
    found: Array = _likeness(
        poses, references, features, view, histograms, *cells, fade, ordinary, network, factors, scale
    )
    return found


class ExpectedObservation(NearReferences):
    """Likelihood of particles by the paper's letter: an expected observation for each, compared with the view.

    Gross & Koenig 2004, section 2: the similarity S is that "between the expected observation of the sample in its
    current pose and the actual observation". The features of the nearest references are mixed and turned to the
    particle's heading, then compared. `near_references` interpolates similarities in place of features, which costs a
    tenth. Power, ordinary match, proposals and all parameters are those of `near_references`, which see. Penalty and
    scale of colours are those of the `similarities`, since likelihoods are taken in proportion to the best of them.
    Raises BadInput where those are no such comparison (`match=l2`).
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
        """Weigh all particles."""
        if similarities.exponent is None:
            raise BadInput(
                "sensor: expected_observation compares the segments as the match does, and this match compares whole "
                "views; use match=selective or match=histogram_intersection, or sensor=near_references"
            )
        self._view, self._exponent = features, similarities.exponent
        self._colour_scale = similarities.colour_scale or LARGEST_COLOUR_DISTANCE
        return super().step(ctx, similarities, particles, map, motion, length_scale)

    def _expected(
        self, poses: Array, map: ReferenceGraph, rows: Ints, values: Floats, unit: float, floor: float
    ) -> Array:
        return likeness_of_expected(
            poses,
            map.poses,
            map.features,
            self._view.values,
            isinstance(self._view, SegmentHistograms),
            self._cells,
            self.fade * unit,
            floor,
            self._exponent,
            self._colour_scale,
        )
