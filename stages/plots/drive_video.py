"""A drive by homing as a video, for the report and as a file."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
import numpy.typing as npt

from omninav.pipeline import Bounds, Context, Figure, Outputs, Stage
from omninav.pipeline.files import write_whole
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.drive import Drive
from omninav.stages.values.floor_plan import FloorPlan
from omninav.stages.values.homing import DrivingStatus, PathProgress
from omninav.stages.values.planned_route import PlannedRoute
from omninav.stages.values.thumbnails import Thumbnails
from omninav.stages.values.topological_map import TopologicalMap

from .homing_snapshot import EncodedHomingView
from .snapshot_times import spread_out
from .target_images import target_of
from .video import encoded
from .video_frames import FrameState, VideoFrames

AROUND_M = 2.5
"""Distance around the robot that the lower plan shows, metres."""


class DriveVideo(Stage):
    """Writes `drive.mp4`: a frame for every snapshot of homing.

    It shows the robot's image with the tracked features and the homing vector, the target view, the plan with the path
    so far, the belief over places, and the planned route; below it the robot's surroundings, and its state. Where
    OpenCV has no encoder for VP9 it is `drive.gif`. The same run gives the same bytes.
    """

    per_second: Annotated[float, Bounds(gt=0)] = 8.0
    """VideoFrames a second."""
    frames: Annotated[int, Bounds(ge=1)] = 120
    """Largest number of frames, some 40 kB and 0.3 s each; of a long drive every second snapshot, or every third."""
    after_s: Annotated[float, Bounds(ge=0)] = 1.5
    """Seconds that are shown after the robot has arrived or given up."""

    class Out(Outputs):
        """`figure`: the video for the report; absent where nothing was seen."""

        figure: Figure | None = None

    def step(
        self,
        ctx: Context,
        drive: Drive,
        snapshots: Sequence[EncodedHomingView | None],
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
        there = [row for row, snapshot in enumerate(snapshots) if snapshot is not None and row <= last]
        if not there:
            return self.Out()
        states = []
        for row in (there[n] for n in spread_out(len(there), self.frames)):
            snapshot, route = snapshots[row], None if routes is None else routes[row]
            assert snapshot is not None
            goal, target = target_of(progress[row], route, map, path[0], thumbnails)
            if snapshot.vector is None:
                goal = np.full(3, np.nan)
            belief = None if beliefs is None else beliefs[row]
            states.append(
                FrameState(
                    row,
                    float(drive.seconds[row]),
                    snapshot,
                    target,
                    path[row],
                    goal,
                    belief,
                    route,
                    progress[row],
                    statuses[row],
                )
            )
        frames = VideoFrames(states, path, plan, map, AROUND_M)
        ctx.doing(f"drawing a video of {len(frames)} frames")
        video = encoded(frames, self.per_second)
        name = f"drive{video.suffix}"
        if ctx.folder is not None:
            write_whole(ctx.folder / name, video.content)
        length = (stamps[states[-1].row] - stamps[states[0].row]) / 1e9
        faster = length / max(len(states) - 1, 1) * self.per_second
        return self.Out(
            figure=Figure(
                name="drive_video",
                title="Video of the drive",
                caption=f"{len(states)} frames of the first {length:.0f} s, {faster:.1f} times as fast as it was; also "
                f"in the file {name} beside this page. Left: the robot's image with its tracked features "
                "and the homing vector over the floor; below it the target view. Right: the plan with its "
                "true path (blue), the belief over places (pink) and the planned route (green); below "
                "it the floor around the robot, with the vector as an arrow and a ring where the target view was truly "
                "taken; the bar is a metre.",
                content=video.content,
                media_type=video.media_type,
                order=3,
                per_second=self.per_second,
            )
        )


def _last_tick(
    statuses: Sequence[DrivingStatus | None],
    routes: Sequence[PlannedRoute | None] | None,
    stamps: npt.NDArray[np.int64],
    after: int,
) -> int:
    """The last tick worth showing: so long (ns) after it arrived or gave up for good."""
    states = [s.state if s else "" for s in statuses] if routes is None else [r.state if r else "" for r in routes]
    end = len(states)
    while end > 0 and states[end - 1] in ("arrived", "gave up"):
        end -= 1
    if end == len(states):
        return len(states) - 1
    return int(np.searchsorted(stamps, stamps[end] + after, side="right")) - 1
