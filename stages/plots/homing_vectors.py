"""Plots homing vectors over the floor, towards one target."""

import numpy as np

from omninav.pipeline import Context, Figure, FigureStage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.homing_field import HomingField

from .drawing import (
    EDGE,
    ODOMETRY,
    TRUTH,
    draw_plan,
    draw_pose,
    extent_of,
    fitting_height,
    plan_axes,
)


class ShowHomingVectors(FigureStage):
    """Plots an arrow where each view was taken, along its homing vector, coloured by its error.

    As Figure 15 of Goedemé et al. 2007. With `plan` wired the world's floor plan lies under them. Gives nothing where
    there is no field.
    """

    def step(self, ctx: Context, field: HomingField | None = None, plan: FloorPlan | None = None) -> FigureStage.Out:
        """Draw the field."""
        if field is None:
            return self.Out()
        found, degrees = np.isfinite(field.directions), np.degrees(field.errors)
        median = float(np.median(np.where(found, degrees, 180.0)))
        return self.Out(
            figure=Figure(
                name="homing_vectors",
                title="Homing vectors",
                caption=f"From {len(degrees)} views to one target; {int(found.sum())} of them have a homing vector. "
                f"Median error of the direction: {median:.1f}° (a view without a vector counts as 180°). Crosses: no "
                "vector. Rings: every 2 m.",
                content=_draw(field, plan),
                order=8,
            )
        )


def _draw(field: HomingField, plan: FloorPlan | None) -> bytes:
    from matplotlib.patches import Circle

    extent = extent_of(field.poses, field.target[None], margin=0.06)
    with plot(8.0, fitting_height(extent, 6.6, 3.0, 8.0)) as drawn:
        axes = drawn.canvas.subplots()
        draw_plan(axes, plan)
        for metres in np.arange(2.0, float(field.metres.max()) + 1.0, 2.0):
            axes.add_patch(Circle(tuple(field.target[:2]), metres, fill=False, color=EDGE, linewidth=0.8))
        found = np.isfinite(field.directions)
        at, length = field.poses[found], _spacing(field.poses)
        arrow = 0.85 * length * np.stack([np.cos(field.directions), np.sin(field.directions)], axis=-1)[found]
        arrows = axes.quiver(*(at[:, :2] - arrow / 2).T, *arrow.T, np.clip(np.degrees(field.errors[found]), 0.0, 90.0),
                             cmap="viridis", angles="xy", scale_units="xy", scale=1.0, width=0.004,
                             clim=(0.0, 90.0), zorder=3)  # fmt: skip
        drawn.canvas.colorbar(arrows, ax=axes, label="error of the direction (degrees)", shrink=0.7)
        axes.plot(*field.poses[~found, :2].T, "x", color=ODOMETRY, markersize=4, zorder=3)
        draw_pose(axes, field.target, length, TRUTH, "target")
        plan_axes(axes, extent)
    return drawn.content


def _spacing(poses: np.ndarray) -> float:
    """How far apart neighbours typically are."""
    if len(poses) < 2:
        return 1.0
    apart = np.hypot(*(poses[:, None, :2] - poses[None, :, :2]).transpose(2, 0, 1))
    np.fill_diagonal(apart, np.inf)
    return float(np.median(apart.min(axis=1)))
