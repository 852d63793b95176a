"""Plots how a map of views grew and forgot."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, PlotStage
from omninav.pipeline.report.chart import Chart, Colour, stacked, steps
from omninav.stages.geometry.arrays import Ints
from omninav.stages.values.drive import Drive
from omninav.stages.values.view_mixtures import ViewEvent

Named = tuple[npt.NDArray[Any], Colour, str]
BINS = 80
X_LABEL = "frames, all logs one after the other"


class MapGrowth(PlotStage):
    """Plots references and components over the frames of all logs, with references added and removed.

    Gives nothing where nothing was ever learned.
    """

    needs_all_plots = True

    def step(
        self,
        ctx: Context,
        drive: Drive,
        events: Sequence[ViewEvent | None],
        after_last: ViewEvent | None = None,
    ) -> PlotStage.Out:
        """The whole run at once. `after_last`: what was learned once the last log had ended, counted to its end."""
        rows = [row for row, event in enumerate(events) if event is not None]
        found = [event for event in events if event is not None]
        if after_last is not None and len(events):
            rows.append(len(events) - 1)
            found.append(after_last)
        if not found:
            return self.Out()
        at = np.array(rows)
        came = np.array([len(event.inserted) for event in found])
        went = np.array([len(event.removed) for event in found])
        starts = [int(log.row[0]) for log in drive.by_log]
        reasons = {why: sum(len(e.removed) for e in found if e.why == why) for why in ("forgotten", "merged", "full")}
        counted = ", ".join(f"{number} {why}" for why, number in reasons.items() if number)
        return self.drawn(
            name="map_growth",
            title="Map size over time",
            caption=f"{came.sum()} references were added, {went.sum()} removed"
            f"{f' ({counted})' if counted else ''}; "
            f"{found[-1].views} with {found[-1].components} components are left. Below: how many were added and "
            f"removed per {_width(len(drive))} frames, at the time of learning, which is after they were seen. "
            "Upright lines: a new log begins.",
            content=_draw(
                len(drive),
                starts,
                at,
                np.array([event.views for event in found]),
                np.array([event.components for event in found]),
                came,
                went,
            ),
            order=14,
        )


def _width(frames: int) -> int:
    return max(1, -(-frames // BINS))


def _draw(frames: int, starts: Sequence[int], at: Ints, views: Ints, components: Ints, came: Ints, went: Ints) -> bytes:
    span, width = (0.0, float(max(frames - 1, 1))), _width(frames)
    edges = np.arange(0, frames + width, width)
    added, removed = (np.histogram(at, edges, weights=counts)[0] for counts in (came, went))
    size = Chart(span, (0.0, 1.05 * max(int(components.max()), 1)), "", "in the map")
    low, high = -float(removed.max()), float(added.max())
    pad = 0.04 * (high - low) or 0.5
    change = Chart(span, (low - pad, high + pad), X_LABEL, f"per {width} frames")
    held: tuple[Named, ...] = ((components, "grey", "components"), (views, "blue", "references"))
    moved: tuple[Named, ...] = ((added, "green", "added"), (-removed, "orange", "removed"))
    for counts, colour, name in held:
        size.base.line(steps(np.append(at, frames - 1), counts), colour, 1.6)
        size.name(name, colour)
    for heights, colour, name in moved:
        change.base.line(steps(edges, heights), colour, 1.6)
        change.name(name, colour)
    change.base.level(0.0, "grey")
    for chart in (size, change):
        for start in starts[1:]:
            chart.base.upright(start, "line")
    return stacked([size, change])
