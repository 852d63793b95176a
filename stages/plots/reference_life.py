"""Plots the history of one reference: where it was thought to be seen from, and the weight of each place."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np

from omninav.pipeline import Bounds, Context, PlotStage, counted
from omninav.pipeline.report.chart import Chart, Colour, stacked, steps
from omninav.stages.geometry.arrays import Array
from omninav.stages.values.drive import Drive
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.view_mixtures import MixturesNow, ViewEvent

from .drawing import extent_of
from .map_growth import X_LABEL
from .plan_chart import draw_surroundings, plan_chart

COLOURS: tuple[Colour, ...] = ("blue", "orange", "green", "pink")
SAME_M = 1.0
"""Largest distance between components of two frames that are the same place, metres."""


class ReferenceLife(PlotStage):
    """Plots the components of one reference over the frames: their weights, and their places over the plan.

    Components of two frames are the same place where they are nearest to each other. True positions are those of the
    frames at which the reference changed; where map updates come late its view was seen before. Gives nothing where
    that reference never was, or no reference ever changed.
    """

    needs_all_plots = True

    name: Annotated[int, Bounds(ge=0)] | None = None
    """Number of the reference. None: the one whose heaviest component moved furthest in sum, which is where wrong
    associations show."""

    def step(
        self,
        ctx: Context,
        drive: Drive,
        events: Sequence[ViewEvent | None],
        mixtures: Sequence[MixturesNow | None],
        plan: FloorPlan | None = None,
    ) -> PlotStage.Out:
        name = farthest_moved(events) if self.name is None else self.name
        if name is None:
            return self.Out()
        snapshots: list[Snapshot] = []
        for row, now in enumerate(mixtures):
            if now is not None and (mine := now.ids == name).any():
                snapshots.append((row, now.means[mine, :2].astype(np.float64), now.weights[mine].astype(np.float64)))
        if not snapshots:
            return self.Out()
        gone = next((row for row, event in enumerate(events) if event is not None and name in event.removed), None)
        lives = lives_of(snapshots, SAME_M)
        ended = f"it was removed in frame {gone}" if gone is not None else "it was in the map to the end"
        return self.drawn(
            name="reference_life",
            title="History of a reference",
            caption=f"Reference {name} was added in frame {snapshots[0][0]} and changed in "
            f"{counted(len(snapshots), 'frame')}; {ended}. It was kept at {counted(len(lives), 'place')}, each in "
            f"one colour in both plots{'; grey: all but the heaviest four' if len(lives) > len(COLOURS) else ''}. "
            "Below: larger dots weigh more, circles are last places, crosses the true positions at these frames "
            "(a map that learns with delay changes a little after the view was seen).",
            content=_draw(lives, drive.truth[:, :2], [row for row, _, _ in snapshots], plan, gone, len(drive)),
            order=16,
        )


Snapshot = tuple[int, Array, Array]
"""A frame, and the places (K, 2) and weights (K,) of a reference's components after it."""


def farthest_moved(events: Sequence[ViewEvent | None]) -> int | None:
    """The reference whose heaviest component moved furthest in sum; of equals the one that changed more often."""
    last: dict[int, Array] = {}
    moved: dict[int, tuple[float, int]] = {}
    for event in events:
        if event is None:
            continue
        for name, place, parts in zip(event.changed.tolist(), event.places, event.parts.tolist(), strict=True):
            if parts:
                distance, times = moved.get(name, (0.0, 0))
                moved[name] = (distance + float(np.hypot(*(place - last.get(name, place)))), times + 1)
                last[name] = place
    return max(moved, key=lambda name: (*moved[name], -name)) if moved else None


def lives_of(snapshots: Sequence[Snapshot], same_m: float) -> list[Array]:
    """Each place over the snapshots: (n, 4) frame, x, y, weight; the one that weighed most comes first.

    From snapshot to snapshot the closest pair is identified first, none that is further apart than `same_m`.
    """
    done: list[list[tuple[float, ...]]] = []
    alive: list[list[tuple[float, ...]]] = []
    for frame, places, weights in snapshots:
        rows = [(float(frame), float(x), float(y), float(w)) for (x, y), w in zip(places, weights, strict=True)]
        before = np.array([life[-1][1:3] for life in alive]).reshape(-1, 2)
        gaps = np.linalg.norm(before[:, None] - places[None], axis=2)
        pairs: dict[int, int] = {}
        for old, new in np.argwhere(gaps <= same_m)[np.argsort(gaps[gaps <= same_m], kind="stable")].tolist():
            if new not in pairs and old not in pairs.values():
                pairs[new] = old
        continued = set(pairs.values())
        done += [life for number, life in enumerate(alive) if number not in continued]
        alive = [[*alive[pairs[n]], row] if n in pairs else [row] for n, row in enumerate(rows)]
    lives = [np.array(life) for life in done + alive]
    return sorted(lives, key=lambda life: (-float(life[:, 3].sum()), float(life[0, 0])))


def _draw(
    lives: Sequence[Array],
    path: Array,
    seen: Sequence[int],
    plan: FloorPlan | None,
    gone: int | None,
    frames: int,
) -> bytes:
    heaviest = max(float(life[:, 3].max()) for life in lives)
    weights = Chart((0.0, float(max(frames - 1, 1))), (0.0, 1.05 * heaviest), X_LABEL, "weight")
    places = plan_chart(extent_of(path, *(life[:, 1:3] for life in lives), margin=0.08))
    draw_surroundings(places, None, None, plan)
    places.base.line(path, "line", 0.8)
    for number, life in enumerate(lives):
        colour: Colour = COLOURS[number] if number < len(COLOURS) else "grey"
        weights.base.line(steps(np.append(life[:, 0], life[-1, 0]), life[:, 3]), colour, 1.2)
        weights.base.dots(life[:, [0, 3]], colour)
        places.base.line(life[:, 1:3], colour, 0.8, opacity=0.6)
        places.base.discs(life[:, 1:3], 2.0 + 4.0 * np.sqrt(np.clip(life[:, 3], 0, 1)), colour, 0.5)
        places.base.ring(life[-1, 1:3], colour)
    places.base.crosses(path[seen], "ink", 3.0)
    places.name("true positions", "ink", "square")
    if gone is not None:
        weights.base.upright(gone, "grey", "removed")
    return stacked([weights, places])
