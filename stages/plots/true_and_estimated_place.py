"""Where a robot truly was, and at which place of its map it thought to be."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Figure, Outputs, Stage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.geometry.appearance.place_graph import links_between
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.drive import Array, Drive, known
from omninav.stages.values.topological_map import TopologicalMap

from .drawing import (
    ESTIMATE,
    MARK,
    ODOMETRY,
    TRUTH,
    broken_at_jumps,
    draw_map,
    extent_of,
    faded,
    fitting_height,
    plan_axes,
)

RIGHT, BESIDE, WRONG = range(3)


class TrueAndEstimatedPlace(Stage):
    """Plots the true path over the topological map, each image joined with its most probable place (map frame, m).

    As opaque as it was probable; green where that place's medoid is the truly nearest, blue where it is linked with the
    nearest, orange elsewhere. Of the last log.
    """

    class Out(Outputs):
        """`figure`: absent without ground truth."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        beliefs: Sequence[PlaceBelief | None],
        map: TopologicalMap,
    ) -> Out:
        """The whole run at once."""
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
        return self.Out(
            figure=Figure(
                name="believed_places",
                title="True and estimated place",
                caption=f"Black: the true path. Grey: {len(map)} places where their medoids were taken, joined along "
                "the images between them. From each image a line to the place that was believed most, as dark as "
                f"it was probable: the truly nearest (green, {counted[RIGHT]:.0f} % of the images), one that is "
                f"linked with it (blue, {counted[BESIDE]:.0f} %), another (orange, {counted[WRONG]:.0f} %). Where the "
                "drive leaves the tour's path no place is near.",
                content=_draw(path, believed, np.array(shares), kinds, map),
                order=9,
            )
        )


def judged(path: Array, believed: npt.NDArray[np.int64], map: TopologicalMap) -> npt.NDArray[np.int64]:
    """Of each image, taken at (N, 2): whether the believed place (N,) is the nearest, one beside it, or another."""
    nearest, apart = map.nearest_places(path), links_between(map.links, len(map))
    return np.where(believed == nearest, RIGHT, np.where(apart[believed, nearest] <= 1, BESIDE, WRONG))


def _draw(
    path: Array, believed: npt.NDArray[np.int64], shares: Array, kinds: npt.NDArray[np.int64], map: TopologicalMap
) -> bytes:
    from matplotlib.collections import LineCollection

    medoids = map.poses[map.places][:, :2]
    extent = extent_of(map.poses, path, margin=0.05)
    with plot(8.5, fitting_height(extent, 8.5, 2.6, 8.5)) as drawn:
        axes = drawn.canvas.add_subplot()
        draw_map(axes, map)
        axes.plot(*broken_at_jumps(path, 2.5).T, color=TRUTH, linewidth=1.4, zorder=2, label="true path")
        axes.plot(*path.T, ".", color=TRUTH, markersize=3, zorder=4)
        for kind, colour, name in (
            (RIGHT, MARK, "nearest"),
            (BESIDE, ESTIMATE, "beside it"),
            (WRONG, ODOMETRY, "another"),
        ):
            mine = kinds == kind
            lines = np.stack([path[mine], medoids[believed[mine]]], axis=1)
            colours = faded(colour, np.clip(shares[mine], 0.12, 1.0))
            axes.add_collection(LineCollection(list(lines), colors=colours, linewidths=1.3, zorder=3))
            axes.plot([], [], color=colour, linewidth=1.6, label=f"believed: {name} ({int(mine.sum())})")
        if len(map) <= 80:
            for place, spot in enumerate(medoids):
                axes.annotate(str(place), spot, fontsize=6, xytext=(3, 3), textcoords="offset points", zorder=6)
        plan_axes(axes, extent)
        drawn.canvas.legend(loc="outside lower center", ncols=5)
    return drawn.content
