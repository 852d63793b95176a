"""Places where two passes lie side by side become one."""

import dataclasses
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.stages.values.compared_views import ComparedViews
from omninav.stages.values.topological_map import LoopHypotheses

from .place_merging import merged_places, same_spots

MIN_SHARE = 0.4
"""Share of the features that match, for views of two passes to show one spot."""
NEIGHBOUR_VIEWS = 20.0
"""Views along the drive, on both passes together, within which an accepted hypothesis speaks for such a pair."""


class MergePlaces(Stage):
    """Merges places that stand side by side, and gives each view to the place whose medoid is nearest along the drive.

    Goedemé et al. 2007, section 4.5, merge the subclusters of an accepted hypothesis. Where clusters of two passes
    begin and end at different points, some of each have no partner of the same cluster to be merged with, and stay as
    places of their own beside those of the other pass. Here distance is the sum of visual distances along the drive,
    which may change over to another pass wherever two views near an accepted hypothesis match; so views of both passes
    belong to one place, and places end where it is as far to the next.
    """

    min_spacing: Annotated[float, Bounds(ge=0)] = 0.1
    """Visual distance along the drive, of the medoids of two places that are not merged; 0: all stay as they are."""

    class Out(Outputs):
        """The hypotheses, with the merged place of each view."""

        hypotheses: LoopHypotheses

    def step(self, ctx: Context, views: ComparedViews, hypotheses: LoopHypotheses) -> Out:
        """The whole tour at once."""
        if not self.min_spacing:
            return self.Out(hypotheses=hypotheses)
        accepted = hypotheses.pairs[hypotheses.accepted]
        spots = same_spots(views.shares, views.orders, accepted, MIN_SHARE, NEIGHBOUR_VIEWS)
        row = np.arange(len(views) - 1)
        row = row[(views.tours[:-1] == views.tours[1:]) & (views.tours[:-1] > 0)]
        known = np.flatnonzero(views.owners >= 0)
        same = np.argwhere(np.triu(views.owners[known, None] == views.owners[known], 1))
        edges = np.concatenate([np.column_stack([row, row + 1]), accepted, spots, known[same]])
        place = merged_places(views.distances, edges, hypotheses.place, views.owners, self.min_spacing)
        return self.Out(hypotheses=dataclasses.replace(hypotheses, place=place))
