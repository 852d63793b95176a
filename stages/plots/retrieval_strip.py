"""Plots retrieved references: a query image, and the most similar ones of the map."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Annotated, NamedTuple

import numpy as np

from omninav.pipeline import Bounds, Context, Figure, Outputs, Stage
from omninav.pipeline.report.plot_style import plot
from omninav.stages.geometry.plane.se2 import wrap
from omninav.stages.values.drive import Array, Drive
from omninav.stages.values.image import Pixels
from omninav.stages.values.maps import ReferenceGraph
from omninav.stages.values.similarity import Answers
from omninav.stages.values.thumbnails import Thumbnails, decoded

from .drawing import EDGE, MARK, ODOMETRY, TRUTH
from .panorama_snapshot import EncodedPanorama
from .snapshot_times import spread_out

if TYPE_CHECKING:
    from matplotlib.axes import Axes

NEAR_M, NEAR_DEG = 2.0, 35.0
"""Distance and angle from the true pose within which an answer is right, as a run's estimate is (section VI-D)."""

WIDTH, LINE = 10.0, 0.17
"""Inches: of the page, and of a line of text."""


class Query(NamedTuple):
    """A query: its frame, what the robot saw, what the database answered, where the robot truly was."""

    frame: int
    seen: EncodedPanorama
    answers: Answers
    truth: Array


class RetrievalStrip(Stage):
    """Plots queries of a few frames of the last log, and under each the most similar references.

    Wolf, Burgard & Burkhardt 2005, figures 2 and 5. Without `thumbnails` the references' poses stand in their places.
    """

    on_request = True

    frames: Annotated[int, Bounds(ge=1, le=8)] = 3
    """Number of queries."""

    class Out(Outputs):
        """`figure`: a query per frame."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        snapshots: Sequence[EncodedPanorama | None],
        answers: Sequence[Answers | None],
        map: ReferenceGraph,
        thumbnails: Thumbnails | None = None,
    ) -> Out:
        """The whole run at once."""
        last = drive.last_log
        queries = [
            Query(frame, seen, found, true)
            for frame, row, true in zip(last.frames.tolist(), last.row.tolist(), last.truth, strict=True)
            if (seen := snapshots[row]) is not None and (found := answers[row]) is not None
        ]
        if not queries:
            return self.Out()
        chosen = [queries[n] for n in spread_out(len(queries), self.frames)]
        illustrated = thumbnails is not None and len(thumbnails) == len(map)
        return self.Out(
            figure=Figure(
                name="retrieval_strip",
                title="Retrieved references",
                caption="Query images of the drive, and below each the most similar references, best first, with their "
                "similarity and, where the truth is known, the error of the pose that each means (green: within "
                f"{NEAR_M:g} m and {NEAR_DEG:g}°)."
                + ("" if illustrated else " Without thumbnails of the references their poses are shown."),
                content=_draw(chosen, map, thumbnails, illustrated),
                media_type="image/jpeg",
                order=42,
            )
        )


def _draw(queries: Sequence[Query], map: ReferenceGraph, thumbnails: Thumbnails | None, illustrated: bool) -> bytes:
    asked = [decoded(query.seen.jpeg) for query in queries]
    windows = len(queries[0].seen.headings)
    shape = asked[0].shape[0] / asked[0].shape[1] * max(windows, 1)
    across = 3 if shape < 0.4 else 9
    cell = WIDTH / across  # inches
    lines = -(-max(len(query.answers.references) for query in queries) // across)
    row = cell * (shape if illustrated else 0.0) + (2.3 if illustrated else 3.4) * LINE
    block = cell * shape + 1.5 * LINE + lines * row + 1.5 * LINE
    with plot(WIDTH, block * len(queries), media_type="image/jpeg") as drawn:
        axes = drawn.canvas.add_subplot(1, 1, 1)
        for number, (query, pixels) in enumerate(zip(queries, asked, strict=True)):
            top = -number * block
            _title(axes, f"frame {query.frame}: the query", 0.02, top - LINE)
            below = top - 1.5 * LINE
            wide = cell * max(windows, 1)
            _show(axes, pixels, 0.02, below, wide - 0.04, cell * shape - 0.02)
            for n, reference in enumerate(query.answers.references.tolist()):
                left, high = cell * (n % across) + 0.02, below - cell * shape - (n // across) * row - 0.03
                if illustrated and thumbnails is not None:
                    kept = thumbnails.image(reference)
                    if not windows:  # turned as it is most similar
                        kept = np.roll(kept, round(query.answers.turns[n] / (2 * np.pi) * kept.shape[1]), axis=1)
                    _show(axes, kept, left, high, cell - 0.04, cell * shape - 0.04)
                    high -= cell * shape - 0.03
                _label(axes, query, map, n, left, high, illustrated)
        axes.set_xlim(0.0, WIDTH)
        axes.set_ylim(-block * len(queries), 0.0)
        axes.set_axis_off()
    return drawn.content


def _show(axes: "Axes", pixels: Pixels, left: float, top: float, width: float, height: float) -> None:
    extent = (left, left + width, top - height, top)
    axes.imshow(pixels[:, :, ::-1], extent=extent, aspect="auto", interpolation="antialiased")


def _title(axes: "Axes", text: str, left: float, top: float) -> None:
    axes.text(left, top, text, fontsize=9, va="bottom", color=TRUTH, fontweight="bold")


def _label(axes: "Axes", query: Query, map: ReferenceGraph, n: int, left: float, top: float, illustrated: bool) -> None:
    x, y, heading = map.poses[query.answers.references[n]]
    words, colour = [f"{100 * query.answers.similarities[n]:.1f} %"], TRUTH
    if not illustrated:
        words.append(f"({x:.1f}, {y:.1f}) m {np.degrees(wrap(heading)):.0f}°")
    if np.isfinite(query.truth).all():
        apart = float(np.hypot(*(map.poses[query.answers.references[n]] - query.truth)[:2]))
        turned = abs(np.degrees(float(wrap(heading + query.answers.turns[n] - query.truth[2]))))
        words.append(f"{apart:.1f} m, {turned:.0f}°")
        colour = MARK if apart <= NEAR_M and turned <= NEAR_DEG else ODOMETRY
    if not illustrated:
        axes.plot([left, left], [top - len(words) * LINE, top], color=EDGE, linewidth=1)
    axes.text(left + 0.02, top, "\n".join(words), fontsize=7.5, va="top", color=colour, linespacing=1.1)
