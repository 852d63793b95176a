"""Plots a map of views: where each is seen from, how surely, and its weight."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, PlotStage
from omninav.pipeline.report.chart import Colour
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.pose import SOURCE_WORDS
from omninav.stages.values.view_mixtures import ViewMixtures

from .drawing import extent_of
from .plan_chart import draw_surroundings, plan_chart

MAX_ELLIPSES = 3000
"""Largest number of ellipses: of a larger map the heaviest are drawn."""
SIGMAS = 1.0
"""Half the width of an ellipse, standard deviations."""


class MapEllipses(PlotStage):
    """Plots a map of views as ellipses, as opaque as they weigh, over the true path and the floor plan.

    Without truth the path is that of the estimates, and no plan is drawn: the map has a frame of its own then. Gives
    nothing where the map is empty.
    """

    def step(self, ctx: Context, drive: Drive, map: ViewMixtures, plan: FloorPlan | None = None) -> PlotStage.Out:
        if not len(map.weights):
            return self.Out()
        true = drive.has_truth
        paths = [log.truth if true else log.estimate for log in drive.by_log]
        per_view = len(map.weights) / max(len(map), 1)
        size = (
            f"{len(map)} views seen from {len(map.weights)} places ({per_view:.2f} each), learned in {map.steps} steps."
        )
        return self.drawn(
            name="map_ellipses",
            title="The map",
            caption=f"{size} Each place is an ellipse of {SIGMAS:g} sigma, fainter where it "
            f"weighs less. The line is the {'true path' if true else 'estimate'}. "
            f"The first pose was taken from {SOURCE_WORDS[map.pose_source]}.",
            content=_draw(map, paths, plan if true else None, true),
            order=12,
        )


def _draw(map: ViewMixtures, paths: Sequence[Array], plan: FloorPlan | None, true: bool) -> bytes:
    reach = SIGMAS * np.sqrt(np.diagonal(map.covariances, axis1=1, axis2=2)[:, :2])
    corners = map.means[:, None, :2] + np.stack([-reach, reach], axis=1)
    chart = plan_chart(extent_of(*paths, corners.reshape(-1, 2), margin=0.02))
    draw_surroundings(chart, None, None, plan)
    for path in paths:
        colour: Colour = "ink" if true else "blue"
        chart.base.line(path[known(path)], colour, 0.9, opacity=0.6)
        chart.name("true path" if true else "estimate", colour)
    order = np.argsort(map.weights, kind="stable")[-MAX_ELLIPSES:]  # what weighs most is on top
    share = np.clip(map.weights[order] / (map.weights.max() or 1.0), 0.15, 1.0)
    chart.base.ellipses(map.means[order], map.covariances[order], share, "pink", SIGMAS)
    chart.name("places of the map's views", "pink", "ring")
    return chart.svg()
