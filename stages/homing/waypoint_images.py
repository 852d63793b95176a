"""WaypointImagesState a path of pictures: which one to go to now."""

import math
from typing import Annotated

from omninav.pipeline import Bounds, Context, Outputs, Stage, State
from omninav.stages.values.homing import HomingTarget, HomingVector, ImagePath, PathProgress
from omninav.stages.values.local_features import LocalFeatures


class WaypointImagesState(State):
    """Where on which path it is: numbers of the path and of the target, views reached, whether only a turn is left."""

    path: int = -1
    target: int = -1
    at: int = 0
    docking: bool = False
    arrived: bool = False


class WaypointImages(Stage):
    """Goes on to the next view of a path as soon as one is close enough, and stops at the last with its heading.

    Goedemé et al. 2007, section 7.2.4. A view on the way is reached where `reached` of the way to it is left, or where
    it lies behind and less than half of the way is. The last one is reached within `docked_m` metres, where odometry
    has told the unit, at a nearness of `docked_nearness` (distance over that of what is seen), or where it lies behind
    and is `passed_nearness` near; from there on the robot only turns, until it has the view's heading within
    `heading_deg`. A view that hardly differs from the present one to begin with (a nearness of `passed_nearness`) is
    reached at once, if it is not the last. What is said of a lost target counts for nothing.

    `vector` is the one of the tick before, by a delayed wire. A path of another number begins anew at its first view.
    """

    reached: Annotated[float, Bounds(gt=0, lt=1)] = 0.2
    docked_m: Annotated[float, Bounds(gt=0)] = 0.04
    docked_nearness: Annotated[float, Bounds(gt=0)] = 0.007
    passed_nearness: Annotated[float, Bounds(gt=0)] = 0.03
    heading_deg: Annotated[float, Bounds(gt=0)] = 3.0

    class Out(Outputs):
        """`features` are the target's. Absent where there is no path, or an empty one, or the robot has arrived."""

        target: HomingTarget | None = None
        features: LocalFeatures | None = None
        progress: PathProgress | None = None

    def step(
        self,
        ctx: Context,
        along: WaypointImagesState,
        path: ImagePath | None = None,
        vector: HomingVector | None = None,
    ) -> Out:
        """The target of this tick."""
        if path is None or not path.views:
            along.path = -1
            return self.Out()
        if path.number != along.path:
            along.path, along.at, along.docking, along.arrived = path.number, 0, False, False
            along.target += 1
        elif vector is not None and vector.number == along.target and vector.state != "lost":
            self._go_on(along, vector, len(path.views))
        last = along.at >= len(path.views) - 1
        progress = PathProgress(along.path, along.at, len(path.views), along.target, last, along.docking, along.arrived)
        if along.arrived:
            return self.Out(progress=progress)
        name = path.names[along.at] if path.names else ""
        view = path.views[along.at]
        return self.Out(target=HomingTarget(along.target, view, last, name), features=view, progress=progress)

    def _go_on(self, along: WaypointImagesState, vector: HomingVector, views: int) -> None:
        behind, close = math.cos(vector.direction) < 0.0, vector.nearness <= self.passed_nearness
        if along.at < views - 1:
            if close or vector.ratio <= self.reached or (behind and vector.ratio < 0.5):
                along.at += 1
                along.target += 1
            return
        there = vector.nearness <= self.docked_nearness or (close and behind)
        there = there or (vector.metres is not None and vector.metres <= self.docked_m)
        along.docking = along.docking or there
        if along.docking and abs(vector.turn) <= math.radians(self.heading_deg):
            along.at, along.arrived = views, True
