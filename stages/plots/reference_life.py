"""Plots the history of one reference: where it was thought to be seen from, and the weight of each place."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Figure, FigureStage
from omninav.pipeline.graph.problems import counted
from omninav.pipeline.report.plot_style import plot
from omninav.stages.values.drive import Drive
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.view_mixtures import MixturesNow, ViewEvent

from .drawing import (
    EDGE,
    REFERENCE,
    TRUTH,
    draw_plan,
    extent_of,
    fitting_height,
    plan_axes,
)

Array = npt.NDArray[np.float64]
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9")


class ReferenceLife(FigureStage):
    """Plots the components of one reference over the frames: their weights, and their places over the plan.

    Components of two frames are the same place where they are nearest to each other. True positions are those of the
    frames at which the reference changed; where map updates come late its view was seen before. Gives nothing where
    that reference never was, or no reference ever changed.
    """

    on_request = True

    name: Annotated[int, Bounds(ge=0)] | None = None
    """Number of the reference. None: the one whose heaviest component moved furthest in sum, which is where wrong
    associations show."""
    same_m: Annotated[float, Bounds(gt=0)] = 1.0
    """Largest distance (m) between components of two frames that are the same place."""

    def step(
        self,
        ctx: Context,
        drive: Drive,
        events: Sequence[ViewEvent | None],
        mixtures: Sequence[MixturesNow | None],
        plan: FloorPlan | None = None,
    ) -> FigureStage.Out:
        """The whole run at once."""
        name = farthest_moved(events) if self.name is None else self.name
        if name is None:
            return self.Out()
        snapshots: list[Snapshot] = []
        seen = []
        path = drive.truth[:, :2]
        for row, now in enumerate(mixtures):
            if now is not None and (mine := now.ids == name).any():
                snapshots.append((row, now.means[mine, :2].astype(np.float64), now.weights[mine].astype(np.float64)))
                seen.append(row)
        if not snapshots:
            return self.Out()
        gone = next((row for row, event in enumerate(events) if event is not None and name in event.removed), None)
        lives = lives_of(snapshots, self.same_m)
        ended = f"it was removed in frame {gone}" if gone is not None else "it was in the map to the end"
        return self.Out(
            figure=Figure(
                name="reference_life",
                title="History of a reference",
                caption=f"Reference {name} was added in frame {snapshots[0][0]} and changed in "
                f"{counted(len(snapshots), 'frame')}; {ended}. It was kept at {counted(len(lives), 'place')}, each in "
                f"one colour in both plots{'; grey: all but the heaviest six' if len(lives) > len(COLOURS) else ''}. "
                "Right: larger dots weigh more, circles are last places, crosses the true positions at these frames "
                "(a map that learns with delay changes a little after the view was seen).",
                content=_draw(lives, path, np.array(seen), plan, gone),
                order=16,
            )
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

    From snapshot to snapshot the closest pair is taken for one place first, none that is further apart than `same_m`.
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
    seen: npt.NDArray[np.int64],
    plan: FloorPlan | None,
    gone: int | None,
) -> bytes:
    extent = extent_of(path, *(life[:, 1:3] for life in lives), margin=0.08)
    with plot(9.0, fitting_height(extent, 4.6, 3.0, 6.0)) as drawn:
        left, right = drawn.canvas.subplots(1, 2)
        draw_plan(right, plan)
        right.plot(*path.T, color=EDGE, linewidth=0.8, zorder=1)
        true = path[seen][np.isfinite(path[seen]).all(axis=1)]
        right.plot(*true.T, "x", color=TRUTH, markersize=5, markeredgewidth=1.0, zorder=5, label="true positions")
        for number, life in enumerate(lives):
            colour = COLOURS[number] if number < len(COLOURS) else REFERENCE
            frame, x, y, weight = life.T
            left.step(frame, weight, where="post", color=colour, linewidth=1.2)
            left.plot(frame, weight, ".", color=colour, markersize=3)
            right.plot(x, y, color=colour, linewidth=0.8, alpha=0.6, zorder=3)
            right.scatter(x, y, s=4 + 36 * np.clip(weight, 0, 1), color=colour, alpha=0.5, linewidths=0, zorder=3)
            right.plot(x[-1:], y[-1:], "o", markerfacecolor="none", color=colour, markersize=9, zorder=4)
        if gone is not None:
            left.axvline(gone, color="#999999", linewidth=1.0, linestyle=":", label="removed")
            left.legend(loc="upper right")
        left.set_ylim(bottom=0)
        left.set_ylabel("weight")
        left.set_xlabel("frames, all logs one after the other")
        plan_axes(right, extent)
        if len(true):
            right.legend(loc="upper right")
    return drawn.content
