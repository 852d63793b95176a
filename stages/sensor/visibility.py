"""Weights particles by the views whose visibility areas they are in."""

import math
from dataclasses import replace
from typing import Annotated

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.belief import Likelihood, Particles
from omninav.stages.values.calibration import SimilarityCalibration
from omninav.stages.values.length_scale import LengthScale, metres_of
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Motion
from omninav.stages.values.similarity import Similarities, SimilarityField
from omninav.stages.values.visibility import VisibilityAreas

from .calibrated_similarity import likelihood_ratios, novelty_and_kidnapping
from .near_references import ComparedRows, similarity_field, weighted_median
from .visibility_index import looks_at, seen_from, sees_any
from .visibility_similarity import CUTOFF_SIGMAS, mean_seen, sums_by_turn

BACKGROUND_WEIGHT = math.exp(-0.5)
"""Weight of what is not known, with a `calibration`: as much as a view taken one sigma away."""
WINDOW_DEG = 5.0
"""Largest deviation of the heading from a view's point with a forward-looking camera, degrees; 5 in the paper."""


class Visibility(Stage):
    """Weights particles by the mean similarity of the views whose visibility areas they are in.

    Wolf, Burgard & Burkhardt 2005, section V, equations 6 to 8. With a forward-looking camera the particle's heading
    must also deviate from the direction to the view's point lambda by at most `WINDOW_DEG`. Where no view is left
    (K = 0) the likelihood is the mean similarity to the whole database (erratum 44 in docs/papers.md).

    A panoramic camera, with which the match compares several headings, sees lambda with any heading: there a view is
    compared at the turn at which the robot sees lambda, which differs from the turn of its heading by the parallax of
    its motion.

    Similarities hardly differ between places (erratum 45), and so do their means. With a `calibration`
    (likelihood=calibrated) likelihood ratios of the right against a wrong place, which the map's own views have shown,
    are averaged in their place, and where no view was taken near the mean fades to that of the whole database:
    docs/experiments/retrieval_mcl_calibrated.md. Defaults: docs/experiments/retrieval_mcl_defaults.md. Raises BadInput
    where areas and map do not belong together.
    """

    distance_sigma_m: Annotated[float, Bounds(gt=0)] | None = 1.0
    """Sigma of the Gaussian by which a view's weight falls with the distance from where it was taken; null: all views
    of the area weigh the same, as in the paper. Not in length scales, which differ between cameras in one place."""
    independence_distance: Annotated[float, Bounds(ge=0)] = 0.0
    """Distance driven, in length scales, after which an image is fully new evidence; 0: always, as in the paper. With a
    `calibration`, in the distances over which its evidence was measured to lose its correlation; an image that does
    not look like the one before is new at once."""
    retrieval: bool = True
    """False: the ablation of section VI-E, in which all particles in any visibility area weigh 1 and all others 0."""

    class Out(Outputs):
        """Likelihood of each particle, and the weights over the whole map."""

        likelihood: Likelihood
        field: SimilarityField | None = None

    def setup(self, ctx: Context) -> None:
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
        calibration: SimilarityCalibration | None = None,
    ) -> Out:
        values = similarities.values
        if not values.size:
            return self.Out(likelihood=Likelihood(np.ones(len(particles.poses))))
        sigma = self.distance_sigma_m if self.distance_sigma_m is not None and self.retrieval else math.inf
        if areas is not self._areas:
            if len(areas.target) != len(map):
                raise BadInput(
                    f"sensor: the map has {len(map)} references, the visibility areas are of {len(areas.target)}; wire "
                    "areas.map to the same map, which must not grow"
                )
            self._areas = areas
            self._looks = looks_at(areas, map.poses, each_view=sigma < math.inf)
            self._cells = seen_from(areas, self._looks, CUTOFF_SIGMAS * sigma)
            self._rows, self._summed = ComparedRows(len(map)), ComparedRows(len(self._looks.target))
        if not self.retrieval:
            return self.Out(likelihood=Likelihood(sees_any(particles.poses, self._cells).astype(np.float64)))
        compared, rows = self._rows.of(similarities.candidates)
        each = np.ones(len(values)) if similarities.sampling_weight is None else similarities.sampling_weight
        raised, floor = self._raised(similarities, calibration)
        background_level = float(np.average(raised.mean(axis=1), weights=each))
        background_weight = BACKGROUND_WEIGHT if calibration is not None and sigma < math.inf else 0.0
        panoramic = values.shape[1] > 1
        groups = None if similarities.candidates is None else self._looks.groups_with(compared)
        groups, summed = self._summed.of(groups)
        sums, number = sums_by_turn(self._looks, groups, rows, raised if panoramic else raised[:, :1], each)
        window = None if panoramic else math.radians(WINDOW_DEG), sigma
        background = background_level, *window, background_weight
        mean = mean_seen(particles.poses, self._cells, summed, sums, number, *background)
        unit = metres_of(length_scale) if calibration is None else calibration.correlation_m
        far_m = self.independence_distance * unit
        novelty, carried = novelty_and_kidnapping(similarities, calibration, motion, far_m)
        likelihood = Likelihood(mean**novelty, background_level, novelty, carried)
        weighed = replace(similarities, values=raised.astype(np.float32))
        return self.Out(likelihood=likelihood, field=similarity_field(weighed, floor, 1.0, 1.0))

    def _raised(self, similarities: Similarities, calibration: SimilarityCalibration | None) -> tuple[Array, float]:
        # What is averaged, 1 at most, and up to where it shows nothing.
        if calibration is not None:
            ratios = likelihood_ratios(similarities, calibration).astype(np.float64)
            top = max(float(ratios.max()), 1.0)
            return ratios / top, 1.0 / top
        best = similarities.best
        top = max(float(best.max()), 1e-12)
        middle = weighted_median(best, similarities.sampling_weight)
        return similarities.values.astype(np.float64) / top, middle / top
