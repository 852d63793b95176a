"""Draws the frames of a drive's video: what the robot saw and tracked, where it was, its belief, and its route."""

import math
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, NamedTuple, overload

import cv2
import numpy as np
import numpy.typing as npt

from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.homing import DrivingStatus, PathProgress
from omninav.stages.values.image import Pixels
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.thumbnails import decoded
from omninav.stages.values.topological_map import TopologicalMap

from .draw_homing import (
    BRIGHT,
    DARK,
    LOST,
    NAMES,
    VECTOR,
    Colour,
    arrow_head,
    disc,
    draw_robot_view,
    draw_target_view,
    is_known,
    polyline,
)
from .drawing import broken_at_jumps
from .homing_snapshot import EncodedHomingView

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

Array = npt.NDArray[np.float64]

HALF, GAP, LINE = 360, 8, 17
"""Pixels: the width of either half of a frame, between its parts, and of a line of text."""
PAPER: Colour = (255, 255, 255)
STANDING: Colour = (209, 204, 201)
LINK: Colour = (150, 143, 138)
PATH: Colour = (178, 114, 0)
ROUTE: Colour = (115, 158, 0)
BELIEF: Colour = (167, 121, 204)
QUIET: Colour = (115, 103, 92)
"""Blue-green-red, as in `drawing`."""


class FrameState(NamedTuple):
    """All that a frame shows. `row`: its tick. `seconds`: since the drive began. `pose`, `goal` (3,): m, m, rad."""

    row: int
    seconds: float
    snapshot: EncodedHomingView
    target: Pixels | None
    pose: Array
    goal: Array
    belief: PlaceBelief | None
    route: PlannedRoute | None
    progress: PathProgress | None
    status: DrivingStatus | None


class Window:
    """Part of the plan on part of a frame: metres to pixels, x to the right and y up, as large as fits."""

    def __init__(self, left: float, top: float, width: float, height: float, extent: tuple[float, ...]) -> None:
        low_x, high_x, low_y, high_y = extent
        self.scale = min(width / (high_x - low_x), height / (high_y - low_y))
        self.middle = left + width / 2, top + height / 2
        self.about = (low_x + high_x) / 2, (low_y + high_y) / 2

    def __call__(self, points: npt.ArrayLike) -> Array:
        """Pixels (N, 2) of points (N, 2 or more)."""
        there = (np.asarray(points, np.float64)[..., :2] - self.about) * (self.scale, -self.scale)
        return there + self.middle


class VideoFrames(Sequence[Pixels]):
    """The frames of a video, drawn when they are read."""

    def __init__(
        self,
        states: Sequence[FrameState],
        path: Array,
        plan: FloorPlan | None,
        map: TopologicalMap | None,
        around: float,
    ) -> None:
        self.states, self.path, self.plan, self.map, self.around = states, path, plan, map, around
        columns, rows = states[0].snapshot.size
        self.view = HALF, min(round(HALF * rows / columns), HALF)
        strip = columns > 2.5 * rows
        self.target = self.view if strip else (self.view[0] // 2, self.view[1] // 2)
        below = 2 * GAP + LINE + self.target[1] + (8 * LINE if strip else 0)
        self.height = max(self.view[1] + below, HALF) // 2 * 2
        spots = [path[:, :2], np.empty((0, 2)) if map is None else map.poses[:, :2]]
        if plan is not None:
            spots = [np.array([(0.0, 0.0), (plan.width, plan.depth)])]
        known = np.concatenate(spots)
        known = known[np.isfinite(known).all(axis=1)]
        low, high = (known.min(axis=0), known.max(axis=0)) if len(known) else (np.zeros(2), np.ones(2))
        self.extent = float(low[0]) - 0.3, float(high[0]) + 0.3, float(low[1]) - 0.3, float(high[1]) + 0.3
        share = (self.extent[3] - self.extent[2]) / (self.extent[1] - self.extent[0])
        self.plan_height = min(round(HALF * share), round(0.55 * self.height))
        self._ground: Pixels | None = None

    def __len__(self) -> int:
        return len(self.states)

    @overload
    def __getitem__(self, index: int) -> Pixels: ...

    @overload
    def __getitem__(self, index: slice) -> list[Pixels]: ...

    def __getitem__(self, index: int | slice) -> Pixels | list[Pixels]:
        """One frame, or some: (rows, columns, 3)."""
        if isinstance(index, slice):
            return [self._drawn(state) for state in self.states[index]]
        return self._drawn(self.states[index])

    def _drawn(self, state: FrameState) -> Pixels:
        frame = np.full((self.height, 2 * HALF + GAP, 3), 255, np.uint8)
        width, high = self.view
        seen = np.asarray(cv2.resize(decoded(state.snapshot.jpeg), self.view, interpolation=cv2.INTER_AREA), np.uint8)
        frame[:high, :width] = draw_robot_view(seen, state.snapshot)
        top = high + GAP + LINE
        texts: list[tuple[float, float, str, Colour]] = []
        if state.snapshot.target_points.size:
            columns, rows = self.target
            frame[top : top + rows, :columns] = draw_target_view(state.target, state.snapshot, self.target)
            texts.append((4, high + GAP - 2, f"going to: {state.snapshot.target or 'the view'}", DARK))
        strip = self.target == self.view
        left, first = (4, top + self.target[1] + 4) if strip else (self.target[0] + 12, top - 2)
        texts += [(left, first + n * LINE, text, colour) for n, (text, colour) in enumerate(_texts(state))]
        self._draw_whole(frame, state)
        self._draw_around(frame, state)
        return with_texts(frame, texts)

    def _draw_whole(self, frame: Pixels, state: FrameState) -> None:
        window = Window(HALF + GAP, 0, HALF, self.plan_height, self.extent)
        part = frame[: self.plan_height, HALF + GAP :]
        if self._ground is None:
            self._draw_ground(frame, window, 1)
            self._ground = part.copy()
        part[:] = self._ground
        self._draw_belief_and_route(frame, window, state, 3)
        _draw_path(frame, window, self.path[: state.row + 1], 2)
        _draw_robot(frame, window, state.pose, 9.0)

    def _draw_around(self, frame: Pixels, state: FrameState) -> None:
        top = self.plan_height + GAP
        part = frame[top:, HALF + GAP :]
        if not np.isfinite(state.pose).all():
            return
        rows, columns = part.shape[:2]
        x, y = state.pose[:2]
        reach = self.around, self.around * columns / rows
        window = Window(HALF + GAP, top, columns, rows, (x - reach[1], x + reach[1], y - reach[0], y + reach[0]))
        canvas = frame.copy()
        canvas[top:, HALF + GAP :] = 255
        self._draw_ground(canvas, window, 2)
        self._draw_belief_and_route(canvas, window, state, 5)
        _draw_path(canvas, window, self.path[: state.row + 1], 2)
        if np.isfinite(state.goal).all():
            (spot,) = window(state.goal[None])
            disc(canvas, tuple(spot), 9.0, DARK, 4)
            disc(canvas, tuple(spot), 9.0, VECTOR, 2)
        _draw_robot(canvas, window, state.pose, 13.0)
        vector = state.snapshot.vector
        if vector is not None and is_known(vector):
            towards, length = state.pose[2] + vector.direction, 1.0 if vector.metres is None else vector.metres
            tip = state.pose[:2] + length * np.array([math.cos(towards), math.sin(towards)])
            line = window(np.stack([state.pose[:2], tip]))
            colour = BRIGHT[LOST] if vector.state == "lost" else VECTOR
            polyline(canvas, line, colour, 3)
            arrow_head(canvas, line[1], line[1] - line[0], colour, 11.0)
        part[:] = canvas[top:, HALF + GAP :]
        cv2.rectangle(frame, (HALF + GAP, top), (HALF + GAP + columns - 1, top + rows - 1), STANDING, 1)
        meter = round(window.scale)
        corner = (HALF + GAP + 12, top + rows - 12)
        cv2.line(frame, corner, (corner[0] + meter, corner[1]), DARK, 2)

    def _draw_ground(self, frame: Pixels, window: Window, thickness: int) -> None:
        """What stands on the floor, and the map's links along their images."""
        for outline in () if self.plan is None else self.plan.outlines:
            cv2.fillPoly(frame, [np.round(window(outline) * 16).astype(np.int32)], STANDING, cv2.LINE_AA, 4)
        if self.map is None:
            return
        for link, (one, other) in enumerate(self.map.links):
            views = [int(self.map.places[one]), *self.map.path_of(link).tolist(), int(self.map.places[other])]
            polyline(frame, window(self.map.poses[views]), LINK, thickness)
        if thickness > 1:
            for spot in window(self.map.poses):
                disc(frame, tuple(spot), 2.0, LINK)

    def _draw_belief_and_route(self, frame: Pixels, window: Window, state: FrameState, thickness: int) -> None:
        if self.map is None:
            return
        if state.route is not None and len(state.route.places):
            views, _ = self.map.views_along(state.route.places)
            polyline(frame, window(self.map.poses[views]), ROUTE, thickness)
            (end,) = window(self.map.poses[views[-1:]])
            disc(frame, tuple(end), 4.0 + thickness, ROUTE, 3)
        size = 1.5 + thickness / 2
        for place, spot in enumerate(window(self.map.poses[self.map.places])):
            disc(frame, tuple(spot), size, LINK)
            if state.belief is not None:
                share = float(state.belief.probabilities[place])
                if share > 0.01:
                    disc(frame, tuple(spot), size + 2.5 * thickness * math.sqrt(share), BELIEF)


def _draw_path(frame: Pixels, window: Window, path: Array, thickness: int) -> None:
    points = broken_at_jumps(path)
    gaps = np.flatnonzero(~np.isfinite(points).all(axis=1))
    for part in np.split(points, gaps):
        part = part[np.isfinite(part).all(axis=1)]
        if len(part) > 1:
            polyline(frame, window(part), PATH, thickness)


def _draw_robot(frame: Pixels, window: Window, pose: Array, size: float) -> None:
    if np.isfinite(pose).all():
        (spot,) = window(pose[None])
        arrow_head(frame, spot, np.array([math.cos(pose[2]), -math.sin(pose[2])]), PAPER, size + 4)
        arrow_head(frame, spot, np.array([math.cos(pose[2]), -math.sin(pose[2])]), DARK, size)


def _texts(state: FrameState) -> list[tuple[str, Colour]]:
    """The state of the drive, line by line."""
    lines = [(f"{state.seconds:.1f} s", DARK)]
    if state.belief is not None:
        place = int(np.argmax(state.belief.probabilities))
        lines.append((f"believed: place {place}, {100 * float(state.belief.probabilities[place]):.0f} %", DARK))
    if state.route is not None:
        goal = f", goal: place {int(state.route.places[-1])}" if len(state.route.places) else ""
        lines.append((f"{state.route.state}{goal}", DARK))
    if state.progress is not None:
        lines.append((f"views reached: {state.progress.at} of {state.progress.of}", DARK))
    if state.status is not None:
        lines.append((f"driving: {state.status.state}", DARK))
    vector, kinds = state.snapshot.vector, state.snapshot.kinds
    if vector is not None:
        far = f"{100 * vector.ratio:.0f} % left" if vector.metres is None else f"{vector.metres:.2f} m away"
        lines.append(("homing: the target is lost" if vector.state == "lost" else f"homing: {far}", DARK))
        counted = [f"{int(np.count_nonzero(kinds == kind))} {name}" for kind, name in NAMES.items()]
        lines += [(", ".join(counted[:2]), QUIET), (", ".join(counted[2:]), QUIET)]
    return lines


def with_texts(frame: Pixels, texts: Sequence[tuple[float, float, str, Colour]]) -> Pixels:
    """A frame with texts (left, top, text, colour) on it."""
    from PIL import Image as PillowImage  # comes with matplotlib
    from PIL import ImageDraw

    page = PillowImage.fromarray(frame[:, :, ::-1])
    pen = ImageDraw.Draw(page)
    for left, top, text, colour in texts:
        pen.text((left, top), text, font=_font(12), fill=colour[::-1])
    return np.ascontiguousarray(np.asarray(page, np.uint8)[:, :, ::-1])


@cache
def _font(size: int) -> "FreeTypeFont":
    import matplotlib
    from PIL import ImageFont

    return ImageFont.truetype(f"{matplotlib.get_data_path()}/fonts/ttf/DejaVuSans.ttf", size)
