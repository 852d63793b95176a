"""The first belief of a log over the places of a topological map."""

from typing import Annotated

import numpy as np

from omninav.pipeline import BadInput, Bounds, Context, Outputs, Stage, Tick
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.commands import Reinitialise
from omninav.stages.values.pose import Pose
from omninav.stages.values.topological_map import TopologicalMap

from .first_pose import Where, first_pose


class PlacePrior(Stage):
    """Gives the belief over places at the first image of each log.

    Goedemé et al. 2007, section 5.1. Raises BadInput where `truth` is asked for and there is none, or where the map has
    no place.
    """

    at: Where = "uniform"
    """`uniform`: a kidnapped robot. Else the place whose medoid was taken closest to the log's first true pose, to the
    origin, or to x, y (m) of a pose and its spread, of which nothing else counts."""
    restart_after: Annotated[int, Bounds(ge=1)] | None = None
    """Images after which the robot is kidnapped again, for many trials on one log; null: never."""

    class Out(Outputs):
        """The belief to begin with; absent where none begins."""

        belief: PlaceBelief | None = None

    def step(
        self,
        ctx: Context,
        tick: Tick,
        map: TopologicalMap,
        truth: Pose | None = None,
        restart: Reinitialise | None = None,
    ) -> Out:
        """Give the first belief, also where a running robot is to start again (`restart`)."""
        where = self.at if restart is None else restart.at or "uniform"
        if not (
            tick.first_of_log or restart is not None or (self.restart_after and tick.index % self.restart_after == 0)
        ):
            return self.Out()
        if not len(map):
            raise BadInput("start: the map has no place; make it from a tour with images (tour=...)")
        poses = map.poses[map.places]
        if where == "uniform":
            return self.Out(belief=PlaceBelief(np.full(len(map), 1.0 / len(map)), poses))
        pose, _ = first_pose(where, truth)
        closest = int(np.argmin(np.hypot(poses[:, 0] - pose[0], poses[:, 1] - pose[1])))
        return self.Out(belief=PlaceBelief((np.arange(len(map)) == closest).astype(np.float64), poses))
