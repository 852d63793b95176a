"""The waypoints of a path of images: which one to go to now."""

import math

from omninav.pipeline import Context, Outputs, Stage, State
from omninav.stages.values.homing import HomingTarget, HomingVector, ImagePath, PathProgress
from omninav.stages.values.local_features import LocalFeatures

REACHED_RATIO = 0.2
"""Share of the way to a view that is left where it counts as reached, but for the last."""
ARRIVAL_DISTANCE_M = 0.04
"""Distance to the last view at which the robot has arrived, where odometry tells metres."""
ARRIVAL_DEPTH_RATIO = 0.007
"""Depth ratio of the last view at which the robot has arrived."""
PASSED_DEPTH_RATIO = 0.03
"""Depth ratio of a view that hardly differs from the present one, reached at once; of the last where it is behind."""
DOCKING_DEPTH_RATIO = 0.05
"""Depth ratio of the last view beyond which a robot that turns there is not there after all."""
MAX_HEADING_ERROR_DEG = 3.0
"""Largest heading error at the last view, degrees."""


class WaypointImagesState(State):
    """Place of the robot on its path.

    `path`, `target`: their numbers; `reached`: views so far; `docking`: only a turn is left; `arrived`.
    """

    path: int = -1
    target: int = -1
    reached: int = 0
    docking: bool = False
    arrived: bool = False


class WaypointImages(Stage):
    """Moves on to the next view of a path as soon as one is close enough, and stops at the last with its heading.

    Goedemé et al. 2007, section 7.2.4. A view on the way is also reached where it is behind and less than half of the
    way to it is left. At the last view the robot only turns, until it has the view's heading. A lost target's vector
    does not count; a doubtful one means that the robot is not there yet. `vector` is the one of the tick before, by a
    delayed wire. A path with another number starts again at its first view. The depth ratio is the distance over that
    of a typical feature.
    """

    class Out(Outputs):
        """`features` are the target's. Absent where there is no path, or an empty one, or the robot has arrived."""

        target: HomingTarget | None = None
        features: LocalFeatures | None = None
        progress: PathProgress | None = None

    def step(
        self,
        ctx: Context,
        state: WaypointImagesState,
        path: ImagePath | None = None,
        vector: HomingVector | None = None,
    ) -> Out:
        if path is None or not path.views:
            state.path = -1
            return self.Out()
        if path.number != state.path:
            state.path, state.reached, state.docking, state.arrived = path.number, 0, False, False
            state.target += 1
        elif vector is not None and vector.number == state.target:
            state.docking &= vector.state != "doubtful" and vector.depth_ratio <= DOCKING_DEPTH_RATIO
            if vector.is_found:
                self._go_on(state, vector, len(path.views))
        last = state.reached >= len(path.views) - 1
        progress = PathProgress(
            state.path, state.reached, len(path.views), state.target, last, state.docking, state.arrived
        )
        if state.arrived:
            return self.Out(progress=progress)
        name = path.names[state.reached] if path.names else ""
        view = path.views[state.reached]
        return self.Out(target=HomingTarget(state.target, view, last, name), features=view, progress=progress)

    def _go_on(self, state: WaypointImagesState, vector: HomingVector, views: int) -> None:
        behind, close = math.cos(vector.direction) < 0.0, vector.depth_ratio <= PASSED_DEPTH_RATIO
        if state.reached < views - 1:
            if close or vector.ratio <= REACHED_RATIO or (behind and vector.ratio < 0.5):
                state.reached += 1
                state.target += 1
            return
        there = vector.depth_ratio <= ARRIVAL_DEPTH_RATIO or (close and behind)
        there = there or (vector.metres is not None and vector.metres <= ARRIVAL_DISTANCE_M)
        state.docking = state.docking or there
        if state.docking and abs(vector.turn) <= math.radians(MAX_HEADING_ERROR_DEG):
            state.reached, state.arrived = views, True
