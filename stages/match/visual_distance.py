"""Compares the present view with the places of a topological map."""

import math
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.geometry.appearance.visual_distance import (
    Matching,
    Measure,
    Ready,
    colours_apart,
    compare,
    made_ready,
)
from omninav.stages.values.local_features import GlobalDescriptor, LocalFeatures, VerticalSegments
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.visual_distance import VisualDistances


class MatchPlaces(Stage):
    """Visual distance to every place of a map: colours of the whole first, local features where these leave it open.

    Goedeme et al. 2007, section 4.2: equations 3 and 4 as erratum 27 reads them, against each place's medoid; inf where
    the views' colours lie further apart than `colour` or fewer than `least_matches` features match. Parameters mean
    what they mean in mapping (`mapping.topological`). Raises BadInput where the map's descriptors are others.
    """

    colour: Annotated[float, Bounds(gt=0)] = 0.5
    ratio: Annotated[float, Bounds(gt=0, le=1)] = 0.8
    column_ratio: Annotated[float, Bounds(gt=0, le=1)] = 0.8
    patch_colour: Annotated[float, Bounds(gt=0)] = 0.5
    least_matches: Annotated[int, Bounds(ge=2)] = 8
    least_angle_deg: Annotated[float, Bounds(ge=0)] = 0.5

    class Out(Outputs):
        """How far each place is."""

        distances: VisualDistances

    def setup(self, ctx: Context) -> None:
        """No map yet."""
        self._map: TopologicalMap | None = None
        self._places: list[Ready] = []

    def step(
        self,
        ctx: Context,
        features: LocalFeatures,
        descriptor: GlobalDescriptor,
        map: TopologicalMap,
        vertical_segments: VerticalSegments | None = None,
    ) -> Out:
        """Compare one view with all places."""
        if self._map is not map:
            self._places = [self._ready(map, int(view)) for view in map.places]
            self._map = map
        if len(features) and features.descriptors.shape[1] != map.views.descriptors.shape[1]:
            raise BadInput(
                f"match: descriptors of {features.descriptors.shape[1]} numbers against a map of "
                f"{map.views.descriptors.shape[1]}; use the features it was made with, or make it anew"
            )
        here = made_ready(features, vertical_segments)
        matching = Matching(self.ratio, self.column_ratio, self.patch_colour)
        measure = Measure(self.least_matches, math.radians(self.least_angle_deg))
        near = colours_apart(map.views.moments[map.places], descriptor.values) <= self.colour
        distances, turns = np.full(len(map), math.inf), np.zeros(len(map))
        matches = np.zeros(len(map), np.int64)
        for place in np.flatnonzero(near):
            found = compare(self._places[place], here, matching, measure)
            distances[place], turns[place], matches[place] = found.distance, found.turn, found.matches
        if not np.isfinite(distances).any():
            ctx.count("nothing_in_common", detail="match: a picture that has too little in common with every place")
        return self.Out(distances=VisualDistances(distances, turns, matches))

    def _ready(self, map: TopologicalMap, view: int) -> Ready:
        beside = map.views.columns(view)
        return made_ready(map.views.features(view), beside if len(beside) else None)
