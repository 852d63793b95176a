"""Plots a map of views: where each is seen from, how surely, and its weight."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Figure, Outputs, Stage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.values.drive import Array, Drive, known
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.view_mixtures import ViewMixtures

from .drawing import (
    EDGE,
    ESTIMATE,
    TRUTH,
    draw_gaussians,
    draw_plan,
    extent_of,
    fitting_height,
    plan_axes,
)


class MapEllipses(Stage):
    """Plots the components of a map of views as ellipses, coloured by weight, over the true path and the floor plan.

    A short line from the middle points along the heading at which the view is seen as it was kept. Without truth the
    path is that of the estimates, and no plan is drawn: the map has a frame of its own then.
    """

    sigmas: Annotated[float, Bounds(gt=0)] = 1.0
    """Half the width of an ellipse in standard deviations."""
    headings: Annotated[int, Bounds(ge=0)] = 600
    """Largest number of components with which headings are drawn."""

    class Out(Outputs):
        """`figure`: absent where the map is empty."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        map: ViewMixtures,
        plan: FloorPlan | None = None,
    ) -> Out:
        """The map at the end of the run."""
        if not len(map.weights):
            return self.Out()
        true = drive.has_truth
        paths = [log.truth if true else log.estimate for log in drive.by_log]
        per_view = len(map.weights) / max(len(map), 1)
        size = (
            f"{len(map)} views seen from {len(map.weights)} places ({per_view:.2f} each), learned in {map.steps} steps."
        )
        return self.Out(
            figure=Figure(
                name="map_ellipses",
                title="The map",
                caption=f"{size} Each place is an ellipse of {self.sigmas:g} sigma, yellow where it "
                f"weighs little and blue where it weighs much. The line is the {'true path' if true else 'estimate'}. "
                f"The first pose came from {map.pose_source}.",
                content=_draw(map, paths, plan if true else None, self.sigmas, self.headings, true),
                order=12,
            )
        )


def _draw(
    map: ViewMixtures, paths: Sequence[Array], plan: FloorPlan | None, sigmas: float, headings: int, true: bool
) -> bytes:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    reach = sigmas * np.sqrt(np.diagonal(map.covariances, axis1=1, axis2=2)[:, :2])
    corners = map.means[:, None, :2] + np.stack([-reach, reach], axis=1)
    extent = extent_of(*paths, corners.reshape(-1, 2), margin=0.02)
    with plot(8.0, fitting_height(extent, 8.0, 3.0, 9.0)) as drawn:
        axes = drawn.canvas.add_subplot()
        draw_plan(axes, plan)
        for number, path in enumerate(paths):
            colour, name = (TRUTH, "true path") if true else (ESTIMATE, "estimate")
            x, y = path[known(path)][:, :2].T
            axes.plot(x, y, color=colour, linewidth=0.8, alpha=0.5, zorder=2, label=None if number else name)
        scale = ScalarMappable(Normalize(0.0, float(map.weights.max()) or 1.0), "viridis_r")
        order = np.argsort(map.weights, kind="stable")  # what weighs most lies on top
        means, weights = map.means[order], map.weights[order]
        colours = np.asarray(scale.to_rgba(weights))
        draw_gaussians(axes, means, map.covariances[order], colours, sigmas)
        if len(means) <= headings:
            length = 0.012 * max(extent[1] - extent[0], extent[3] - extent[2]) if extent else 0.1
            tips = means[:, :2] + length * np.column_stack([np.cos(means[:, 2]), np.sin(means[:, 2])])
            axes.plot(*np.stack([means[:, :2], tips]).transpose(2, 0, 1), color=EDGE, linewidth=0.6, zorder=4)
        plan_axes(axes, extent)
        drawn.canvas.colorbar(scale, ax=axes, label="weight", shrink=0.8, pad=0.01)
        drawn.canvas.legend(loc="outside lower center")
    return drawn.content
