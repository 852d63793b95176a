"""The first belief of a log over the places of a topological map."""

from typing import Annotated, Literal

import numpy as np

from omninav.pipeline import Bounds, Context, Outputs, Stage, Tick
from omninav.pipeline.graph.problems import BadInput
from omninav.stages.values.belief import PlaceBelief
from omninav.stages.values.pose import Pose
from omninav.stages.values.topological_map import TopologicalMap


class PlacePrior(Stage):
    """A belief over places at the first picture of each log.

    Goedemé et al. 2007, section 5.1: `uniform`, a kidnapped robot. Or a place: the one whose medoid was taken closest
    to the log's first true pose (`truth`), to the origin (`origin`), or to x, y (m) of a pose and its spread, of which
    nothing else counts here. `anew_after`: so many pictures later it begins anew, again and again: many kidnapped
    robots on one log; null: never. Raises BadInput where `truth` is asked for and there is none, or a map has no place.
    """

    at: Literal["uniform", "truth", "origin"] | tuple[float, float, float, float, float] = "uniform"
    anew_after: Annotated[int, Bounds(ge=1)] | None = None

    class Out(Outputs):
        """The belief to begin with; absent where none begins."""

        belief: PlaceBelief | None = None

    def step(self, ctx: Context, tick: Tick, map: TopologicalMap, truth: Pose | None = None) -> Out:
        """Give the first belief."""
        if not (tick.first_of_log or (self.anew_after and tick.index % self.anew_after == 0)):
            return self.Out()
        if not len(map):
            raise BadInput("start: the map has no place; make it from a tour with pictures (tour=...)")
        poses = map.poses[map.places]
        if self.at == "uniform":
            return self.Out(belief=PlaceBelief(np.full(len(map), 1.0 / len(map)), poses))
        if self.at == "truth" and truth is None:
            raise BadInput("start: this log has no true pose at its first picture; use start=uniform")
        if self.at == "truth" and truth is not None:
            x, y = truth.x, truth.y
        else:
            x, y = (0.0, 0.0) if isinstance(self.at, str) else self.at[:2]
        closest = int(np.argmin(np.hypot(poses[:, 0] - x, poses[:, 1] - y)))
        return self.Out(belief=PlaceBelief((np.arange(len(map)) == closest).astype(np.float64), poses))
