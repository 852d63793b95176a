"""Plots loop hypotheses of a tour, and the topological map made from it."""

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Figure, FigureStage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.pose import SOURCE_WORDS
from omninav.stages.values.topological_map import LOOP, LoopHypotheses, TopologicalMap

from .drawing import (
    EDGE,
    ESTIMATE,
    MARK,
    ODOMETRY,
    REFERENCE,
    TRUTH,
    draw_plan,
    extent_of,
    fitting_height,
    plan_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = npt.NDArray[np.float64]


class ShowLoopHypotheses(FigureStage):
    """Plots accepted and rejected loop hypotheses over the drive, and the map with its places, links and path images.

    As Figures 11 and 12 of Goedeme et al. 2007. Poses are those that the map keeps for drawing: truth, or odometry.
    With `plan` wired the world's floor plan lies under both. Gives nothing where no image has a pose.
    """

    def step(
        self, ctx: Context, hypotheses: LoopHypotheses, map: TopologicalMap, plan: FloorPlan | None = None
    ) -> FigureStage.Out:
        """Draw both panels."""
        if not np.isfinite(hypotheses.poses).all(axis=1).any():
            return self.Out()
        accepted, number = int(hypotheses.accepted.sum()), len(hypotheses.accepted)
        return self.Out(
            figure=Figure(
                name="loop_hypotheses",
                title="Loop hypotheses and the topological map",
                caption=f"Left: the {len(hypotheses.poses)} images of the tour that took part, where each was taken "
                f"(from {SOURCE_WORDS[hypotheses.pose_source]}); {accepted} of {number} hypotheses that two views show "
                f"one place were accepted, the others rejected. Right: {len(map)} places at their medoids, "
                f"{len(map.links)} links, and the path images between them: {len(map.views)} views in all. It was made "
                "from images alone.",
                content=_draw(hypotheses, map, plan),
                order=9,
            )
        )


def _draw(found: LoopHypotheses, map: TopologicalMap, plan: FloorPlan | None) -> bytes:
    extent = extent_of(found.poses, margin=0.08)
    with plot(11.0, fitting_height(extent, 4.9, 2.6, 8.5)) as drawn:
        left, right = drawn.canvas.subplots(1, 2)
        for axes in (left, right):
            draw_plan(axes, plan)
            _draw_tours(axes, found)
        for kept, colour, name, width in (
            (~found.accepted, ODOMETRY, "rejected", 0.8),
            (found.accepted, MARK, "accepted", 1.4),
        ):
            ends = found.poses[found.pairs[kept]][:, :, :2]
            _lines(left, ends, colour, width, f"{name} ({int(kept.sum())})")
            left.plot(
                *ends.reshape(-1, 2).T, ".", color=colour, markersize=4, zorder=3
            )  # pairs at one spot have no line
        _draw_places(right, map)
        for axes in (left, right):
            plan_axes(axes, extent)
        legends = [axes.get_legend_handles_labels() for axes in (left, right)]
        named = {label: handle for legend in legends for handle, label in zip(*legend, strict=True)}
        drawn.canvas.legend(named.values(), named.keys(), loc="outside lower center", ncols=len(named))
    return drawn.content


def _draw_tours(axes: "Axes", found: LoopHypotheses) -> None:
    for number, tour in enumerate(np.unique(found.tour)):
        poses = found.poses[found.tour == tour]
        label = f"images ({len(found.poses)})" if number == 0 else None
        axes.plot(poses[:, 0], poses[:, 1], "." if tour == 0 else ".-", color=EDGE, linewidth=0.8, markersize=2.5,
                  zorder=1, label=label)  # fmt: skip


def _draw_places(axes: "Axes", map: TopologicalMap) -> None:
    poses = map.poses[:, :2]
    paths = [poses[[map.places[a], *map.path_of(link), map.places[b]]] for link, (a, b) in enumerate(map.links)]
    loop = map.kinds == LOOP
    driven = [path for path, of_loop in zip(paths, loop, strict=True) if not of_loop]
    _lines(axes, driven, ESTIMATE, 1.1, f"driven ({len(driven)})")
    if loop.any():
        _lines(
            axes, [path for path, of in zip(paths, loop, strict=True) if of], MARK, 1.4, f"loops ({int(loop.sum())})"
        )
    between = np.setdiff1d(np.arange(len(poses)), map.places)
    axes.plot(*poses[between].T, ".", color=REFERENCE, markersize=4, zorder=4, label=f"path images ({len(between)})")
    axes.plot(*poses[map.places].T, "o", color=TRUTH, markersize=4.5, zorder=5, label=f"places ({len(map)})")
    for name in dict.fromkeys(name for name in map.names if name):
        middle = poses[map.places[map.named(name)]].mean(axis=0)
        axes.annotate(name, middle, fontsize=6, xytext=(4, 4), textcoords="offset points", zorder=6)


def _lines(axes: "Axes", lines: list[Array] | Array, colour: str, width: float, label: str) -> None:
    from matplotlib.collections import LineCollection

    axes.add_collection(LineCollection(list(lines), colors=colour, linewidths=width, zorder=3, label=label))
