"""True place of a robot and the place of its map that it believed in."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, PlotStage
from omninav.pipeline.report.chart import Colour, broken
from omninav.stages.geometry.appearance.place_graph import links_between
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.drive import Drive, known
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.topological_map import TopologicalMap

from .drawing import extent_of
from .plan_chart import draw_surroundings, jumps, plan_chart

RIGHT, BESIDE, WRONG = range(3)
JUDGED: tuple[tuple[int, Colour, str], ...] = (
    (RIGHT, "green", "nearest"),
    (BESIDE, "blue", "beside it"),
    (WRONG, "orange", "another"),
)
"""Kinds of believed places, by the truly nearest one."""


class TrueAndEstimatedPlace(PlotStage):
    """Plots the true path over the topological map, each image joined with its most probable place (map frame, m).

    Faint where it was believed with less than a half; green where that place's medoid is the truly nearest, blue where
    it is linked with the nearest, orange elsewhere. Of the last log. Gives nothing without ground truth.
    """

    def step(
        self,
        ctx: Context,
        drive: Drive,
        beliefs: Sequence[PlaceBelief | None],
        map: TopologicalMap,
        plan: FloorPlan | None = None,
    ) -> PlotStage.Out:
        last = drive.last_log
        last = last.at(known(last.truth))
        spots, places, shares = [], [], []
        for row, true in zip(last.row, last.truth, strict=True):
            belief = beliefs[row]
            if belief is not None:
                spots.append(true[:2])
                places.append(int(np.argmax(belief.probabilities)))
                shares.append(float(belief.probabilities.max()))
        if not spots:
            return self.Out()
        path, believed = np.array(spots), np.array(places)
        kinds = judged(path, believed, map)
        counted = [100.0 * float((kinds == kind).mean()) for kind in (RIGHT, BESIDE, WRONG)]
        return self.drawn(
            name="believed_places",
            title="True and estimated place",
            caption="A line from each image of the true path to the most probable place, faint where its "
            f"probability is below a half: the truly nearest place (green, {counted[RIGHT]:.0f} % of the images), "
            f"one linked with it (blue, {counted[BESIDE]:.0f} %), another (orange, {counted[WRONG]:.0f} %). "
            "Off the tour's path no place is near.",
            content=_draw(path, believed, np.array(shares), kinds, map, plan),
            order=12,
        )


def judged(path: Array, believed: Ints, map: TopologicalMap) -> Ints:
    """Judges each image, taken at (N, 2): whether the believed place (N,) is the nearest, one beside it, or another."""
    nearest, apart = map.nearest_places(path), links_between(map.links, len(map))
    return np.where(believed == nearest, RIGHT, np.where(apart[believed, nearest] <= 1, BESIDE, WRONG))


def _draw(
    path: Array,
    believed: Ints,
    shares: Array,
    kinds: Ints,
    map: TopologicalMap,
    plan: FloorPlan | None,
) -> bytes:
    medoids = map.poses[map.places][:, :2]
    chart = plan_chart(extent_of(map.poses, path, margin=0.05))
    draw_surroundings(chart, map, None, plan)
    chart.base.line(broken(path, jumps(path)), "ink", 1.6)
    chart.name("true path", "ink")
    for kind, colour, name in JUDGED:
        mine = np.flatnonzero(kinds == kind)
        for faint in (True, False):  # the less probable ones fainter
            shown = mine[(shares[mine] < 0.5) == faint]
            lines = np.stack([path[shown], medoids[believed[shown]], np.full((len(shown), 2), np.nan)], axis=1)
            chart.base.line(lines.reshape(-1, 2), colour, 1.4, opacity=0.35 if faint else 1.0)
        chart.name(f"believed: {name} ({len(mine)})", colour)
    if len(map) <= 40:
        for place, spot in enumerate(medoids):
            chart.base.text(spot, str(place))
    return chart.svg()
