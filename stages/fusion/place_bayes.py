"""Weighs predicted places by the view: Bayes' rule over places."""

import math

import numpy as np

from omninav.pipeline import Context, Outputs, Stage
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.belief import Likelihood, PlaceBelief
from omninav.stages.values.topological_map import TopologicalMap
from omninav.stages.values.visual_distance import VisualDistances


class PlaceBayes(Stage):
    """Updates the belief over places with the present view, and gives the pose of each place.

    Goedemé et al. 2007, section 5.1, equation 12: what was predicted times how likely the view is there, normalised.
    A place's pose is its medoid's, from the map, with the heading turned as the present view is against the medoid's.
    """

    class Out(Outputs):
        belief: PlaceBelief

    def step(
        self,
        ctx: Context,
        prediction: PlaceBelief,
        likelihood: Likelihood,
        distances: VisualDistances,
        map: TopologicalMap,
    ) -> Out:
        weights = prediction.probabilities * likelihood.values
        total = float(weights.sum())
        if not (math.isfinite(total) and total > 0.0):
            ctx.count("belief_without_support", detail="fusion: no place explains the image; belief kept")
            weights, total = prediction.probabilities, 1.0
        poses = map.poses[map.places].copy()
        poses[:, 2] = wrap(poses[:, 2] + distances.turns)
        return self.Out(belief=PlaceBelief(weights / total, np.asarray(poses)))
