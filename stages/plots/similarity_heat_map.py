"""Plots which references look like the present image."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, Plot, PlotStage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.geometry.arrays import Array
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.drive import Drive
from omninav.stages.values.maps import ReferenceGraph

from .drawing import ESTIMATE, REFERENCE, TRUTH, draw_pose, extent_of, fitting_height, plan_axes
from .similarity_peaks import Peaks
from .snapshot_times import spread_out

FRAMES = 4
"""Number of columns."""


class SimilarityHeatMap(PlotStage):
    """Plots each reference's best similarity over the map, and the heading profile of the best one."""

    needs_all_plots = True

    def step(self, ctx: Context, drive: Drive, peaks: Sequence[Peaks | None], map: ReferenceGraph) -> PlotStage.Out:
        """The whole run at once; frames of the last log are shown."""
        last = drive.last_log
        kept = [
            (frame, peak, true)
            for frame, row, true in zip(last.frames.tolist(), last.row.tolist(), last.truth, strict=True)
            if (peak := peaks[row]) is not None
        ]
        if not kept:
            return self.Out()
        panels = [kept[i] for i in spread_out(len(kept), FRAMES)]
        return self.Out(
            plot=Plot(
                name="similarity_heat_map",
                title="Similarity to the map's views",
                caption="Above: each reference's best similarity over all headings (grey: not compared, as "
                "the belief was far from it), the most similar one ringed, the true pose in black. "
                "Below: the most similar reference's similarity over the robot's heading against its own; "
                "the dashed line is the true heading.",
                content=_draw(panels, map),
                order=40,
            )
        )


def _draw(panels: Sequence[tuple[int, Peaks, Array]], map: ReferenceGraph) -> bytes:
    truths = np.array([pose for _, _, pose in panels])
    extent = extent_of(map.poses, truths)
    columns = len(panels)
    arrow = 0.1 * (extent[1] - extent[0] + extent[3] - extent[2]) / 2 if extent else 1.0
    above = fitting_height(extent, 10.0 / columns, 1.8, 5.0)
    with plot(10.0, above + 1.9, dpi=100) as drawn:
        axes = drawn.canvas.subplots(2, columns, squeeze=False, height_ratios=[above, 1.6])
        low = min(float(peak.best.min()) for _, peak, _ in panels)
        high = max(float(peak.best.max()) for _, peak, _ in panels)
        size = float(np.clip(6000 / len(map), 3, 26))
        dots = None
        for number, (frame, peak, _) in enumerate(panels):
            plan, profile = axes[0, number], axes[1, number]
            where = map.poses if peak.candidates is None else map.poses[peak.candidates]
            plan.scatter(map.poses[:, 0], map.poses[:, 1], s=size / 3, color=REFERENCE, alpha=0.4, linewidths=0)
            order = np.argsort(peak.best, kind="stable")  # the most similar ones on top
            dots = plan.scatter(
                where[order, 0],
                where[order, 1],
                c=peak.best[order],
                s=size,
                cmap="viridis",
                vmin=low,
                vmax=high,
                linewidths=0,
            )
            ring = map.poses[peak.reference]
            plan.plot(
                [ring[0]],
                [ring[1]],
                "o",
                markersize=9,
                markerfacecolor="none",
                markeredgecolor="#D55E00",
                markeredgewidth=1.5,
            )
            draw_pose(plan, truths[number], arrow, TRUTH)
            plan_axes(plan, extent)
            plan.set_title(f"frame {frame}")
            headings = len(peak.profile)
            turned = np.degrees(wrap(2 * np.pi * np.arange(headings) / headings))
            order = np.argsort(turned, kind="stable")
            profile.plot(turned[order], peak.profile[order], ".-", color=ESTIMATE, markersize=4)
            profile.set_xlim(-185, 185)
            profile.set_xticks([-180, -90, 0, 90, 180])
            profile.set_xlabel("heading − reference's (°)")
            true_turn = np.degrees(wrap(truths[number, 2] - ring[2]))
            if np.isfinite(true_turn):
                profile.axvline(float(true_turn), color=TRUTH, linestyle="--", linewidth=1.1)
            if number:
                plan.set_ylabel("")
        axes[1, 0].set_ylabel("similarity")
        if dots is not None:
            drawn.canvas.colorbar(dots, ax=list(axes[0]), label="best similarity", shrink=0.85, pad=0.01)
    return drawn.content
