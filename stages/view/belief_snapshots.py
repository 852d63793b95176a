"""How a belief came together: its particles at a few moments of a drive."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, Tick
from omninav.pipeline.results import Figure
from omninav.stages.geometry.particles import weighted_moments
from omninav.stages.values.belief import Particles, PoseEstimate
from omninav.stages.values.drives import Array
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.pose import Pose

from .moments import geometric_moments
from .style import ESTIMATE, PARTICLE, TRUTH, draw_map, draw_pose, extent_of, fitting_height, picture, plan_axes


class BeliefSnapshots(Stage):
    """The particles over the map at `moments` frames of the last log, dense at its beginning, with estimate, truth."""

    moments: Annotated[int, Bounds(ge=1, le=12)] = 6

    class Out(Outputs):
        """`figure`: one panel per moment."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        ticks: Sequence[Tick],
        beliefs: Sequence[Particles | None],
        estimates: Sequence[PoseEstimate | None],
        truth: Sequence[Pose | None],
        map: ReferenceGraph | None = None,
    ) -> Out:
        """The whole run at once."""
        last = [tick for tick in ticks]
        rows = [row for row, tick in enumerate(last) if tick.log == last[-1].log]
        panels = []
        for moment in geometric_moments(len(rows), self.moments):
            row = rows[moment]
            belief, estimate = beliefs[row], estimates[row]
            if belief is not None:
                seconds = (last[row].stamp - last[rows[0]].stamp) / 1e9
                panels.append(
                    (last[row].frame, seconds, belief, _row(estimate.pose if estimate else None), _row(truth[row]))
                )
        if not panels:
            return self.Out()
        return self.Out(
            figure=Figure(
                name="belief_snapshots",
                title="How the belief came together",
                caption=f"{len(panels)} moments of the drive, dense at its beginning. Pink: particles; arrows: "
                "the estimate (blue) and the true pose (black). The spread is the standard deviation of the "
                "particles' distance from their mean.",
                content=_draw(panels, map),
                order=30,
            )
        )


def _row(pose: Pose | None) -> Array:
    return np.full(3, np.nan) if pose is None else np.array([pose.x, pose.y, pose.heading])


def _draw(panels: Sequence[tuple[int, float, Particles, Array, Array]], map: ReferenceGraph | None) -> bytes:
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    everything = [map.poses] if map is not None and len(map) else [panel[2].poses for panel in panels]
    extent = extent_of(*everything, *(panel[3][None] for panel in panels), *(panel[4][None] for panel in panels))
    arrow = 0.09 * (extent[1] - extent[0] + extent[3] - extent[2]) / 2 if extent else 1.0
    with picture(9.0, rows * fitting_height(extent, 9.0 / columns, 2.0, 4.5), dpi=100) as drawn:
        for number, (frame, seconds, belief, estimate, truth) in enumerate(panels):
            axes = drawn.canvas.add_subplot(rows, columns, number + 1)
            draw_map(axes, map)
            axes.scatter(
                belief.poses[:, 0],
                belief.poses[:, 1],
                s=5,
                color=PARTICLE,
                alpha=0.6,
                linewidths=0,
                zorder=3,
                label="particles",
            )
            draw_pose(axes, truth, arrow, TRUTH, "ground truth")
            draw_pose(axes, estimate, arrow, ESTIMATE, "estimate")
            plan_axes(axes, extent)
            _, covariance = weighted_moments(belief.poses, belief.weights)
            error = float(np.hypot(*(estimate - truth)[:2]))
            said = f", error {error:.2f} m" if np.isfinite(error) else ""
            spread = float(np.sqrt(max(covariance[0, 0] + covariance[1, 1], 0.0)))
            axes.set_title(f"frame {frame} · {seconds:.1f} s\nspread {spread:.2f} m{said}", fontsize=8.5)
            if number % columns:
                axes.set_ylabel("")
            if number < len(panels) - columns:
                axes.set_xlabel("")
        handles, labels = drawn.canvas.axes[0].get_legend_handles_labels()
        drawn.canvas.legend(handles, labels, loc="outside lower center", ncols=4)
    return drawn.content
