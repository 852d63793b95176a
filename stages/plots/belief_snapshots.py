"""Plots the belief at a few frames of a drive."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Figure, Outputs, Stage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.values.belief import GaussianMixture, Particles, PlaceBelief
from omninav.stages.values.drive import Array, Drive
from omninav.stages.values.grid import OccupancyGrid
from omninav.stages.values.map_places import AnyMap, map_poses

from .belief_spread import spread_m
from .drawing import (
    ESTIMATE,
    PARTICLE,
    TRUTH,
    draw_gaussians,
    draw_grid,
    draw_map,
    draw_pose,
    extent_of,
    faded,
    fitting_height,
    plan_axes,
)
from .snapshot_times import geometric_steps

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Shown = Particles | GaussianMixture | PlaceBelief


class BeliefSnapshots(Stage):
    """Plots the belief over the map at a few frames of the last log, more often at its beginning.

    Particles are dots; a mixture's Gaussians are ellipses of two standard deviations, as opaque as they weigh; places
    are discs, as large as they are probable. With `grid` wired, all of it over what is occupied there.
    """

    on_request = True

    frames: Annotated[int, Bounds(ge=1, le=12)] = 6
    """Number of panels."""

    class Out(Outputs):
        """`figure`: one panel per frame."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        beliefs: Sequence[Shown | None],
        map: AnyMap | None = None,
        grid: OccupancyGrid | None = None,
    ) -> Out:
        """The whole run at once."""
        last = drive.last_log
        panels = []
        for k in geometric_steps(len(last), self.frames):
            belief = beliefs[last.row[k]]
            if belief is not None:
                panels.append((int(last.frames[k]), last.seconds[k], belief, last.estimate[k], last.truth[k]))
        if not panels:
            return self.Out()
        return self.Out(
            figure=Figure(
                name="belief_snapshots",
                title="Convergence of the belief",
                caption=f"{len(panels)} frames, more of them at the beginning. Pink: {_named(panels[0][2])}; "
                "arrows: the estimate (blue) and the true pose (black). The spread is the standard deviation of the "
                "distance from the belief's mean.",
                content=_draw(panels, map, grid),
                order=30,
            )
        )


def _draw(
    panels: Sequence[tuple[int, float, Shown, Array, Array]], map: AnyMap | None, grid: OccupancyGrid | None
) -> bytes:
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    everything = [map_poses(map)] if map is not None and len(map) else [_poses(panel[2]) for panel in panels]
    extent = extent_of(*everything, *(panel[3][None] for panel in panels), *(panel[4][None] for panel in panels))
    arrow = 0.09 * (extent[1] - extent[0] + extent[3] - extent[2]) / 2 if extent else 1.0
    with plot(9.0, rows * fitting_height(extent, 9.0 / columns, 2.0, 4.5), dpi=100) as drawn:
        for number, (frame, seconds, belief, estimate, truth) in enumerate(panels):
            axes = drawn.canvas.add_subplot(rows, columns, number + 1)
            draw_grid(axes, grid)
            draw_map(axes, map)
            _draw_belief(axes, belief)
            draw_pose(axes, truth, arrow, TRUTH, "ground truth")
            draw_pose(axes, estimate, arrow, ESTIMATE, "estimate")
            plan_axes(axes, extent)
            error = float(np.hypot(*(estimate - truth)[:2]))
            suffix = f", error {error:.2f} m" if np.isfinite(error) else ""
            axes.set_title(f"frame {frame} · {seconds:.1f} s\nspread {spread_m(belief):.2f} m{suffix}", fontsize=8.5)
            if number % columns:
                axes.set_ylabel("")
            if number < len(panels) - columns:
                axes.set_xlabel("")
        handles, labels = drawn.canvas.axes[0].get_legend_handles_labels()
        drawn.canvas.legend(handles, labels, loc="outside lower center", ncols=4)
    return drawn.content


def _poses(belief: Shown) -> Array:
    return belief.means if isinstance(belief, GaussianMixture) else belief.poses


def _named(belief: Shown) -> str:
    if isinstance(belief, PlaceBelief):
        return "places, as large as they are probable"
    return "particles" if isinstance(belief, Particles) else "Gaussians, two standard deviations wide"


def _draw_belief(axes: "Axes", belief: Shown) -> None:
    x, y = _poses(belief)[:, :2].T
    if isinstance(belief, PlaceBelief):
        size = 4.0 + 140.0 * belief.probabilities
        axes.scatter(x, y, s=size, color=PARTICLE, alpha=0.6, linewidths=0, zorder=3, label="probability")
    elif isinstance(belief, Particles):
        axes.scatter(x, y, s=5, color=PARTICLE, alpha=0.6, linewidths=0, zorder=3, label="particles")
    else:
        colours = faded(PARTICLE, np.clip(belief.weights, 0.15, 1))
        draw_gaussians(axes, belief.means, belief.covariances, colours)
        axes.scatter(x, y, s=6, c=colours, linewidths=0, zorder=3, label="Gaussians")
