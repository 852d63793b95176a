"""Plots loop hypotheses of a tour, and the topological map made from it."""

import numpy as np

from omninav.pipeline import Context, PlotStage
from omninav.pipeline.report.chart import Chart, Colour, stacked
from omninav.stages.geometry.arrays import Bools
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.pose import SOURCE_WORDS
from omninav.stages.values.topological_map import LOOP, LoopHypotheses, TopologicalMap

from .drawing import extent_of
from .plan_chart import draw_lines, draw_surroundings, plan_chart


class ShowLoopHypotheses(PlotStage):
    """Plots accepted and rejected loop hypotheses over the drive, and the map with its places, links and path images.

    As Figures 11 and 12 of Goedeme et al. 2007. Poses are those that the map keeps for drawing: truth, or odometry.
    With `plan` wired the world's floor plan is under both. Gives nothing where no image has a pose.
    """

    def step(
        self, ctx: Context, hypotheses: LoopHypotheses, map: TopologicalMap, plan: FloorPlan | None = None
    ) -> PlotStage.Out:
        if not np.isfinite(hypotheses.poses).all(axis=1).any():
            return self.Out()
        accepted, number = int(hypotheses.accepted.sum()), len(hypotheses.accepted)
        return self.drawn(
            name="loop_hypotheses",
            title="Loop hypotheses and the topological map",
            caption=f"Above: the {len(hypotheses.poses)} images of the tour that took part, where each was taken "
            f"(from {SOURCE_WORDS[hypotheses.pose_source]}); {accepted} of {number} hypotheses that two views show "
            f"one place were accepted, the others rejected. Below: {len(map)} places at their medoids, "
            f"{len(map.links)} links, and the path images between them: {len(map.views)} views in all. It was made "
            "from images alone.",
            content=_draw(hypotheses, map, plan),
            order=9,
        )


def _draw(found: LoopHypotheses, map: TopologicalMap, plan: FloorPlan | None) -> bytes:
    extent = extent_of(found.poses, margin=0.08)
    loops, places = plan_chart(extent), plan_chart(extent)
    for chart in (loops, places):
        draw_surroundings(chart, None, None, plan)
        for tour in np.unique(found.tour):
            poses = found.poses[found.tour == tour]
            chart.base.dots(poses, "grey", 1.2, 0.5)
            if tour != 0:  # the first one's way is what the links show
                chart.base.line(poses[:, :2], "line", 0.8)
        chart.name(f"images ({len(found.poses)})", "grey", "dot")
    shown: tuple[tuple[Bools, Colour, str], ...] = (
        (~found.accepted, "orange", "rejected"),
        (found.accepted, "green", "accepted"),
    )
    for kept, colour, name in shown:
        ends = found.poses[found.pairs[kept]]
        draw_lines(loops.base, list(ends), colour, 1.4)
        loops.base.dots(ends.reshape(-1, 3), colour, 2.0)  # pairs at one spot have no line
        loops.name(f"{name} ({int(kept.sum())})", colour)
    _draw_places(places, map)
    return stacked([loops, places])


def _draw_places(chart: Chart, map: TopologicalMap) -> None:
    paths = [map.poses[map.whole_way(link)] for link in range(len(map.links))]
    loop = map.kinds == LOOP
    kinds: tuple[tuple[Bools, Colour, str], ...] = ((~loop, "blue", "driven"), (loop, "green", "loops"))
    for of_kind, colour, name in kinds:
        some = [path for path, kept in zip(paths, of_kind, strict=True) if kept]
        draw_lines(chart.base, some, colour, 1.3)
        if some:
            chart.name(f"{name} ({len(some)})", colour)
    between = np.setdiff1d(np.arange(len(map.poses)), map.places)
    chart.base.dots(map.poses[between], "blue", 1.6)
    chart.name(f"path images ({len(between)})", "blue", "dot")
    chart.base.dots(map.poses[map.places], "ink", 3.0)
    chart.name(f"places ({len(map)})", "ink", "dot")
    for name in dict.fromkeys(name for name in map.names if name):
        chart.base.text(map.poses[map.places[map.named(name)]].mean(axis=0), name)
