"""Plots the belief in every place of a topological map over time."""

from collections.abc import Sequence

import numpy as np

from omninav.pipeline import Context, PlotStage
from omninav.pipeline.report.chart import Chart, Colour, stacked
from omninav.stages.geometry.appearance.place_graph import links_between
from omninav.stages.geometry.arrays import Array, Ints
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.drive import Drive
from omninav.stages.values.drive import known as poses_known
from omninav.stages.values.topological_map import TopologicalMap

from .plan_chart import tinted

PINK = (154, 96, 195)
"""Blue-green-red."""
COLUMNS = 900
"""Most columns of the plot; where more than one tick is in a column, the largest belief is shown."""


class PlaceBeliefOverTime(PlotStage):
    """Plots the belief in every place over time, darker where more probable, with the truly nearest place.

    Of the last log. Below it: the belief's share of its maximum, of the truly nearest place, and of that together with
    its neighbours. Gives nothing where nothing was believed.
    """

    def step(
        self,
        ctx: Context,
        drive: Drive,
        beliefs: Sequence[PlaceBelief | None],
        map: TopologicalMap,
    ) -> PlotStage.Out:
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
        return self.drawn(
            name="place_belief",
            title="Belief over places",
            caption=f"Above: the probability of each of {len(map)} places, darker where it is higher.{truly}"
            f"{right} Below: the probability of the most probable place, and of the truly nearest one, alone and "
            "with the places linked to it.",
            content=_draw(last.seconds, shares, nearest, map),
            order=28,
        )


def with_neighbours(shares: Array, nearest: Ints, map: TopologicalMap) -> tuple[Array, Array]:
    """Belief of each tick in a place (N,), and in it with all places that are linked with it; NaN where unknown."""
    linked = links_between(map.links, len(map)) <= 1
    alone = np.where(nearest >= 0, shares[np.arange(len(shares)), nearest], np.nan)
    return alone, np.where(nearest >= 0, (shares * linked[nearest]).sum(axis=1), np.nan)


def binned(shares: Array, seconds: Array, edges: Array, step: float) -> Array:
    """The largest share (C, P) of the ticks (N, P) between each two of the edges (C + 1,), all in seconds.

    Where no tick is, the one before is repeated for two steps; NaN further on.
    """
    first = np.searchsorted(seconds, edges[:-1])
    largest: Array = np.fmax.reduceat(np.append(shares, np.full((1, shares.shape[1]), np.nan), axis=0), first, axis=0)
    empty = np.flatnonzero(first == np.searchsorted(seconds, edges[1:]))
    before = first[empty] - 1
    largest[empty] = np.where((edges[empty] - seconds[before] > 2 * step)[:, None], np.nan, shares[before])
    return largest


def _draw(seconds: Array, shares: Array, nearest: Ints, map: TopologicalMap) -> bytes:
    step = float(np.median(np.diff(seconds))) if len(seconds) > 1 else 1.0
    time, middle = (float(seconds[0]), float(seconds[-1]) + step), seconds + step / 2
    upper = Chart(time, (-0.5, len(map) - 0.5), "time (s)", "place", height=(float(np.clip(5 * len(map), 150, 320)), 0))
    edges = np.linspace(*time, min(COLUMNS, round((time[1] - time[0]) / step)) + 1)
    opacity = np.round(255 * np.sqrt(np.nan_to_num(binned(shares, middle, edges, step)))).astype(np.uint8)
    upper.base.raster(tinted(opacity.T[::-1], PINK), (*time, -0.5, len(map) - 0.5))
    upper.name("belief", "pink", "square")
    if (nearest >= 0).any():
        upper.base.dots(np.column_stack([middle, np.where(nearest >= 0, nearest, np.nan)]), "green", 2.0)
        upper.name("truly nearest place", "green", "dot")
    lower = Chart(time, (0.0, 1.03), "time (s)", "probability", height=(150, 0))
    lower.base.level(1 / len(map), "quiet")
    alone, around = with_neighbours(shares, nearest, map)
    shown: list[tuple[Array, Colour, str]] = [(shares.max(axis=1), "blue", "most probable")]
    if np.isfinite(alone).any():
        shown += [(around, "orange", "truly nearest and neighbours"), (alone, "green", "truly nearest")]
    for probable, colour, name in shown:
        lower.base.line(np.column_stack([middle, probable]), colour, 1.5)
        lower.name(name, colour)
    return stacked([upper, lower])
