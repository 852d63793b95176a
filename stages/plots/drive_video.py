"""A drive as a film: what the robot saw and followed, where it was, what it believed, and the way it had planned."""

import math
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Annotated, NamedTuple, overload

import cv2
import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Outputs, Stage
from omninav.pipeline.files import write_whole
from omninav.pipeline.graph.results import Figure
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.drive import Drive
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.homing import DrivingStatus, PathProgress
from omninav.stages.values.image import Pixels
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.thumbnails import Thumbnails, decoded
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
    is_known,
    polyline,
    robots_view,
    targets_view,
)
from .homing_snapshot import HomingGlance
from .snapshot_times import spread_out
from .style import broken_at_jumps
from .target_images import target_of
from .video import encoded

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

Array = npt.NDArray[np.float64]

HALF, GAP, LINE = 360, 8, 17
"""Pixels: the width of either half of a frame, between its parts, and of a line of text."""
PAPER: Colour = (255, 255, 255)
STANDING: Colour = (209, 204, 201)
LINK: Colour = (150, 143, 138)
PATH: Colour = (178, 114, 0)
WAY: Colour = (115, 158, 0)
BELIEF: Colour = (167, 121, 204)
QUIET: Colour = (115, 103, 92)
"""Blue-green-red, as in `style`."""


class FrameState(NamedTuple):
    """All that a frame shows. `row`: its tick. `seconds`: since the drive began. `pose`, `goal` (3,): m, m, rad."""

    row: int
    seconds: float
    glance: HomingGlance
    target: Pixels | None
    pose: Array
    goal: Array
    belief: PlaceBelief | None
    way: PlannedRoute | None
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


class DriveVideo(Stage):
    """Writes `drive.mp4`: a frame for every glance of homing, `per_second` of them a second, at most `frames` in all.

    The robot's picture with the features it follows and the homing vector, the view that it goes to, the plan with its
    path so far, the belief over places, and the way planned; below it the robot's surroundings, and what it does. It
    ends `after_s` seconds after the robot has arrived or given up. Where OpenCV has no encoder for VP9 it is
    `drive.gif`. The same run gives the same bytes.
    """

    per_second: Annotated[float, Bounds(gt=0)] = 8.0
    frames: Annotated[int, Bounds(ge=1)] = 120
    after_s: Annotated[float, Bounds(ge=0)] = 1.5
    around_m: Annotated[float, Bounds(gt=0)] = 2.5

    class Out(Outputs):
        """`figure`: the film for the report; absent where nothing was seen."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        snapshots: Sequence[HomingGlance | None],
        progress: Sequence[PathProgress | None],
        statuses: Sequence[DrivingStatus | None],
        plan: FloorPlan | None = None,
        beliefs: Sequence[PlaceBelief | None] | None = None,
        routes: Sequence[PlannedRoute | None] | None = None,
        map: TopologicalMap | None = None,
        thumbnails: Thumbnails | None = None,
    ) -> Out:
        """The whole run at once."""
        path, stamps = drive.truth, drive.stamps
        last = _last_tick(list(statuses), None if routes is None else list(routes), stamps, round(1e9 * self.after_s))
        there = [row for row, glance in enumerate(snapshots) if glance is not None and row <= last]
        if not there:
            return self.Out()
        scenes = []
        for row in (there[n] for n in spread_out(len(there), self.frames)):
            glance, way = snapshots[row], None if routes is None else routes[row]
            assert glance is not None
            goal, shown = target_of(progress[row], way, map, path[0], thumbnails)
            if glance.vector is None:
                goal = np.full(3, np.nan)
            belief = None if beliefs is None else beliefs[row]
            scenes.append(
                FrameState(
                    row,
                    float(drive.seconds[row]),
                    glance,
                    shown,
                    path[row],
                    goal,
                    belief,
                    way,
                    progress[row],
                    statuses[row],
                )
            )
        frames = VideoFrames(scenes, path, plan, map, self.around_m)
        ctx.doing(f"drawing a film of {len(frames)} frames")
        film = encoded(frames, self.per_second)
        name = f"drive{film.suffix}"
        if ctx.folder is not None:
            write_whole(ctx.folder / name, film.content)
        length = (stamps[scenes[-1].row] - stamps[scenes[0].row]) / 1e9
        faster = length / max(len(scenes) - 1, 1) * self.per_second
        return self.Out(
            figure=Figure(
                name="drive_film",
                title="The drive, frame by frame",
                caption=f"{len(scenes)} frames of the first {length:.0f} s, {faster:.1f} times as fast as it was; also "
                f"in the file {name} beside this page. Left: the robot's picture with the features that it follows "
                "and the homing vector over the floor; below it the view that it goes to. Right: the plan with its "
                "true path (blue), the places as large as they are believed (pink) and the way planned (green); below "
                "it the floor around the robot, with the vector as an arrow and a ring where the target view was truly "
                "taken; the bar is a metre.",
                content=film.content,
                media_type=film.media_type,
                order=3,
                per_second=self.per_second,
            )
        )


def _last_tick(
    statuses: Sequence[DrivingStatus | None],
    ways: Sequence[PlannedRoute | None] | None,
    stamps: npt.NDArray[np.int64],
    after: int,
) -> int:
    """The last tick worth showing: so long (ns) after it arrived or gave up for good."""
    states = [s.state if s else "" for s in statuses] if ways is None else [w.state if w else "" for w in ways]
    end = len(states)
    while end > 0 and states[end - 1] in ("arrived", "gave up"):
        end -= 1
    if end == len(states):
        return len(states) - 1
    return int(np.searchsorted(stamps, stamps[end] + after, side="right")) - 1


class VideoFrames(Sequence[Pixels]):
    """The frames of a film, drawn when they are asked for."""

    def __init__(
        self,
        scenes: Sequence[FrameState],
        path: Array,
        plan: FloorPlan | None,
        map: TopologicalMap | None,
        around: float,
    ) -> None:
        self.scenes, self.path, self.plan, self.map, self.around = scenes, path, plan, map, around
        columns, rows = scenes[0].glance.size
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
        return len(self.scenes)

    @overload
    def __getitem__(self, index: int) -> Pixels: ...

    @overload
    def __getitem__(self, index: slice) -> list[Pixels]: ...

    def __getitem__(self, index: int | slice) -> Pixels | list[Pixels]:
        """One frame, or some: (rows, columns, 3)."""
        if isinstance(index, slice):
            return [self._drawn(scene) for scene in self.scenes[index]]
        return self._drawn(self.scenes[index])

    def _drawn(self, scene: FrameState) -> Pixels:
        frame = np.full((self.height, 2 * HALF + GAP, 3), 255, np.uint8)
        width, high = self.view
        seen = np.asarray(cv2.resize(decoded(scene.glance.jpeg), self.view, interpolation=cv2.INTER_AREA), np.uint8)
        frame[:high, :width] = robots_view(seen, scene.glance)
        top = high + GAP + LINE
        words: list[tuple[float, float, str, Colour]] = []
        if scene.glance.target_points.size:
            columns, rows = self.target
            frame[top : top + rows, :columns] = targets_view(scene.target, scene.glance, self.target)
            words.append((4, high + GAP - 2, f"going to: {scene.glance.target or 'the view'}", DARK))
        strip = self.target == self.view
        left, first = (4, top + self.target[1] + 4) if strip else (self.target[0] + 12, top - 2)
        words += [(left, first + n * LINE, text, colour) for n, (text, colour) in enumerate(_said(scene))]
        self._draw_whole(frame, scene)
        self._draw_around(frame, scene)
        return written(frame, words)

    def _draw_whole(self, frame: Pixels, scene: FrameState) -> None:
        window = Window(HALF + GAP, 0, HALF, self.plan_height, self.extent)
        part = frame[: self.plan_height, HALF + GAP :]
        if self._ground is None:
            self._draw_ground(frame, window, 1)
            self._ground = part.copy()
        part[:] = self._ground
        self._draw_belief_and_way(frame, window, scene, 3)
        _draw_path(frame, window, self.path[: scene.row + 1], 2)
        _draw_robot(frame, window, scene.pose, 9.0)

    def _draw_around(self, frame: Pixels, scene: FrameState) -> None:
        top = self.plan_height + GAP
        part = frame[top:, HALF + GAP :]
        if not np.isfinite(scene.pose).all():
            return
        rows, columns = part.shape[:2]
        x, y = scene.pose[:2]
        reach = self.around, self.around * columns / rows
        window = Window(HALF + GAP, top, columns, rows, (x - reach[1], x + reach[1], y - reach[0], y + reach[0]))
        canvas = frame.copy()
        canvas[top:, HALF + GAP :] = 255
        self._draw_ground(canvas, window, 2)
        self._draw_belief_and_way(canvas, window, scene, 5)
        _draw_path(canvas, window, self.path[: scene.row + 1], 2)
        if np.isfinite(scene.goal).all():
            (spot,) = window(scene.goal[None])
            disc(canvas, tuple(spot), 9.0, DARK, 4)
            disc(canvas, tuple(spot), 9.0, VECTOR, 2)
        _draw_robot(canvas, window, scene.pose, 13.0)
        vector = scene.glance.vector
        if vector is not None and is_known(vector):
            towards, length = scene.pose[2] + vector.direction, 1.0 if vector.metres is None else vector.metres
            tip = scene.pose[:2] + length * np.array([math.cos(towards), math.sin(towards)])
            line = window(np.stack([scene.pose[:2], tip]))
            colour = BRIGHT[LOST] if vector.state == "lost" else VECTOR
            polyline(canvas, line, colour, 3)
            arrow_head(canvas, line[1], line[1] - line[0], colour, 11.0)
        part[:] = canvas[top:, HALF + GAP :]
        cv2.rectangle(frame, (HALF + GAP, top), (HALF + GAP + columns - 1, top + rows - 1), STANDING, 1)
        meter = round(window.scale)
        corner = (HALF + GAP + 12, top + rows - 12)
        cv2.line(frame, corner, (corner[0] + meter, corner[1]), DARK, 2)

    def _draw_ground(self, frame: Pixels, window: Window, thick: int) -> None:
        """What stands on the floor, and the map's links along their pictures."""
        for outline in () if self.plan is None else self.plan.outlines:
            cv2.fillPoly(frame, [np.round(window(outline) * 16).astype(np.int32)], STANDING, cv2.LINE_AA, 4)
        if self.map is None:
            return
        for link, (one, other) in enumerate(self.map.links):
            views = [int(self.map.places[one]), *self.map.way(link).tolist(), int(self.map.places[other])]
            polyline(frame, window(self.map.poses[views]), LINK, thick)
        if thick > 1:
            for spot in window(self.map.poses):
                disc(frame, tuple(spot), 2.0, LINK)

    def _draw_belief_and_way(self, frame: Pixels, window: Window, scene: FrameState, thick: int) -> None:
        if self.map is None:
            return
        if scene.way is not None and len(scene.way.places):
            views, _ = self.map.views_along(scene.way.places)
            polyline(frame, window(self.map.poses[views]), WAY, thick)
            (end,) = window(self.map.poses[views[-1:]])
            disc(frame, tuple(end), 4.0 + thick, WAY, 3)
        size = 1.5 + thick / 2
        for place, spot in enumerate(window(self.map.poses[self.map.places])):
            disc(frame, tuple(spot), size, LINK)
            if scene.belief is not None:
                share = float(scene.belief.probabilities[place])
                if share > 0.01:
                    disc(frame, tuple(spot), size + 2.5 * thick * math.sqrt(share), BELIEF)


def _draw_path(frame: Pixels, window: Window, path: Array, thick: int) -> None:
    points = broken_at_jumps(path)
    gaps = np.flatnonzero(~np.isfinite(points).all(axis=1))
    for part in np.split(points, gaps):
        part = part[np.isfinite(part).all(axis=1)]
        if len(part) > 1:
            polyline(frame, window(part), PATH, thick)


def _draw_robot(frame: Pixels, window: Window, pose: Array, size: float) -> None:
    if np.isfinite(pose).all():
        (spot,) = window(pose[None])
        arrow_head(frame, spot, np.array([math.cos(pose[2]), -math.sin(pose[2])]), PAPER, size + 4)
        arrow_head(frame, spot, np.array([math.cos(pose[2]), -math.sin(pose[2])]), DARK, size)


def _said(scene: FrameState) -> list[tuple[str, Colour]]:
    """What stands beside the pictures, line by line."""
    lines = [(f"{scene.seconds:.1f} s", DARK)]
    if scene.belief is not None:
        place = int(np.argmax(scene.belief.probabilities))
        lines.append((f"believed: place {place}, {100 * float(scene.belief.probabilities[place]):.0f} %", DARK))
    if scene.way is not None:
        goal = f", goal: place {int(scene.way.places[-1])}" if len(scene.way.places) else ""
        lines.append((f"{scene.way.state}{goal}", DARK))
    if scene.progress is not None:
        lines.append((f"views reached: {scene.progress.at} of {scene.progress.of}", DARK))
    if scene.status is not None:
        lines.append((f"driving: {scene.status.state}", DARK))
    vector, kinds = scene.glance.vector, scene.glance.kinds
    if vector is not None:
        far = f"{100 * vector.ratio:.0f} % left" if vector.metres is None else f"{vector.metres:.2f} m away"
        lines.append(("homing: the target is lost" if vector.state == "lost" else f"homing: {far}", DARK))
        counted = [f"{int(np.count_nonzero(kinds == kind))} {name}" for kind, name in NAMES.items()]
        lines += [(", ".join(counted[:2]), QUIET), (", ".join(counted[2:]), QUIET)]
    return lines


def written(frame: Pixels, words: Sequence[tuple[float, float, str, Colour]]) -> Pixels:
    """A frame with texts (left, top, text, colour) on it."""
    from PIL import Image as Picture  # comes with matplotlib
    from PIL import ImageDraw

    page = Picture.fromarray(frame[:, :, ::-1])
    pen = ImageDraw.Draw(page)
    for left, top, text, colour in words:
        pen.text((left, top), text, font=_font(12), fill=colour[::-1])
    return np.ascontiguousarray(np.asarray(page, np.uint8)[:, :, ::-1])


@cache
def _font(size: int) -> "FreeTypeFont":
    import matplotlib
    from PIL import ImageFont

    return ImageFont.truetype(f"{matplotlib.get_data_path()}/fonts/ttf/DejaVuSans.ttf", size)
