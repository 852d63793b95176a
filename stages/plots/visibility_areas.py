"""Plots from where the views of a map can be seen."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Plot, PlotStage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.values.drive import Drive
from omninav.stages.values.grid import FREE, OccupancyGrid
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.visibility import VisibilityAreas

from .drawing import (
    ESTIMATE,
    MARK,
    ODOMETRY,
    REFERENCE,
    TRUTH,
    draw_grid,
    extent_of,
    fitting_height,
    grid_extent,
    plan_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes


HUES = (ESTIMATE, MARK, ODOMETRY, "#CC79A7")
"""Colours of a view's areas, in turns."""
EXAMPLES = 5
"""Number of references that have a panel."""


class ShowVisibilityAreas(PlotStage):
    """Plots visibility areas of some references over the grid, and how many views' areas each free cell is in.

    As Figure 6 of Wolf, Burgard & Burkhardt 2005: a circle where the image was taken, its axis, the point lambda and
    the area from which that is visible; of a panorama, of every sector. The references are taken at equal
    steps along the map. With `drive` wired its true path is drawn over the last panel.
    """

    needs_all_plots = True

    def step(
        self,
        ctx: Context,
        map: ReferenceGraph,
        areas: VisibilityAreas,
        grid: OccupancyGrid,
        drive: Drive | None = None,
    ) -> PlotStage.Out:
        """Draw a panel for each example, and one for all."""
        seen = np.flatnonzero((areas.target >= 0).any(axis=1))
        chosen = seen[np.unique(np.linspace(0, len(seen) - 1, EXAMPLES + 2)[1:-1].astype(np.int64))]
        counts = views_by_cell(areas)
        share = float((counts[grid.cells == FREE] > 0).mean()) if (grid.cells == FREE).any() else 0.0
        sectors = len(areas.axes)
        ways = "its point lambda" if sectors == 1 else f"its {sectors} points lambda"
        made = " The grid is a stand-in, made from the tour's free path." if grid.made_from == "tour" else ""
        driven = np.empty((0, 2)) if drive is None else drive.truth[:, :2]
        return self.Out(
            plot=Plot(
                name="visibility_areas",
                title="Visibility areas",
                caption=f"{len(chosen)} of {len(map)} references: a circle where the image was taken, a cross at "
                f"{ways}, in colour the free cells from which it is visible. Last: how many views' points each "
                f"free cell sees; {100 * share:.0f} % of the cells see at least one.{made}",
                content=_draw(map, areas, grid, chosen, counts, driven),
                order=20,
            )
        )


def views_by_cell(areas: VisibilityAreas) -> Ints:
    """Number of views whose area holds a cell: (rows, columns)."""
    views = np.bincount(areas.target[areas.target >= 0], minlength=len(areas.points))
    steps = np.zeros((areas.shape[0], areas.shape[1] + 1), np.int64)
    each = np.repeat(views, np.diff(areas.starts))
    np.add.at(steps, (areas.runs[:, 0], areas.runs[:, 1]), each)
    np.subtract.at(steps, (areas.runs[:, 0], areas.runs[:, 2]), each)
    counts: Ints = np.cumsum(steps, axis=1)[:, :-1]
    return counts


def _draw(
    map: ReferenceGraph,
    areas: VisibilityAreas,
    grid: OccupancyGrid,
    chosen: Ints,
    counts: Ints,
    driven: Array,
) -> bytes:
    rows, columns = np.nonzero(grid.cells == FREE)
    extent = extent_of(grid.centres(rows, columns), margin=0.02)
    across = 2 if extent and extent[1] - extent[0] > 1.6 * (extent[3] - extent[2]) else 3
    down = -(-(len(chosen) + 1) // across)
    with plot(9.0, down * fitting_height(extent, 0.8 * 9.0 / across, 1.4, 4.0), dpi=100) as drawn:
        for number, reference in enumerate(chosen):
            axes = drawn.canvas.add_subplot(down, across, number + 1)
            _draw_view(axes, map.poses[reference], areas, areas.target[reference], grid)
            plan_axes(axes, extent)
            axes.grid(visible=False)
            axes.set_title(f"reference {reference}", fontsize=8.5)
        axes = drawn.canvas.add_subplot(down, across, len(chosen) + 1)
        draw_grid(axes, grid)
        shown = np.where(grid.cells == FREE, counts, np.nan).astype(np.float64)
        image = axes.imshow(
            shown, extent=grid_extent(grid), origin="lower", interpolation="nearest", cmap="viridis", zorder=0.5
        )
        axes.plot(driven[:, 0], driven[:, 1], color=TRUTH, linewidth=1.0, zorder=2)
        axes.plot(map.poses[:, 0], map.poses[:, 1], ".", color="white", markersize=1.5, zorder=1.5)
        plan_axes(axes, extent)
        axes.grid(visible=False)
        axes.set_title("views whose point is in sight", fontsize=8.5)
        drawn.canvas.colorbar(image, ax=axes, shrink=0.8)
    return drawn.content


def _draw_view(
    axes: "Axes", pose: Array, areas: VisibilityAreas, targets: npt.NDArray[np.int32], grid: OccupancyGrid
) -> None:
    from matplotlib.colors import to_rgba

    draw_grid(axes, grid)
    for sector, target in enumerate(targets):
        if target < 0:
            continue
        hue, point = HUES[sector % len(HUES)], areas.points[target]
        opacity = 0.45 if len(targets) == 1 else 0.22
        colours = np.zeros((*areas.shape, 4))
        colours[areas.mask(int(target))] = to_rgba(hue, opacity)
        axes.imshow(colours, extent=grid_extent(grid), origin="lower", interpolation="nearest", zorder=0.6)
        axes.plot([pose[0], point[0]], [pose[1], point[1]], color=hue, linewidth=1.0, zorder=2)
        axes.plot([point[0]], [point[1]], "x", color=hue, markersize=6, markeredgewidth=2, zorder=3)
    axes.plot([pose[0]], [pose[1]], "o", color=TRUTH, markerfacecolor=REFERENCE, markersize=7, zorder=4)
