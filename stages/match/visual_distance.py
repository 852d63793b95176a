"""Compares the present view with the places of a topological map."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage
from omninav.stages.geometry.appearance.visual_distance import (
    MAX_GLOBAL_DISTANCE,
    MIN_MATCHES,
    ComparisonOptions,
    ManyViews,
    PatchDistance,
    colour_distances,
)
from omninav.stages.values.local_features import GlobalDescriptor, LocalFeatures, view_features
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.visual_distance import VisualDistances


class VisualDistance(Stage):
    """Visual distance to every place of a map: global colours first, local features where these leave it open.

    Goedemé et al. 2007, section 4.2: equations 3 and 4 (erratum 27 in docs/papers.md) against each place's medoid. The
    distance is inf where the global colours differ too much or too few features match. Raises BadInput where the map's
    descriptors are of another kind.
    """

    ratio: Annotated[float, Bounds(gt=0, le=1)] = 0.8
    """Largest ratio of a match's distance to that of the second nearest of either patch."""
    patch_distance: PatchDistance = "euclidean"
    """Distance of patches' descriptors: `euclidean`, or `mahalanobis`, the paper's (section 3.4, equation 2)."""
    max_global_distance: Annotated[float, Bounds(gt=0)] = MAX_GLOBAL_DISTANCE
    """Largest distance between the global colours of views that are compared further."""
    min_matches: Annotated[int, Bounds(ge=1)] = MIN_MATCHES
    """Fewest matches of views that have something in common."""

    class Out(Outputs):
        distances: VisualDistances

    def setup(self, ctx: Context) -> None:
        self._map: TopologicalMap | None = None
        self._places = ManyViews([])

    def step(self, ctx: Context, features: LocalFeatures, descriptor: GlobalDescriptor, map: TopologicalMap) -> Out:
        if self._map is not map:
            self._places = ManyViews([view_features(map.views.features(int(view))) for view in map.places])
            self._map = map
        if len(features) and features.descriptors.shape[1] != map.views.descriptors.shape[1]:
            raise BadInput(
                f"match: descriptors of {features.descriptors.shape[1]} numbers against a map of "
                f"{map.views.descriptors.shape[1]}; use the features it was made with, or make a new map"
            )
        here = view_features(features)
        options = ComparisonOptions(self.ratio, min_matches=self.min_matches, patch_distance=self.patch_distance)
        close = colour_distances(map.views.moments[map.places], descriptor.values) <= self.max_global_distance
        distances, turns = np.full(len(map), math.inf), np.zeros(len(map))
        matches = np.zeros(len(map), np.int64)
        compared = np.flatnonzero(close)
        for place, found in zip(compared, self._places.compare(compared, here, options), strict=True):
            distances[place], turns[place], matches[place] = found.distance, found.turn, found.matches
        if not np.isfinite(distances).any():
            ctx.count("nothing_in_common", detail="match: an image that has too little in common with every place")
        return self.Out(distances=VisualDistances(distances, turns, matches))
