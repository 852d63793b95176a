"""A video of a run: its images, and the robot on its map."""

import math
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import groupby
from pathlib import Path
from typing import Annotated, Any

import cv2
import numpy as np
import numpy.typing as npt

from omninav.pipeline import BadInput, Bounds, Context, Tool, user_path
from omninav.pipeline.mcap.reader import LogReader
from omninav.stages.geometry.arrays import Array
from omninav.stages.recordings.messages import pose_of
from omninav.stages.values.confidence import SURE_STATES
from omninav.stages.values.image import Pixels
from omninav.stages.values.thumbnails import decoded

WIDTH, BAND, MAX_HEIGHT = 960, 40, 960
"""Width of the video, height of the line of text below the image, and largest height of the floor, pixels."""
MIN_RATE, MAX_RATE = 1.0, 120.0
"""Fewest and most images that the video shows in a second: players stumble over others."""
MARGIN_M = 1.0
"""Floor that is shown around the grid, the map and the way, metres."""
CARRIED_M = 0.5
"""Distance between two poses beyond which the robot was carried, not driven, metres."""
CODECS = {".mp4": "mp4v", ".webm": "VP80"}
"""Codecs by the file's ending: OpenCV has no encoder of H.264. Browsers play a .webm, which takes longer to write."""
BLACK, GREY, LIGHT, GREEN, BLUE, ORANGE, PINK = (
    (30, 30, 30), (150, 150, 150), (215, 215, 215), (60, 160, 40), (220, 110, 60), (20, 120, 240), (190, 130, 230),
)  # fmt: skip
TOPICS = {
    "/panorama/compressed", "/grid", "/map", "/plan", "/belief", "/ground_truth/pose", "/estimate/pose",
    "/estimate/confidence", "/estimate/state",
}  # fmt: skip


class MakeVideo(Tool):
    """Writes a video of a run: the image, the robot's state, and where it is and believes to be on its map.

    It is drawn from the run's `result.mcap`. The belief is pink, the truth black with the way so far, the estimate
    blue while the robot is tracked and orange while it is not, the planned route green. Raises BadInput for a folder
    without a `result.mcap`, and where no pose is in it.
    """

    example = "runs/latest out=lost.mp4 begin=60 end=120"

    run_folder: str = "runs/latest"
    """The run's folder."""
    out: str = "video.mp4"
    """The file to write: .mp4, or .webm for browsers."""
    begin: Annotated[float, Bounds(ge=0)] = 0.0
    """Seconds of the run at which it begins."""
    end: Annotated[float | None, Bounds(gt=0)] = None
    """Seconds at which it ends; null: with the run."""
    speed: Annotated[float, Bounds(gt=0)] = 4.0
    """Times as fast as it was."""

    def run(self, ctx: Context) -> None:
        log, out = user_path(self.run_folder) / "result.mcap", user_path(self.out)
        if out.suffix not in CODECS:
            raise BadInput(f"out: {self.out} is no .mp4 or .webm; type out=video.mp4")
        if self.end is not None and self.begin >= self.end:
            raise BadInput(f"begin={self.begin:g} is not before end={self.end:g}; both are seconds of the run")
        if out.is_file() and not _is_such(out):
            raise BadInput(f"out: {out} is there, and no such video; type another name, or delete it")
        if not log.is_file():
            raise BadInput(f"{self.run_folder}: no result.mcap in it; name the folder of a run that has ended")
        messages = LogReader(log)
        scenes = [scene for scene in scenes_in(messages) if self.begin <= scene["seconds"] <= (self.end or math.inf)]
        for lost in messages.details.values():
            print(f"{lost}; the video shows what is left", file=sys.stderr)
        if not scenes:
            end = f"{self.end:g} s" if self.end else "the end"
            raise BadInput(f"{self.run_folder}: no poses between {self.begin:g} s and {end}; see its frames.csv")
        steps = np.diff([scene["seconds"] for scene in scenes])  # their median: between logs are hours
        step = max(float(np.median(steps)), 1e-9) if len(steps) else 1.0
        rate = min(max(self.speed / step, MIN_RATE), MAX_RATE)
        floor = Floor(scenes)
        with _writer(out, rate, (WIDTH, floor.seen_height + BAND + floor.height)) as writer:
            for number in range(len(scenes)):
                writer.write(floor.frame(number))
        print(f"{out}: {len(scenes)} images, {len(scenes) / rate:.0f} s, {out.stat().st_size / 1e6:.1f} MB")


def scenes_in(log: LogReader) -> Iterator[dict[str, Any]]:
    """The last content of each topic at each tick with a pose, as `seconds` since the first, and the topic's name."""
    known: dict[str, Any] = {}
    begun = None
    for stamp, messages in groupby(log.messages(TOPICS), key=lambda message: message.stamp):
        now = {message.topic: message.content for message in messages}
        begun = stamp if begun is None else begun
        known |= now
        if {"/estimate/pose", "/ground_truth/pose"} & set(now):
            yield {**known, "seconds": (stamp - begun) / 1e9}


class Floor:
    """The floor from above: obstacles and the map's references, and how metres become pixels."""

    def __init__(self, scenes: list[dict[str, Any]]) -> None:
        last = scenes[-1]
        self.scenes, self.poses = scenes, np.array([_pose(scene) for scene in scenes])
        self.carried = np.flatnonzero(np.hypot(*np.diff(self.poses[:, :2], axis=0).T) > CARRIED_M) + 1
        self.seen_height = 0
        if "/panorama/compressed" in last:
            rows, columns = decoded(last["/panorama/compressed"].data.tobytes()).shape[:2]
            self.seen_height = 2 * round(WIDTH * rows / columns / 2)
        self.references = np.array(
            [
                (p.x, p.y)
                for marker in _field(last, "/map", "markers")
                if marker.ns == "references"
                for p in marker.points
            ]
        ).reshape(-1, 2)
        shown = [self.references, self.poses[:, :2]]
        grid = last.get("/grid")
        if grid is not None:
            corner = np.array([grid.info.origin.position.x, grid.info.origin.position.y])
            shown.append(corner + grid.info.resolution * np.array([[0, 0], [grid.info.width, grid.info.height]]))
        points = np.concatenate(shown)
        low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
        width, depth = high - low
        self.scale = min(WIDTH / width, MAX_HEIGHT / depth)
        self.height = 2 * max(1, round(self.scale * depth / 2))
        self.low = (low + high) / 2 - np.array([WIDTH, self.height]) / (2 * self.scale)
        self.plan = np.full((self.height, WIDTH, 3), 255, np.uint8)
        if grid is not None:
            cells = np.array(grid.data, np.int8).reshape(grid.info.height, grid.info.width)
            ends = self.pixels(corner + grid.info.resolution * np.array([[0, 0], cells.shape[::-1]]))
            (left, bottom), (right, top) = np.clip(ends, 0, (WIDTH, self.height)).tolist()
            occupied = np.where(cells[::-1] > 50, np.uint8(255), np.uint8(0))
            there = self.plan[top:bottom, left:right]
            there[cv2.resize(occupied, there.shape[1::-1], interpolation=cv2.INTER_AREA) > 0] = LIGHT
        for point in self.pixels(self.references):
            cv2.circle(self.plan, point.tolist(), 1, GREY, -1, cv2.LINE_AA)

    def pixels(self, points: Array) -> npt.NDArray[np.int32]:
        """Columns and rows (N, 2) of points (N, 2)."""
        x, y = (self.scale * (points[:, :2] - self.low)).T
        return np.round(np.column_stack([x, self.height - y])).astype(np.int32)

    def frame(self, number: int) -> Pixels:
        """One image of the video, of the scene with a number: what the robot sees, a line of text, the floor."""
        scene, floor = self.scenes[number], self.plan.copy()
        if "/plan" in scene:
            route = np.array([(each.pose.position.x, each.pose.position.y) for each in scene["/plan"].poses])
            cv2.polylines(floor, [self.pixels(route.reshape(-1, 2))], False, GREEN, 2, cv2.LINE_AA)
        belief = np.array([(each.position.x, each.position.y) for each in _field(scene, "/belief", "poses")])
        for point in self.pixels(belief.reshape(-1, 2)):
            cv2.circle(floor, point.tolist(), 2, PINK, -1, cv2.LINE_AA)
        way = self.pixels(self.poses[: number + 1])
        for piece in np.split(way, self.carried[self.carried <= number]):
            cv2.polylines(floor, [piece], False, BLACK, 1, cv2.LINE_AA)
        state = scene["/estimate/state"].data if "/estimate/state" in scene else ""
        colour = BLUE if state in (*SURE_STATES, "") else ORANGE
        self._dart(floor, self.poses[number], BLACK)
        if "/estimate/pose" in scene:
            self._dart(floor, np.array(pose_of(scene["/estimate/pose"])), colour)
        said = f"{scene['seconds']:6.1f} s   {state}"
        if "/estimate/confidence" in scene:
            said += f"   confidence {scene['/estimate/confidence'].data:.2f}"
        band = np.full((BAND, WIDTH, 3), colour, np.uint8)
        cv2.putText(band, said, (12, 28), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (255, 255, 255), 2, cv2.LINE_AA)
        return np.concatenate([self._seen(scene), band, floor])

    def _seen(self, scene: dict[str, Any]) -> Pixels:
        """The image that the robot saw last, as wide as the video, black before the first."""
        if "/panorama/compressed" not in scene:
            return np.zeros((self.seen_height, WIDTH, 3), np.uint8)
        image = decoded(scene["/panorama/compressed"].data.tobytes())
        return np.asarray(cv2.resize(image, (WIDTH, self.seen_height)), np.uint8)

    def _dart(self, floor: Pixels, pose: Array, colour: tuple[int, int, int]) -> None:
        angles = pose[2] + np.array([0.0, 2.5, math.pi, -2.5])
        reach = np.array([0.6, 0.4, 0.15, 0.4])[:, None]
        corners = self.pixels(pose[:2] + reach * np.column_stack([np.cos(angles), np.sin(angles)]))
        cv2.fillPoly(floor, [corners], colour, cv2.LINE_AA)


def _pose(scene: dict[str, Any]) -> Array:
    """The true pose (3,), or without truth the estimated one."""
    if "/ground_truth/pose" in scene:
        return np.array(pose_of(scene["/ground_truth/pose"]))
    return np.array(pose_of(scene["/estimate/pose"]))


def _field(scene: dict[str, Any], topic: str, name: str) -> Any:
    return getattr(scene[topic], name) if topic in scene else []


def _is_such(file: Path) -> bool:
    """Tells whether a file may be a video that this tool wrote: by its width and codec, since it names no program."""
    video = cv2.VideoCapture(str(file))
    codec = int(video.get(cv2.CAP_PROP_FOURCC)).to_bytes(4, "little")
    return bool(video.get(cv2.CAP_PROP_FRAME_WIDTH) == WIDTH and codec in (b"FMP4", b"VP80"))


@contextmanager
def _writer(out: Path, rate: float, size: tuple[int, int]) -> Iterator[cv2.VideoWriter]:
    """A writer of a hidden file beside `out`, which takes its place when the block ends well."""
    if not out.parent.is_dir():
        raise BadInput(f"out: {out} cannot be written; is its folder there?")
    part = out.with_name(f".{out.stem}.part{out.suffix}")  # the codec's container goes by the ending
    writer = cv2.VideoWriter(str(part), cv2.VideoWriter.fourcc(*CODECS[out.suffix]), rate, size)
    try:
        if not writer.isOpened():
            raise BadInput(f"out: {out} cannot be written; may you write to its folder, or type out=video.mp4")
        yield writer
        writer.release()
        if not cv2.VideoCapture(str(part)).isOpened():  # OpenCV's writer does not report a full disk
            raise BadInput(f"out: {out} could not be written whole; is there space left?")
        os.replace(part, out)
    finally:
        writer.release()
        part.unlink(missing_ok=True)
