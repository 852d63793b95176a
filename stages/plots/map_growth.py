"""Plots how a map of views grew and forgot."""

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Context, Figure, FigureStage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.values.drive import Drive
from omninav.stages.values.view_mixtures import ViewEvent

from .drawing import ESTIMATE, MARK, ODOMETRY, REFERENCE

BINS = 80


class MapGrowth(FigureStage):
    """Plots references and components over the frames of all logs, with references added and removed.

    Gives nothing where nothing was ever learned.
    """

    on_request = True

    def step(
        self,
        ctx: Context,
        drive: Drive,
        events: Sequence[ViewEvent | None],
        after_last: ViewEvent | None = None,
    ) -> FigureStage.Out:
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
        return self.Out(
            figure=Figure(
                name="map_growth",
                title="Map size over time",
                caption=f"{came.sum()} references were added, {went.sum()} removed"
                f"{f' ({counted})' if counted else ''}; "
                f"{found[-1].views} with {found[-1].components} components are left. Below: how many were added and "
                f"removed per {_width(len(drive))} frames, at the time of learning, which is after they were seen. "
                "Dotted lines: a new log begins.",
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
        )


def _width(frames: int) -> int:
    return max(1, -(-frames // BINS))


def _draw(
    frames: int,
    starts: Sequence[int],
    at: npt.NDArray[np.int64],
    views: npt.NDArray[np.int64],
    components: npt.NDArray[np.int64],
    came: npt.NDArray[np.int64],
    went: npt.NDArray[np.int64],
) -> bytes:
    width = _width(frames)
    edges = np.arange(0, frames + width, width)
    with plot(8.0, 4.4) as drawn:
        upper, lower = drawn.canvas.subplots(2, 1, sharex=True, height_ratios=(3, 2))
        upper.step(at, components, where="post", color=REFERENCE, linewidth=1.2, label="components")
        upper.step(at, views, where="post", color=ESTIMATE, linewidth=1.6, label="references")
        upper.set_ylim(bottom=0)
        upper.set_ylabel("in the map")
        upper.legend(loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
        for counts, sign, colour, name in ((came, 1, MARK, "came"), (went, -1, ODOMETRY, "went")):
            heights = np.histogram(at, edges, weights=counts)[0]
            lower.bar(edges[:-1], sign * heights, width, align="edge", color=colour, linewidth=0, label=name)
        lower.axhline(0, color="#999999", linewidth=0.7)
        lower.yaxis.set_major_formatter(lambda value, _: f"{abs(value):g}")
        lower.set_ylabel(f"per {width} frames")
        lower.set_xlabel("frames, all logs one after the other")
        lower.legend(loc="upper right", ncols=2)
        for axes in (upper, lower):
            for start in starts[1:]:
                axes.axvline(start, color="#999999", linewidth=0.9, linestyle=":")
        lower.set_xlim(0, max(frames - 1, 1))
    return drawn.content
