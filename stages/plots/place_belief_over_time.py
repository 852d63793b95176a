"""Plots the belief in every place of a topological map over time."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Figure, Outputs, Stage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.geometry.appearance.place_graph import links_between
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.drive import Array, Drive
from omninav.stages.values.drive import known as poses_known
from omninav.stages.values.topological_map import TopologicalMap

from .drawing import ESTIMATE, MARK, ODOMETRY, PARTICLE, TRUTH

COLUMNS = 900
"""Ticks that are told apart in the plot; of longer drives the largest belief in each."""


class PlaceBeliefOverTime(Stage):
    """Plots the belief in every place over time, as dark as it is probable, with the place that was truly nearest.

    Of the last log. Below it: the belief's share of its maximum, of the truly nearest place, and of
    that together with its neighbours.
    """

    class Out(Outputs):
        """`figure`: absent where nothing was believed."""

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
        shares = np.full((len(last), len(map)), np.nan)
        for k, row in enumerate(last.row):
            belief = beliefs[row]
            if belief is not None:
                shares[k] = belief.probabilities
        path = last.truth
        nearest = np.where(poses_known(path), map.nearest_places(np.nan_to_num(path)), -1)
        if not np.isfinite(shares).any():
            return self.Out()
        known = nearest >= 0
        truly = "" if not known.any() else " Green: the place whose medoid was truly nearest."
        right = ""
        both = known & np.isfinite(shares).all(axis=1)
        if both.any():
            rate = float((np.argmax(shares[both], axis=1) == nearest[both]).mean())
            right = f" In {100 * rate:.0f} % of the images the most probable place is that one."
        return self.Out(
            figure=Figure(
                name="place_belief",
                title="Belief over places",
                caption=f"Above: {len(map)} places, numbered as the map has them, as dark as they were believed.{truly}"
                f"{right} Below: how probable the most probable place was, and how probable the truly nearest, alone "
                "and with the places linked to it.",
                content=_draw(last.seconds, shares, nearest, map),
                order=28,
            )
        )


def with_neighbours(shares: Array, nearest: npt.NDArray[np.int64], map: TopologicalMap) -> tuple[Array, Array]:
    """Of each tick the belief in a place (N,), and in it with all places that are linked with it; NaN where unknown."""
    linked = links_between(map.links, len(map)) <= 1
    alone = np.where(nearest >= 0, shares[np.arange(len(shares)), nearest], np.nan)
    return alone, np.where(nearest >= 0, (shares * linked[nearest]).sum(axis=1), np.nan)


def binned(shares: Array, columns: int) -> Array:
    """The largest of neighbouring ticks, so that (N, P) becomes at most (columns, P)."""
    if len(shares) <= columns:
        return shares
    edges = np.linspace(0, len(shares), columns + 1).astype(np.int64)[:-1]
    fewer: Array = np.fmax.reduceat(shares, edges, axis=0)
    return fewer


def _draw(seconds: Array, shares: Array, nearest: npt.NDArray[np.int64], map: TopologicalMap) -> bytes:
    from matplotlib.colors import LinearSegmentedColormap, PowerNorm

    step = float(np.median(np.diff(seconds))) if len(seconds) > 1 else 1.0
    height = float(np.clip(0.09 * len(map) + 0.8, 2.2, 5.0))
    with plot(9.5, height + 2.0) as drawn:
        upper, lower = drawn.canvas.subplots(2, 1, sharex=True, height_ratios=[height, 1.5])
        shades = LinearSegmentedColormap.from_list("belief", ["#ffffff", PARTICLE, "#4a1536"])
        dark = shades.with_extremes(bad="#eceef1")
        extent = (float(seconds[0]), float(seconds[-1]) + step, -0.5, len(map) - 0.5)
        image = upper.imshow(
            binned(shares, COLUMNS).T,
            extent=extent,
            origin="lower",
            aspect="auto",
            interpolation="nearest",
            cmap=dark,
            norm=PowerNorm(0.5, 0.0, 1.0),
        )
        known = np.where(nearest >= 0, nearest, np.nan)
        if np.isfinite(known).any():
            middle = seconds + step / 2
            upper.plot(middle, known, "_", color=MARK, markersize=5, markeredgewidth=2, label="truly nearest place")
            upper.legend(loc="upper right", bbox_to_anchor=(1.0, 1.12))
        upper.set_ylabel("place")
        upper.grid(visible=False)
        drawn.canvas.colorbar(image, ax=upper, label="probability", fraction=0.04, pad=0.01)
        alone, around = with_neighbours(shares, nearest, map)
        lower.plot(seconds, shares.max(axis=1), color=ESTIMATE, linewidth=1.2, label="most probable")
        if np.isfinite(alone).any():
            lower.plot(seconds, around, color=ODOMETRY, linewidth=1.0, label="truly nearest, with its neighbours")
            lower.plot(seconds, alone, color=MARK, linewidth=1.2, label="truly nearest")
        lower.set_ylim(-0.03, 1.05)
        lower.set_ylabel("probability")
        lower.set_xlabel("time since the log's first frame (s)")
        lower.axhline(1 / len(map), color=TRUTH, linewidth=0.6, linestyle=":")
        drawn.canvas.legend(*lower.get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return drawn.content
